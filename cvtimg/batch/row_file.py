"""The report file of a run: a row for each input, added as soon as it is known, and put in their order at the end."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from cvtimg.batch.tasks import Row
from cvtimg.files.remote import exists, is_remote, local_copy
from cvtimg.files.whole import check_can_be_written, csv_text, write_whole

#: Suffixes of report files.
FILE_SUFFIXES = (".csv", ".jsonl")
#: Columns of all rows; the last one of them is the last column.
_COLUMNS = ("status", "input", "output", "error")


class RowFile:
    """A table in a .csv or .jsonl file of whole lines, which can be read at any moment.

    A row with a column that the header of a .csv lacks has the file written anew, complete or not at all. With
    `append`, the rows of an existing file come first: inputs that are tried again get new rows, and skipped ones keep
    their rows. A file elsewhere, at a URL, is written at the end.
    """

    def __init__(self, path: Path, *, overwrite: bool, append: bool) -> None:
        check_can_be_written(path, overwrite=overwrite or append)
        self._path, self._is_json = path, path.suffix.lower() == ".jsonl"
        self._before = {row.get("input"): row for row in _read_rows(path)} if append and exists(path) else {}
        self._rows = list(self._before.values())
        self._columns = list(_COLUMNS)
        if not is_remote(path):
            self._write(overwrite=overwrite or append)

    def add(self, row: Row) -> None:
        """Add a row at once; a disk that is full is told at the end."""
        row = row if self._is_json else _flat(row)
        if row["status"] == "skipped" and row.get("input") in self._before:
            return
        self._rows.append(row)
        if is_remote(self._path):
            return
        with suppress(OSError):
            if self._is_json or row.keys() <= set(self._columns):
                with self._path.open("ab", buffering=0) as file:
                    file.write(self._lines([row]))
            else:
                self._write()

    def end(self, rows: Sequence[Row]) -> None:
        """Write all rows in their order, those of an earlier run first."""
        flat = rows if self._is_json else [_flat(row) for row in rows]
        again = {row.get("input") for row in flat}
        kept = [row for name, row in self._before.items() if name not in again]
        tried = [
            self._before[row["input"]] if row["status"] == "skipped" and row.get("input") in self._before else row
            for row in flat
        ]
        self._rows = [*kept, *tried]
        self._write()

    def _write(self, *, overwrite: bool = True) -> None:
        names = dict.fromkeys([*self._columns, *(name for row in self._rows for name in row)])
        self._columns = [*(name for name in names if name != _COLUMNS[-1]), _COLUMNS[-1]]
        write_whole(self._path, self._lines(self._rows, header=True), overwrite=overwrite)

    def _lines(self, rows: Sequence[Row], *, header: bool = False) -> bytes:
        if self._is_json:
            text = "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows)
        else:
            text = csv_text(self._columns, [[row.get(column) for column in self._columns] for row in rows])
            text = text if header else text.partition("\n")[2]
        return text.encode(errors="surrogateescape")  # file names need not be valid


def _read_rows(path: Path) -> list[Row]:
    with local_copy(path) as copy, copy.open(newline="", errors="surrogateescape") as file:
        if path.suffix.lower() != ".jsonl":
            return list(csv.DictReader(file))
        rows = []
        for line in file:
            with suppress(json.JSONDecodeError):  # the end of a disk, or of its power
                rows.append(json.loads(line))
        return rows


def _flat(row: Row) -> Row:
    """Give each part of a dict its own column, and join lists with spaces."""
    flat: Row = {}
    for column, value in row.items():
        if isinstance(value, dict):
            flat.update({f"{column}_{name}": part for name, part in value.items()})
        else:
            flat[column] = " ".join(map(str, value)) if isinstance(value, (list, tuple)) else value
    return flat
