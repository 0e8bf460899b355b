"""What people and programs read of a run: a table or JSON lines, a file with a row an input, errors in one line."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cvtimg.batch.tasks import Row, WrongUsageError

__all__ = ["FILE_SUFFIXES", "Report", "complain", "reason"]

#: Columns that are set flush left.
TEXT_COLUMNS = ("input", "output", "mode", "bands", "icc", "elbow")
#: Heads of columns that read otherwise than in JSON.
_HEADS = {"distinct_colors": "colors", "input_bytes": "before", "output_bytes": "after"}
#: What a file of rows can end in.
FILE_SUFFIXES = (".csv", ".jsonl")


class Report:
    """Hears of each input, prints what is asked for, and keeps count.

    On stdout goes a JSON object a line as inputs are done, or a table at the end; errors and the summary of many
    inputs go to stderr.

    Parameters
    ----------
    columns : sequence of str
        What the table shows of each row.
    as_json : bool
        Print JSON.
    quiet : bool
        Print nothing but errors.
    """

    def __init__(self, columns: Sequence[str], *, as_json: bool, quiet: bool = False) -> None:
        if as_json and quiet:
            raise WrongUsageError("--json and --quiet exclude each other")
        self.as_json, self.quiet = as_json, quiet
        self._columns = columns
        self._rows: list[Row] = []
        self._counts = {"done": 0, "skipped": 0, "failed": 0}

    def done(self, row: Row) -> None:
        """Tell of an input that is done."""
        self._hear("done", row)
        if "warning" in row and not (self.as_json or self.quiet):
            complain(f"{row['input']}: {row['warning']}")
        if not (self.as_json or self.quiet):
            self.show(row)

    def show(self, row: Row) -> None:
        """Tell people of an input at once, in place of a table at the end, if a kind of report does so."""

    def skipped(self, row: Row) -> None:
        """Tell of an input that was left out."""
        self._hear("skipped", {**row, "skipped": row.get("skipped", True)})

    def failed(self, path: str | Path, why: str) -> None:
        """Name an input that failed, and why."""
        complain(f"{path}: {why}")
        self._hear("failed", {"input": str(path), "error": why})

    def _hear(self, status: str, row: Row) -> None:
        self._counts[status] += 1
        self._rows.append({"status": status, **row})
        if self.as_json:
            print(json.dumps(row, allow_nan=False), flush=True)

    def close(self) -> int:
        """Print the table and the summary; return the exit status, 1 if an input failed."""
        if not (self.as_json or self.quiet):
            if self._counts["done"] and self._columns:
                self._print_table([row for row in self._rows if row["status"] == "done"])
            if len(self._rows) > 1 or self._counts["skipped"]:
                print(self._summary(), file=sys.stderr, flush=True)
        return 1 if self._counts["failed"] else 0

    def interrupted(self, n_inputs: int) -> None:
        """Say what was done before the run was interrupted."""
        complain(f"interrupted: {self._summary()}, {n_inputs - len(self._rows)} of {n_inputs} inputs left")

    def _summary(self) -> str:
        return ", ".join(f"{n} {status}" for status, n in self._counts.items())

    def write(self, path: Path, *, overwrite: bool, append: bool = False) -> None:
        """Write a row for each input so far, whatever became of it, as .csv or .jsonl.

        With `append` the rows of the file that is there come first, but those of inputs that were tried again; an
        input that was skipped because it was done keeps its old row.
        """
        from cvtimg.files.whole import whole_file

        is_json = path.suffix.lower() == ".jsonl"
        rows = [_flat(row) for row in self._rows] if not is_json else self._rows
        if append and path.exists():
            rows = _merged(_read_lines(path) if is_json else _read_csv(path), rows)
        text = _lines(rows) if is_json else _csv(rows)
        with whole_file(path, overwrite=overwrite) as file:
            file.write(text.encode(errors="surrogateescape"))  # names of files need not be text

    def _print_table(self, rows: Sequence[Row]) -> None:
        from rich.console import Console
        from rich.table import Table

        # A pipe is as wide as need be. Markup is off, for names of files may have brackets in them.
        narrow = sys.stdout.isatty()
        console = Console(markup=False, highlight=False, emoji=False, width=None if narrow else 10_000)
        table = Table(box=None, pad_edge=False)
        for column in self._columns:
            is_text = column in TEXT_COLUMNS
            table.add_column(
                _HEADS.get(column, column), justify="left" if is_text else "right", overflow="fold", no_wrap=not is_text
            )
        for row in rows:
            shown = {**row, "input": Path(row["input"]).name} if narrow else row
            table.add_row(*(_cell(column, shown.get(column)) for column in self._columns))
        console.print(table)


def _merged(before: Sequence[Row], rows: Sequence[Row]) -> list[Row]:
    known = {row.get("input"): row for row in before}
    for row in rows:
        if row["status"] != "skipped" or row.get("input") not in known:
            known[row.get("input")] = row
    return list(known.values())


def _read_lines(path: Path) -> list[Row]:
    with path.open(errors="surrogateescape") as file:
        return [json.loads(line) for line in file]


def _read_csv(path: Path) -> list[Row]:
    import csv

    with path.open(newline="", errors="surrogateescape") as file:
        return list(csv.DictReader(file))


def _lines(rows: Sequence[Row]) -> str:
    return "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows)


def _csv(rows: Sequence[Row]) -> str:
    """Lay flat rows of unequal columns side by side."""
    from cvtimg.files.text_tables import csv_text

    columns = dict.fromkeys(["status", "input", "output", *(column for row in rows for column in row), "error"])
    columns["error"] = columns.pop("error")
    return csv_text(columns, [[row.get(column) for column in columns] for row in rows])


def _flat(row: Row) -> Row:
    """Make a column of each of several values."""
    flat: Row = {}
    for column, value in row.items():
        if isinstance(value, dict):
            flat.update({f"{column}_{name}": part for name, part in value.items()})
        else:
            flat[column] = " ".join(map(str, value)) if isinstance(value, (list, tuple)) else value
    return flat


def _cell(column: str, value: Any) -> str:
    """Word a value of a row for people."""
    if column == "psnr":
        return "exact" if value is None else f"{value:.2f}"
    if column.endswith("_bytes"):
        return "-" if value is None else _size(value)
    if column == "seconds":
        return f"{sum(value.values()):.2f}"
    if column == "explained":
        return f"{value:.2%}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ",".join(value) if len(value) <= 4 else f"{value[0]}..{value[-1]}"
    if isinstance(value, dict):
        return ", ".join(f"{name} {part}" for name, part in value.items())
    text = "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
    return text.encode(errors="replace").decode()  # names of files need not be text


def _size(n_bytes: int) -> str:
    """Round a size to three digits, in units of 1024 bytes."""
    value, units = float(n_bytes), "BKMGT"
    while value >= 1000 and len(units) > 1:
        value, units = value / 1024, units[1:]
    return f"{value:.3g}{units[0]}" if units[0] != "B" else f"{n_bytes}B"


def reason(path: str | Path, error: Exception) -> str:
    """Say why in one line, without the path; what is worded for users goes without the name of its type."""
    from cvtimg._shared.messages import one_line

    if isinstance(error, MemoryError):
        return "needs more memory than there is"
    text = one_line(error).removeprefix(f"{path}: ")
    name = type(error).__name__
    return text if isinstance(error, (OSError, ValueError)) or text in ("", name) else f"{name}: {text}"


def complain(text: str) -> None:
    """Print an error, in one line, on stderr."""
    print(f"cvtimg: {' '.join(text.splitlines())}", file=sys.stderr, flush=True)
