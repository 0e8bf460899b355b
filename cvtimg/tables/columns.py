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
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO, StringIO
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.extras import optional
from cvtimg._shared.messages import one_line
from cvtimg._shared.types import Array, Floats

#: Marks of missing values, in small letters.
_NO_VALUE = frozenset(
    ["", "na", "n/a", "n.a.", "#n/a", "<na>", "nan", "nat", "null", "none", "nil", "missing", "?", "-", "--", "."]
)
_TRUTHS = frozenset(("true", "false", "yes", "no", "t", "f", "y", "n"))
#: Tried in this order; a comma comes after those beside which it is a decimal sign.
_DELIMITERS = "\t;|, "
#: Rows that tell delimiter, names, kinds and decimal sign: with more, later marks count, and it takes longer.
_LOOKED_AT = 1000
#: Rows at least of a column that numbers them in order: with more, such columns of short tables are values.
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
_DATE = re.compile(
    r"(?:\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{4}-?w\d\d(?:-?\d)?|\d{8}(?=t))(?:[t ].*)?|\d{1,2}:\d{2}(?::\d{2}.*)?"
)


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
    """A file with columns that have types; or that are texts, see `_Text`."""

    def __init__(self, path: Path, names: Sequence[str], columns: Sequence[Any], *, named: bool) -> None:
        self.path, self.names, self._columns = path, _distinct(names), columns
        self.named = named  # whether the file gives the names
        kinds = [column.dtype.kind if column.ndim == 1 else "V" for column in columns]
        said = {"b": "truths", "M": "dates", "m": "durations", "c": "complex numbers", "V": "arrays"}
        #: Why columns are not used unless they are asked for.
        self.reasons = {
            name: said.get(kind, "text")
            for name, kind in zip(self.names, kinds, strict=True)
            if named and kind not in "iuf"
        }

    def values(self, columns: Sequence[int]) -> Floats:
        """Read (M, C) numbers, NaN where one is missing."""
        for number in columns:
            column = self._columns[number]
            if column.dtype.kind not in "biuf" or column.ndim != 1:
                name, kind = self.names[number], column.dtype if column.ndim == 1 else f"{column.shape[1:]} of arrays"
                raise ValueError(f"{self.path}: column {name!r} of type {kind} is not of numbers")
        return np.stack([self._columns[number] for number in columns], axis=1).astype(np.float64)

    def cells(self) -> Iterator[Sequence[Any]]:
        """Go through all rows as they stand."""
        return zip(*(column.tolist() for column in self._columns), strict=True)

    def place(self, row: int) -> str:
        """Say where a row is."""
        return f"row {row} (from 0)"

    def plain(self, row: Sequence[Any]) -> list[str]:
        """Return a row as texts, numbers with a decimal point."""
        return [str(cell) for cell in row]


def _of_array(path: Path) -> Columns:
    with path.open("rb") as file:
        try:
            # Not np.load, which would also read archives.
            array: Array = np.lib.format.read_array(file, allow_pickle=False)
        except (ValueError, EOFError) as error:
            raise ValueError(f"{path}: is not a complete .npy file of numbers ({one_line(error)})") from error
    if array.ndim not in ((1,) if array.dtype.names else (1, 2)):
        raise ValueError(f"{path}: array of shape {array.shape} must be (N,) or (N, D), (N,) if structured")
    if array.dtype.names:
        return Columns(path, array.dtype.names, [array[name] for name in array.dtype.names], named=True)
    columns = list(array.T) if array.ndim == 2 else [array]
    return Columns(path, _numbered(len(columns)), columns, named=False)


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
    return Columns(path, table.column_names, columns, named=True)


class _Text(Columns):
    """Text with a delimiter, or a sheet: columns of texts, of which one record after the other is read."""

    def __init__(self, path: Path, dialect: Dialect) -> None:
        self.path, self._dialect = path, dialect
        self._no_value = _NO_VALUE | {mark.strip().casefold() for mark in dialect.missing_values}
        self._unit = "row" if path.suffix.lower() in _SHEETS else "line"
        records = self._sheet() if self._unit == "row" else self._records()
        first = list(islice(records, _LOOKED_AT))
        if not first:
            raise ValueError(f"{path}: is empty")
        self._n_fields = Counter(len(row) for _, row in first[1:] or first).most_common(1)[0][0]
        first = first[self._n_above([row for _, row in first]) :]
        texts = [text.strip() for _, row in first for text in row if "," in text]
        commas = [text for text in texts if re.search(r"\d", text) and _WITH_COMMA.fullmatch(text)]
        grouped = [text for text in commas if _GROUPED.fullmatch(text)]
        # A comma, if a value can be read with a comma alone.
        is_comma = len(commas) > len(grouped) or bool(grouped and self._delimiter == ";")
        self._decimal = dialect.decimal or (",." if is_comma else ".,")[0]
        rows = [row for _, row in first]
        self.named = self._is_header(rows[0], rows[1:]) if dialect.header is None else dialect.header
        head = self._head(rows, first[min(1, len(first) - 1)][0])
        below = chain(first[int(self.named) + (self.named and self._is_of_units(rows[1:])) :], records)
        numbered = zip(head, _numbered(len(head)), strict=True)
        self.names = _distinct([name.strip() or number for name, number in numbered])
        self._unnamed = [not name.strip() for name in head]
        self._lines, self._columns = self._by_column(below)

    # Text and its rows

    def _text(self) -> str:
        """Read, unpack and decode the file."""
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
        asked = self._dialect.encoding
        for encoding in [asked] if asked else [told or "utf-8", "cp1252"]:
            with suppress(UnicodeDecodeError):
                try:
                    text = content.decode(encoding)
                except LookupError as error:
                    raise ValueError(f"encoding={asked!r} must be the name of one, such as utf-8 or cp1252") from error
                if not re.search(r"[\x00-\x08\x0e-\x1f]", text[: 1 << 16]):
                    return text
        what = f"text in {asked}" if asked else "text"
        raise ValueError(f"{self.path}: is not {what}; for images there is cvtimg segment")

    def _records(self) -> Iterator[tuple[int, list[str]]]:
        """Split the text into rows, without empty lines, each with the number of the line in which it ends."""
        text = self._text()
        first = list(islice(StringIO(text, newline=""), _LOOKED_AT))
        said = re.fullmatch(r"\"?sep=(.)\"?\s*", first[0]) if first else None
        n_before = 1 if said else 0
        comments = [n for n, line in enumerate(first) if n >= n_before and _COMMENT.match(line)]
        while n_before < len(first) and (n_before in comments or not first[n_before].strip()):
            n_before += 1
        after = re.split(r"[\t;|, ]+", first[n_before].strip()) if n_before < len(first) else []
        # np.savetxt writes names above numbers as a comment; one of another number of values says something else.
        is_named = n_before - 1 in comments and any(self._kind(part.strip("\"'")) == "number" for part in after)
        self._delimiter = self._dialect.delimiter or (said[1] if said else _told_delimiter(first[n_before:]))

        def split(lines: Iterable[str]) -> Any:
            lines = (line.rstrip(" \r\n") + "\n" for line in lines) if self._delimiter == " " else lines
            return csv.reader(lines, delimiter=self._delimiter, skipinitialspace=True)

        try:
            if is_named:
                names = next(split([first[n_before - 1].lstrip("# ")]))
                if len(names) == len(next(split(first[n_before:]))):
                    yield n_before, names
            reader = split(islice(StringIO(text, newline=""), n_before, None))
            for row in reader:
                if row:  # none is an empty line
                    yield n_before + reader.line_num, row
        except csv.Error as error:
            raise ValueError(f"{self.path}: is not a table ({one_line(error)})") from error

    def _sheet(self) -> Iterator[tuple[int, list[str]]]:
        openpyxl = optional("openpyxl", "excel", f"{self.path}: needs")
        self._delimiter = ","
        try:
            book = openpyxl.load_workbook(self.path, read_only=True, data_only=True)
            rows = list(book.worksheets[0].values)
        except Exception as error:  # zipfile and openpyxl raise many kinds
            raise ValueError(f"{self.path}: is not a workbook of Excel ({one_line(error)})") from error
        texts = [["" if cell is None else str(cell) for cell in row] for row in rows]
        return ((number, row) for number, row in enumerate(texts, 1) if any(row))

    def _by_column(self, records: Iterable[tuple[int, list[str]]]) -> tuple[Sequence[int], list[Array]]:
        """Gather the rows below the names, without comments, empty ends of rows, and notes after the last one."""
        kind, n, ordinal = np.dtypes.StringDType(), self._n_fields, None
        parts: list[Array] = [np.empty((n, 0), kind)]
        lines, rows, notes = array("q"), list[list[str]](), list[tuple[int, list[str]]]()
        for line, row in records:
            row = row[:n] if not any(map(str.strip, row[n:])) else row
            ordinal = self._kind(row[0]) != "text" if ordinal is None else ordinal
            if n > 1 and (len(row) != n or ordinal) and self._is_note(row):
                notes.append((line, row))
                continue
            if len(row) != n and row[0].startswith("#"):
                continue
            for at, known in [*notes, (line, row)]:
                if len(known) != n:
                    raise ValueError(f"{self.path}: {self._unit} {at} has {len(known)} values, and the first line {n}")
                lines.append(at)
                rows.append(known)
            notes = []
            if len(rows) >= _LOOKED_AT:  # as texts of Python take ten times the memory
                parts.append(np.array(rows, kind).T)
                rows = []
        return lines, list(np.concatenate([*parts, *([np.array(rows, kind).T] if rows else [])], axis=1))

    def _is_note(self, row: Sequence[str]) -> bool:
        """Whether a row is a single text, as titles and sources are."""
        return self._kind(row[0]) == "text" and not any(map(str.strip, row[1:]))

    def place(self, row: int) -> str:
        return f"{self._unit} {self._lines[row]}"

    # Names, kinds and numbers

    def _n_above(self, rows: Sequence[Sequence[str]]) -> int:
        """Count the titles above a line of as many names as there are columns."""
        n = next((number for number, row in enumerate(rows) if not self._is_note(row)), 0)
        return n if len(rows[n]) == self._n_fields and "number" not in map(self._kind, rows[n]) else 0

    def _is_of_units(self, rows: Sequence[Sequence[str]]) -> bool:
        """Whether the first of some rows has a text, such as m or kg, above each column of numbers."""
        columns = zip(*(row for row in rows if len(row) == self._n_fields), strict=True)
        kinds = [[self._kind(text) for text in column] for column in columns]
        above = [first for first, *below in kinds if below and set(below) <= {"number", "missing"}]
        return "text" in above and set(above) <= {"text", "missing"} and self._kind(rows[0][0]) != "number"

    def _head(self, rows: Sequence[list[str]], line: int) -> list[str]:
        """Return a name for each column, "" where there is none."""
        n = self._n_fields
        head = rows[0] if self.named else [""] * n
        if len(head) == n - 1:
            # Without a name of the last, empty column; R gives none to the first, the names of rows.
            is_last = all(not row[-1].strip() for row in rows[1:] if len(row) == n)
            return [*head, ""] if is_last else ["", *head]
        if len(head) < n or any(name.strip() for name in head[n:]):
            n_values = len(rows[min(1, len(rows) - 1)])
            raise ValueError(f"{self.path}: line {line} has {n_values} values, and the first line {len(head)}")
        return head[:n]

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
        return "date" if _DATE.fullmatch(plain) else "truth" if plain in _TRUTHS else "text"

    def _number(self, text: str, *, nan_for_text: bool = False) -> float:
        plain = text.strip().replace("\u2212", "-")  # a minus of typesetters
        if plain.casefold() in self._no_value:
            return math.nan
        with suppress(ValueError):
            if not (self._decimal == "," and _WITH_COMMA.fullmatch(plain) and "." in plain):
                return float(plain)
        fits, others = (_WITH_COMMA, ".") if self._decimal == "," else (_GROUPED, ",")
        if fits.fullmatch(plain) and re.search(r"\d", plain):
            return float(re.sub(rf"[{others} \u00a0\u202f'\u2019]", "", plain).replace(",", "."))
        if nan_for_text:
            return math.nan
        raise ValueError(text)

    @cached_property
    def reasons(self) -> dict[str, str]:  # type: ignore[override]
        """Why columns are left out: they hold no numbers, or number the rows."""
        said = {"text": "text", "date": "dates", "truth": "truths"}
        reasons, numbering = {}, {}
        for column, (name, cells) in enumerate(zip(self.names, self._columns, strict=True)):
            counts = Counter(map(self._kind, cells[:_LOOKED_AT].tolist()))
            others = counts.total() - counts["number"] - counts["missing"]
            if others > counts["number"]:
                reasons[name] = said[max(said, key=lambda kind: counts[kind])]
            elif not counts["number"] and counts["missing"]:
                reasons[name] = "empty"
            elif why := self._numbering(column):
                numbering[name] = why
        return reasons | (numbering if len(reasons) + len(numbering) < len(self.names) else {})

    def _numbering(self, column: int) -> str | None:
        """Say how a column numbers the rows, if it does."""
        name, n_rows, numbers = self.names[column], len(self._lines), np.zeros(2, np.int64)
        with suppress(ValueError, OverflowError):
            numbers = self._columns[column].astype(np.int64)
        if not n_rows or numbers[0] < 0 or (np.diff(numbers) <= 0).any():
            return None
        is_index = self.named and self._unnamed[column]  # as pandas writes it
        if numbers[0] in (0, 1) and np.ptp(numbers) == n_rows - 1 and n_rows >= (2 if is_index else _COUNTED):
            return "it counts the rows"
        is_id = column == 0 or re.search(r"(^|[_\W])(id|nr|no|key|index)$", name, re.IGNORECASE)
        return "identifiers: whole numbers in order" if is_id and n_rows >= _COUNTED else None

    def values(self, columns: Sequence[int]) -> Floats:
        return np.stack([self._numbers(column) for column in columns], axis=1)

    def _numbers(self, column: int) -> Floats:
        cells, numbers = self._columns[column], list[float]()
        if self._decimal == "." and not self._dialect.missing_values:
            with suppress(ValueError):
                return cells.astype(np.float64)
        for row, text in enumerate(cells.tolist()):
            try:
                numbers.append(self._number(text))
            except ValueError:
                shown = text if len(text) < 40 else f"{text[:36]}..."
                place = f"{self.path}: {self.place(row)}, column {self.names[column]!r}"
                raise ValueError(f"{place}: {shown!r} is not a number") from None
        return np.array(numbers)


def _told_delimiter(lines: Sequence[str]) -> str:
    """Tell the delimiter: it gives all of the first rows the same number of values, two or more."""
    best, most = ",", 0.0
    for delimiter in _DELIMITERS:
        with suppress(csv.Error):
            stripped = (line.rstrip() + "\n" for line in lines) if delimiter == " " else lines
            rows = [row for row in csv.reader(stripped, delimiter=delimiter, skipinitialspace=True) if row]
            size, n = Counter(map(len, rows)).most_common(1)[0] if rows else (0, 0)
            if size > 1 and n / len(rows) > most:
                best, most = delimiter, n / len(rows)
                if delimiter == "," and size == 2 and [len(row) for row in rows[:2]] == [1, 2]:
                    best = ";" if all(re.fullmatch(r"[-+]?\d*", part) for part in rows[1]) else ","
    return best


def _numbered(n_columns: int) -> list[str]:
    return [f"col{number}" for number in range(n_columns)]


def _distinct(names: Sequence[str]) -> list[str]:
    """Give names that occur again a number, as pandas does: a, a.1, a.2."""
    names_so_far: dict[str, None] = {}
    for name in names:
        free = (f"{name}.{number}" if number else name for number in range(len(names)))
        names_so_far[next(candidate for candidate in chain(free, [name]) if candidate not in names_so_far)] = None
    return list(names_so_far)
