"""Files with columns: text with a delimiter, NumPy arrays, files of Arrow, and sheets of Excel.

All of them know the names of their columns, read columns as numbers, say which are none, and where a row is. Text is
read by `csv`; what is not said by options is told from the first rows: the encoding, the delimiter, the decimal sign,
and whether the first row has names.
"""

from __future__ import annotations

import bz2
import codecs
import csv
import gzip
import lzma
import math
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from io import BytesIO, TextIOWrapper
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.extras import optional
from cvtimg._shared.messages import one_line

#: Marks of missing values, in small letters.
_NO_VALUE = frozenset(
    ["", "na", "n/a", "n.a.", "#n/a", "<na>", "nan", "nat", "null", "none", "nil", "missing", "?", "-", "--", "."]
)
_TRUTHS = frozenset(("true", "false", "yes", "no", "t", "f", "y", "n"))
#: Tried in this order; a comma comes after those beside which it is a decimal sign.
_DELIMITERS = "\t;|, "
#: Rows that tell the delimiter, the names and kinds of columns, and the decimal sign.
_LOOKED_AT = 1000
#: Rows of a column that counts them, or that identifies them in order, at least.
_COUNTED = 10
_UNPACKED = {b"\x1f\x8b": gzip.decompress, b"BZ": bz2.decompress, b"\xfd7": lzma.decompress}
_BOMS = {
    codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}  # fmt: skip
#: Suffixes of files of Arrow's columns, and of sheets.
_ARROW, _SHEETS = (".feather", ".arrow", ".ipc", ".parquet"), (".xlsx", ".xlsm")
_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}(?:[, \u00a0\u202f'\u2019]\d{3})+(?:\.\d*)?")
_WITH_COMMA = re.compile(r"[-+]?(?:[1-9]\d{0,2}(?:[. \u00a0\u202f'\u2019]\d{3})+|\d*)(?:,\d*)?(?:[eE][-+]?\d+)?")
#: A line that is no row; a color may begin one.
_COMMENT = re.compile(r"#(?![0-9a-fA-F]{6}\b)")
_DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}(?:[T ].*)?|\d{1,2}:\d{2}(?::\d{2}.*)?")


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a table is written; None for what the file tells.

    Attributes
    ----------
    delimiter : str, optional
        The letter between values; a space for any number of spaces.
    decimal : {".", ","}, optional
        The decimal sign. The other one, a space or an apostrophe may be between groups of three digits.
    encoding : str, optional
        Such as "utf-8", "cp1252" or "utf-16".
    header : bool, optional
        Whether the first row has the names of the columns.
    missing_values : sequence of str
        Marks of missing values, beside the usual ones, such as "-999".
    """

    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    header: bool | None = None
    missing_values: Sequence[str] = ()


def open_columns(path: Path, dialect: Dialect | None = None) -> Columns:
    """Open a file by its suffix; any that is none of arrays, Arrow or Excel is text, perhaps compressed."""
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _of_array(path)
    if suffix in _ARROW:
        return _of_arrow(path)
    return _Text(path, dialect or Dialect())


class Columns:
    """A file with columns."""

    path: Path
    names: list[str]
    named: bool  # whether the file gives the names
    reasons: dict[str, str]  # why columns are not used unless they are asked for

    def values(self, columns: Sequence[int]) -> NDArray[np.float64]:
        """Read (M, C) numbers, NaN where one is missing."""
        raise NotImplementedError

    def cells(self) -> Iterator[Sequence[Any]]:
        """Go through all rows as they stand."""
        raise NotImplementedError

    def place(self, row: int) -> str:
        """Say where a row is."""
        return f"row {row} (from 0)"

    def plain(self, row: Sequence[Any]) -> list[str]:
        """Return a row as texts, numbers with a decimal point."""
        return [str(cell) for cell in row]


class _Arrays(Columns):
    """Columns that have types."""

    def __init__(self, path: Path, names: Sequence[str], columns: Sequence[Any], *, named: bool) -> None:
        self.path, self.names, self.named, self._columns = path, _distinct(names), named, columns
        kinds = [column.dtype.kind if column.ndim == 1 else "V" for column in columns]
        self.reasons = {}
        if named:
            said = {"b": "truths", "M": "dates", "m": "durations", "c": "complex numbers", "V": "arrays"}
            self.reasons = {
                name: said.get(kind, "text") for name, kind in zip(self.names, kinds, strict=True) if kind not in "iuf"
            }

    def values(self, columns: Sequence[int]) -> NDArray[np.float64]:
        for number in columns:
            column = self._columns[number]
            if column.dtype.kind not in "biuf" or column.ndim != 1:
                name, kind = self.names[number], column.dtype if column.ndim == 1 else f"{column.shape[1:]} of arrays"
                raise ValueError(f"{self.path}: column {name!r} of type {kind} is not of numbers")
        return np.stack([self._columns[number] for number in columns], axis=1).astype(np.float64)

    def cells(self) -> Iterator[Sequence[Any]]:
        return zip(*(column.tolist() for column in self._columns), strict=True)


def _of_array(path: Path) -> Columns:
    with path.open("rb") as file:
        try:
            # Not np.load, which would also read archives.
            array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
        except (ValueError, EOFError) as error:
            raise ValueError(f"{path}: is not a complete .npy file of numbers ({one_line(error)})") from error
    if array.ndim not in ((1,) if array.dtype.names else (1, 2)):
        raise ValueError(f"{path}: array of shape {array.shape} must be (N,) or (N, D), (N,) if structured")
    if array.dtype.names:
        return _Arrays(path, array.dtype.names, [array[name] for name in array.dtype.names], named=True)
    columns = list(array.T) if array.ndim == 2 else [array]
    return _Arrays(path, _numbered(len(columns)), columns, named=False)


def _of_arrow(path: Path) -> Columns:
    pyarrow = optional("pyarrow", "parquet", f"{path}: needs")
    from pyarrow import feather, parquet

    try:
        table = (parquet.read_table if path.suffix.lower() == ".parquet" else feather.read_table)(path)
    except pyarrow.ArrowException as error:
        raise ValueError(f"{path}: is not a table of Arrow ({one_line(error)})") from error
    columns = []
    for column in table.columns:
        if column.null_count and (pyarrow.types.is_integer(column.type) or pyarrow.types.is_floating(column.type)):
            column = column.cast(pyarrow.float64())
        columns.append(column.to_numpy())
    return _Arrays(path, table.column_names, columns, named=True)


class _Text(Columns):
    """Text with a delimiter, or a sheet, whose cells become text."""

    def __init__(self, path: Path, dialect: Dialect) -> None:
        self.path, self._dialect = path, dialect
        self._no_value = _NO_VALUE | {mark.strip().casefold() for mark in dialect.missing_values}
        self._is_sheet = path.suffix.lower() in _SHEETS
        self._content, self._encoding = (b"", "") if self._is_sheet else self._read()
        self._n_before, self._is_named_by_comment, said = (0, False, "") if self._is_sheet else self._preamble()
        self._delimiter = dialect.delimiter or said or ("," if self._is_sheet else self._told_delimiter())
        first = list(islice(self._records(), _LOOKED_AT))
        if not first:
            raise ValueError(f"{path}: is empty")
        rows = first[1:] or first
        self._n_fields = Counter(map(len, rows)).most_common(1)[0][0]
        if self._is_named_by_comment and len(first[0]) != self._n_fields:  # it says something else
            first, self._is_named_by_comment, self._n_before = rows, False, self._n_before + 1
        if len(first[0]) == 1 and (self._delimiter, self._n_fields, dialect.delimiter) == (",", 2, None):
            self._delimiter, self._n_fields = ";", 1  # one name above numbers with a decimal comma
            first = list(islice(self._records(), _LOOKED_AT))
            rows = first[1:]
        self.named = self._is_header(first[0], first[1:]) if dialect.header is None else dialect.header
        head = list(first[0]) if self.named else [""] * self._n_fields
        if len(head) == self._n_fields - 1:
            # Without a name of the last, empty column; R gives none to the first, the names of rows.
            is_last = all(not row[-1].strip() for row in rows if len(row) == self._n_fields)
            head = [*head, ""] if is_last else ["", *head]
        if len(head) > self._n_fields and not any(name.strip() for name in head[self._n_fields :]):
            head = head[: self._n_fields]
        if len(head) != self._n_fields:
            row = 1 if len(first) > 1 else 0
            raise ValueError(
                f"{path}: line {self._line(row)} has {len(first[row])} values, and the first line {len(head)}"
            )
        named = [name.strip() or number for name, number in zip(head, _numbered(len(head)), strict=True)]
        self.names, self._unnamed = _distinct(named), [not name.strip() for name in head]

    # Text and its rows

    def _read(self) -> tuple[bytes, str]:
        """Read and unpack the file; tell its encoding."""
        content = self.path.read_bytes()
        try:
            if content.startswith(b"PK\x03\x04"):
                with zipfile.ZipFile(BytesIO(content)) as packed:
                    inside = [name for name in packed.namelist() if not name.endswith("/")]
                    if len(inside) != 1:
                        raise ValueError(f"{self.path}: has {len(inside)} files, and must have one table")
                    content = packed.read(inside[0])
            unpack = _UNPACKED.get(content[:2])
            content = unpack(content) if unpack else content
        except (OSError, EOFError, lzma.LZMAError, zipfile.BadZipFile, NotImplementedError) as error:
            raise ValueError(f"{self.path}: cannot be unpacked ({one_line(error)})") from error
        told = next((name for bom, name in _BOMS.items() if content.startswith(bom)), None)
        if told is None and content[1:4:2] == b"\0\0":
            told = "utf-16-le"
        for encoding in [self._dialect.encoding] if self._dialect.encoding else [told or "utf-8", "cp1252"]:
            with suppress(UnicodeDecodeError):
                try:
                    text = content[: 1 << 16].decode(encoding, "ignore") if content.decode(encoding) else ""
                except LookupError as error:
                    raise ValueError(
                        f"encoding={encoding!r} must be the name of one, such as utf-8 or cp1252"
                    ) from error
                if not re.search(r"[\x00-\x08\x0e-\x1f]", text):
                    return content, encoding
        said = f"text in {self._dialect.encoding}" if self._dialect.encoding else "text"
        raise ValueError(f"{self.path}: is not {said}; for images there is cvtimg segment")

    def _preamble(self) -> tuple[int, bool, str]:
        """Return the number of lines before the table, whether a comment names its columns, and what ``sep=;`` says."""
        with self._opened() as file:
            lines = list(islice(file, _LOOKED_AT))
        said = re.fullmatch(r"\"?sep=(.)\"?\s*", lines[0]) if lines else None
        n_before = 1 if said else 0
        comments = [n for n, line in enumerate(lines) if n >= n_before and _COMMENT.match(line)]
        while n_before < len(lines) and (n_before in comments or not lines[n_before].strip()):
            n_before += 1
        after = re.split(r"[\t;|, ]+", lines[n_before].strip()) if n_before < len(lines) else []
        # np.savetxt writes names above numbers as a comment.
        names = n_before - 1 in comments and any(self._kind(part.strip("\"'")) == "number" for part in after)
        return n_before - names, names, said[1] if said else ""

    @contextmanager
    def _opened(self) -> Iterator[TextIOWrapper]:
        with TextIOWrapper(BytesIO(self._content), encoding=self._encoding, newline="") as file:
            yield file

    def _told_delimiter(self) -> str:
        """Tell the delimiter: it gives all of the first rows the same number of values, two or more."""
        best, most = ",", 0.0
        for delimiter in _DELIMITERS:
            with suppress(csv.Error):
                sizes = [len(row) for row in islice(self._split(delimiter), _LOOKED_AT)]
                size, n = Counter(sizes).most_common(1)[0] if sizes else (0, 0)
                if size > 1 and n / len(sizes) > most:
                    best, most = delimiter, n / len(sizes)
        return best

    def _split(self, delimiter: str, numbers: list[int] | None = None) -> Iterator[list[str]]:
        """Split the text into rows, without empty lines; `numbers` gets the line in which each ends."""
        with self._opened() as file:
            lines: Iterator[str] = islice(file, self._n_before, None)
            if self._is_named_by_comment:
                lines = chain([next(lines).lstrip("# ")], lines)
            whole = (line.rstrip(" \r\n") + "\n" for line in lines) if delimiter == " " else lines
            reader = csv.reader(whole, delimiter=delimiter, skipinitialspace=True)
            for row in reader:
                if row:  # none is an empty line
                    if numbers is not None:
                        numbers[:] = [reader.line_num + self._n_before]
                    yield row

    def _records(self, numbers: list[int] | None = None) -> Iterator[list[str]]:
        """Go through the rows of the file as texts."""
        if self._is_sheet:
            yield from self._sheet
            return
        try:
            yield from self._split(self._delimiter, numbers)
        except csv.Error as error:
            raise ValueError(f"{self.path}: is not a table ({one_line(error)})") from error

    @cached_property
    def _sheet(self) -> list[list[str]]:
        openpyxl = optional("openpyxl", "excel", f"{self.path}: needs")
        try:
            book = openpyxl.load_workbook(self.path, read_only=True, data_only=True)
            rows = list(book.worksheets[0].values)
        except Exception as error:  # zipfile and openpyxl raise many kinds
            raise ValueError(f"{self.path}: is not a workbook of Excel ({one_line(error)})") from error
        texts = [["" if cell is None else str(cell) for cell in row] for row in rows]
        return [row for row in texts if any(row)]

    def _rows(self, numbers: list[int] | None = None) -> Iterator[list[str]]:
        """Go through the rows below the names; comments between them, and empty ends, are left out."""
        for row in islice(self._records(numbers), int(self.named), None):
            extra = row[self._n_fields :]
            if len(row) != self._n_fields and row[0].startswith("#"):
                continue
            yield row[: self._n_fields] if extra and not any(map(str.strip, extra)) else row

    def cells(self) -> Iterator[Sequence[Any]]:
        return self._rows()

    def place(self, row: int) -> str:
        return f"line {self._line(row + int(self.named))}" if not self._is_sheet else f"row {row + 1 + int(self.named)}"

    def _line(self, number: int) -> int:
        """Find the line in which record `number` of the file ends: not every line is a record."""
        at: list[int] = [number + 1]
        next(islice(self._records(at), number, None), None)
        return at[0]

    # Names, kinds and numbers

    def plain(self, row: Sequence[Any]) -> list[str]:
        with_comma = [self._decimal == "," and _WITH_COMMA.fullmatch(cell.strip()) and "," in cell for cell in row]
        return [str(self._number(cell)) if is_so else cell.strip() for cell, is_so in zip(row, with_comma, strict=True)]

    def _is_header(self, first: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
        """Whether the first row has names: texts; or numbers in steps, as years, unlike all numbers below them."""
        kinds = [self._kind(text) for text in first]
        below = [self._kind(text) for text in rows[0]] if rows else []
        if "number" not in kinds:
            return "text" in kinds
        if any(above == "text" and kind != "text" for above, kind in zip(kinds, below, strict=False)):
            return True
        given = [text.strip() for text, kind in zip(first, kinds, strict=True) if kind == "number"]
        if len(rows) < 3 or "text" in kinds or not all(re.fullmatch(r"\d+", text) for text in given):
            return False
        steps = set(np.diff([int(text) for text in given]).tolist())
        return len(steps) <= 1 and min(steps, default=1) > 0 and all(
            self._differs(text, [row[column] for row in rows if column < len(row)])
            for column, text in enumerate(first)
            if kinds[column] == "number"
        )  # fmt: skip

    def _differs(self, name: str, texts: Sequence[str]) -> bool:
        """Whether a whole number is unlike all numbers below it: these are not whole, or smaller or larger by ten."""
        values = [abs(value) for text in texts if not math.isnan(value := self._number(text, nan_for_text=True))]
        if not values or all(re.search(r"[.,]\d*[1-9]|[eE]", text) for text in texts if self._kind(text) == "number"):
            return bool(values)
        return 10 * max(values) < int(name) or min(values) > 10 * int(name)

    def _kind(self, text: str) -> str:
        if (plain := text.strip().casefold().replace("\u2212", "-")) in self._no_value:
            return "missing"
        with suppress(ValueError):
            return "missing" if math.isnan(float(plain)) else "number"
        if _GROUPED.fullmatch(plain) or (re.search(r"\d", plain) and _WITH_COMMA.fullmatch(plain)):
            return "number"
        return "date" if _DATE.fullmatch(plain) or _is_iso(plain) else "truth" if plain in _TRUTHS else "text"

    @cached_property
    def _decimal(self) -> str:
        """The decimal sign: a comma, if a value in the first rows can be read with a comma alone."""
        if self._dialect.decimal is not None:
            return self._dialect.decimal
        texts = [text.strip() for row in islice(self._records(), _LOOKED_AT) for text in row if "," in text]
        commas = [text for text in texts if re.search(r"\d", text) and _WITH_COMMA.fullmatch(text)]
        grouped = [text for text in commas if _GROUPED.fullmatch(text)]
        return "," if len(commas) > len(grouped) or (grouped and self._delimiter == ";") else "."

    def _number(self, text: str, *, nan_for_text: bool = False) -> float:
        plain = text.strip().replace("\u2212", "-")  # a minus of typesetters
        if plain.casefold() in self._no_value:
            return math.nan
        with suppress(ValueError):
            if not (self._decimal == "," and _WITH_COMMA.fullmatch(plain) and "." in plain):
                return float(plain.replace("_", "x"))  # Python reads 1_000
        fits, others = (_WITH_COMMA, ".") if self._decimal == "," else (_GROUPED, ",")
        if fits.fullmatch(plain) and re.search(r"\d", plain):
            return float(re.sub(rf"[{others} \u00a0\u202f'\u2019]", "", plain).replace(",", "."))
        if nan_for_text:
            return math.nan
        raise ValueError(text)

    @cached_property
    def reasons(self) -> dict[str, str]:  # type: ignore[override]
        """Why columns are left out: they hold no numbers, or number the rows."""
        kinds = [Counter[str]() for _ in self.names]
        rising: dict[int, tuple[int, int]] = {}  # the first and the last number of columns of whole numbers that rise
        n_rows = 0
        for n_rows, row in enumerate(self._rows(), 1):
            if len(row) != self._n_fields:
                continue  # told when it is read
            if n_rows <= _LOOKED_AT:
                for counts, text in zip(kinds, row, strict=True):
                    counts[self._kind(text)] += 1
            elif not rising:
                break
            for column in range(len(row)) if n_rows == 1 else list(rising):
                first, last = rising.pop(column, (None, -1))
                text = row[column].strip()
                if text.isdecimal() and int(text) > last:
                    rising[column] = (int(text) if first is None else first, int(text))
        reasons = {}
        said = {"text": "text", "date": "dates", "truth": "truths"}
        for name, counts in zip(self.names, kinds, strict=True):
            others = counts.total() - counts["number"] - counts["missing"]
            if others > counts["number"]:
                reasons[name] = said[max(said, key=lambda kind: counts[kind])]
            elif not counts["number"] and counts["missing"]:
                reasons[name] = "empty"
        numbering = {}
        for column, (first, last) in sorted(rising.items()):
            name = self.names[column]
            is_index = self.named and self._unnamed[column]  # as pandas writes it
            if first in (0, 1) and last == first + n_rows - 1 and n_rows >= (2 if is_index else _COUNTED):
                numbering[name] = "it counts the rows"
            elif n_rows < _COUNTED:
                continue
            elif column == 0 or re.search(r"(^|[_\W])(id|nr|no|key|index)$", name, re.IGNORECASE):
                numbering[name] = "identifiers: whole numbers in order"
        if len(reasons) + len(numbering) < len(self.names):
            reasons |= numbering
        return reasons

    def values(self, columns: Sequence[int]) -> NDArray[np.float64]:
        parts, rows, n_read = [np.empty((0, len(columns)))], self._rows(), 0
        while chunk := list(islice(rows, 1024)):  # more at once take longer: Python collects garbage among more lists
            parts.append(self._numbers(chunk, columns, n_read))
            n_read += len(chunk)
        return np.concatenate(parts)

    def _numbers(self, rows: list[list[str]], columns: Sequence[int], n_before: int) -> NDArray[np.float64]:
        if not self._dialect.missing_values and self._decimal == ".":
            with suppress(ValueError):
                by_column = list(zip(*rows, strict=True))
                if len(by_column) == self._n_fields:
                    return np.stack([np.fromiter(map(float, by_column[c]), float, len(rows)) for c in columns], axis=1)
        return np.array([self._row(row, columns, n_before + number) for number, row in enumerate(rows)])

    def _row(self, row: Sequence[str], columns: Sequence[int], number: int) -> list[float]:
        if len(row) != self._n_fields:
            raise ValueError(
                f"{self.path}: {self.place(number)} has {len(row)} values, and the first line {self._n_fields}"
            )
        values = []
        for column in columns:
            try:
                values.append(self._number(row[column]))
            except ValueError:
                text = row[column] if len(row[column]) < 40 else f"{row[column][:36]}..."
                place = f"{self.path}: {self.place(number)}, column {self.names[column]!r}"
                raise ValueError(f"{place}: {text!r} is not a number") from None
        return values


def _is_iso(text: str) -> bool:
    with suppress(ValueError):
        return len(text) > 7 and datetime.fromisoformat(text) is not None
    return False


def _numbered(n_columns: int) -> list[str]:
    return [f"col{number}" for number in range(n_columns)]


def _distinct(names: Sequence[str]) -> list[str]:
    """Give names that occur again a number, as pandas does: a, a.1, a.2."""
    found: dict[str, None] = {}
    for name in names:
        free = (f"{name}.{number}" if number else name for number in range(len(names)))
        found[next(one for one in chain(free, [name]) if one not in found)] = None
    return list(found)
