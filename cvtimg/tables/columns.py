"""Files with columns: text with a delimiter, and NumPy arrays in ``.npy`` files.

Both know the names of their columns, read columns as numbers, and say where a row is.
"""

from __future__ import annotations

import csv
import math
import re
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any, TextIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.messages import one_line

_NO_VALUE = frozenset({"", "na", "n/a", "#n/a", "<na>", "nan", "null", "none"})
_DELIMITERS = "\t;,"
#: More rows at once take longer, because Python then collects garbage among more lists.
_ROWS_AT_ONCE = 1024


def open_columns(path: Path) -> Columns:
    """Open a ``.npy`` file as an array, and any other file as text; its content must fit its suffix."""
    return _Array(path) if path.suffix.lower() == ".npy" else _Text(path)


class _Array:
    """A ``.npy`` file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with path.open("rb") as file:
            try:
                # Not np.load, which would also read archives.
                self._array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
            except (ValueError, EOFError) as error:
                raise ValueError(f"{path}: is not a complete .npy file of numbers ({one_line(error)})") from error
        if self._array.ndim not in ((1,) if self._array.dtype.names else (1, 2)):
            raise ValueError(f"{path}: array of shape {self._array.shape} must be (N,) or (N, D), (N,) if structured")
        self.named = self._array.dtype.names is not None
        n_columns = 1 if self._array.ndim == 1 else self._array.shape[1]
        self.names = list(self._array.dtype.names or _numbered(n_columns))

    def values(self, columns: Sequence[int]) -> NDArray[np.float64]:
        picked = [self._column(number) for number in columns]
        for number, column in zip(columns, picked, strict=True):
            if column.dtype.kind not in "biuf" or column.ndim != 1:
                name, kind = self.names[number], self._array.dtype[number] if self.named else column.dtype
                raise ValueError(f"{self.path}: column {name!r} of type {kind} is not of numbers")
        return np.stack(picked, axis=1).astype(np.float64)

    def cells(self) -> Iterator[Sequence[Any]]:
        return iter(self._array.reshape(len(self._array), -1).tolist() if not self.named else self._array.tolist())

    def place(self, row: int) -> str:
        return f"row {row} (from 0)"

    def _column(self, number: int) -> NDArray[Any]:
        if self.named:
            return self._array[self.names[number]]
        return self._array if self._array.ndim == 1 else self._array[:, number]


class _Text:
    """A text file with a delimiter."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._delimiter, first, second = self._sniff()
        self.named = _is_header(first, second)
        self._n_fields = len(first)
        self.names = _numbered(len(first))
        if self.named:
            first[0] = first[0].removeprefix("#")  # so writes np.savetxt
            self.names = [name.strip() or number for name, number in zip(first, self.names, strict=True)]

    def values(self, columns: Sequence[int]) -> NDArray[np.float64]:
        parts, rows, n_read = [np.empty((0, len(columns)))], self.cells(), int(self.named)
        while chunk := list(islice(rows, _ROWS_AT_ONCE)):
            parts.append(self._numbers(chunk, columns, n_read))
            n_read += len(chunk)
        return np.concatenate(parts)

    def cells(self) -> Iterator[Sequence[Any]]:
        with self._rows(self._delimiter) as (rows, _):
            yield from islice(rows, int(self.named), None)

    def place(self, row: int) -> str:
        return f"line {self._line(row + 1 if self.named else row)}"

    def _line(self, number: int) -> int:
        """Find the line in which row `number` of the file ends: not every line is a row."""
        with self._rows(self._delimiter) as (rows, reader):
            next(islice(rows, number, None))
            return int(reader.line_num)

    def _numbers(self, rows: list[Sequence[str]], columns: Sequence[int], n_before: int) -> NDArray[np.float64]:
        try:
            by_column = list(zip(*rows, strict=True))
            if len(by_column) == self._n_fields:
                return np.stack([np.fromiter(map(float, by_column[c]), float, len(rows)) for c in columns], axis=1)
        except ValueError:
            pass  # read the rows one by one
        return np.array([self._row(row, columns, n_before + number) for number, row in enumerate(rows)])

    def _row(self, row: Sequence[str], columns: Sequence[int], number: int) -> list[float]:
        if len(row) != self._n_fields:
            raise ValueError(
                f"{self.path}: line {self._line(number)} has {len(row)} values, and the first line {self._n_fields}"
            )
        values = []
        for column in columns:
            try:
                values.append(_number(row[column]))
            except ValueError:
                place = f"{self.path}: line {self._line(number)}, column {self.names[column]!r}"
                text = row[column] if len(row[column]) < 40 else f"{row[column][:36]}..."
                raise ValueError(f"{place}: {text!r} is not a number{self._advice(row, column, number)}") from None
        return values

    def _advice(self, row: Sequence[str], column: int, number: int) -> str:
        if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", row[column]):
            return " (write a point, not a comma, in it)"
        numbers = [name for name, text in zip(self.names, row, strict=True) if _kind(text) == "number"]
        if number > (1 if self.named else 0) or not numbers:
            return ""  # one odd value in a column of numbers
        text = StringIO()
        csv.writer(text, lineterminator="").writerow(numbers)
        return f"; choose columns of numbers (--columns {shlex.quote(text.getvalue())})"

    def _sniff(self) -> tuple[str, list[str], list[str] | None]:
        """Guess the delimiter, and return it with the first two rows."""
        # It gives two rows the same number of values. A comma comes last, as it may be a decimal separator.
        found = []
        for delimiter in _DELIMITERS:
            with self._rows(delimiter) as (rows, _):
                first, second = next(rows, None), next(rows, None)
            if first is None:
                raise ValueError(f"{self.path}: is empty")
            if len(first) > 1 and (second is None or len(first) == len(second)):
                return delimiter, first, second
            found.append((len(first), delimiter, first, second))
        return max(found, key=lambda entry: (entry[0], entry[1] == ","))[1:]

    @contextmanager
    def _rows(self, delimiter: str) -> Iterator[tuple[Iterator[list[str]], Any]]:
        """Open the file; yield its rows, without empty lines, and the reader, which counts lines."""
        with self._opened() as file:
            reader = csv.reader(file, delimiter=delimiter, skipinitialspace=True)
            yield filter(None, reader), reader

    @contextmanager
    def _opened(self) -> Iterator[TextIO]:
        try:
            with self.path.open(encoding="utf-8-sig", newline="") as file:
                yield file
        except UnicodeDecodeError as error:
            raise ValueError(f"{self.path}: is not text in UTF-8; for images there is cvtimg segment") from error
        except csv.Error as error:
            raise ValueError(f"{self.path}: is not a table ({one_line(error)})") from error


#: A file with columns: its `path`, their `names`, and whether the file gives these, `named`. `values` reads (M, C)
#: numbers, NaN where one is missing, `cells` goes through all rows as they stand, and `place` says where a row is.
Columns: TypeAlias = _Array | _Text


def _numbered(n_columns: int) -> list[str]:
    return [f"col{number}" for number in range(n_columns)]


def _number(text: str) -> float:
    return math.nan if text.strip().casefold() in _NO_VALUE else float(text)


def _kind(text: str) -> str:
    try:
        return "missing" if math.isnan(_number(text)) else "number"
    except ValueError:
        return "text"


def _is_header(first: list[str], second: list[str] | None) -> bool:
    kinds = [_kind(text) for text in first]
    below = [_kind(text) for text in second or ()]
    if "number" not in kinds:
        return "text" in kinds
    return any(above == "text" and kind != "text" for above, kind in zip(kinds, below, strict=False))
