"""Report a run: a table or JSON lines, a file with a row per input, and errors of one line each.

A row is added to the file as soon as it is known, and the rows are put in their order at the end.
"""

import csv
import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from time import monotonic
from typing import Any

from cvtimg._shared.progress import watched
from cvtimg.batch.tasks import Row, Task, WrongUsageError
from cvtimg.files.remote import exists, is_remote, local_copy, url_of
from cvtimg.files.whole import check_can_be_written, csv_text, write_whole

#: Suffixes of report files.
FILE_SUFFIXES = (".csv", ".jsonl")
#: Columns of all rows; the last one of them is the last column.
_COLUMNS = ("status", "input", "output", "error")
#: Left-aligned columns.
TEXT_COLUMNS = ("input", "output", "mode", "bands", "icc", "elbow")
#: Headings that differ from the names in JSON.
_HEADS = {"distinct_colors": "colors", "input_bytes": "before", "output_bytes": "after"}
#: Seconds after which a run shows how far it is.
_LONG = 2.0


class Report:
    """Collects the result of each input, prints it, and counts."""

    # Prints one JSON object per line to stdout as inputs complete, or a table of the columns at the end. A note, errors
    # and the summary of several inputs go to stderr; if quiet, only errors.

    def __init__(self, columns: Sequence[str], *, as_json: bool, quiet: bool = False, note: str = "") -> None:
        if as_json and quiet:
            raise WrongUsageError("--json and --quiet exclude each other")
        self.as_json, self.quiet = as_json, quiet
        self._columns, self._note = columns, note
        self.writes_files, self._is_heard = False, True  # whether the run does, and someone reads what it prints
        self.rows: list[Row] = []
        self._counts = {"done": 0, "skipped": 0, "failed": 0}

    def done(self, row: Row) -> None:
        """Record a completed input."""
        self._hear("done", row)
        if not (self.as_json or self.quiet):
            if "warning" in row:
                complain(f"{row.get('input', row.get('output'))}: {row['warning']}")
            self.show(row)

    def show(self, row: Row) -> None:
        """Print a completed input at once where there is no table at the end: its text."""
        if "_text" in row:
            self.say(row["_text"])

    def would_do(self, task: Task) -> None:
        """Print the inputs of a task and its outputs, one a line."""
        if self.as_json:
            outputs = {option: task.shown_name(path) for option, path in task.outputs.items()}
            self.say(json.dumps({**task.facts, "outputs": outputs}))
            return
        others = f" and {len(task.sources) - 1} more" if len(task.sources) > 1 else ""
        start = f"{task.name}{others} -> " if task.sources else "-> "
        self.say(*(start + task.shown_name(path) for path in task.outputs.values()))

    def skipped(self, row: Row) -> None:
        """Record a skipped input."""
        self._hear("skipped", {**row, "skipped": row.get("skipped", True)})

    def failed(self, path: str | Path, why: str) -> None:
        """Record a failed input, and print the reason."""
        complain(f"{path}: {why}" if path else why)
        self._hear("failed", {"input": str(path), "error": why})

    def _hear(self, status: str, row: Row) -> None:
        row = {name: value for name, value in row.items() if not name.startswith("_")}
        self._counts[status] += 1
        self.rows.append({"status": status, **row})
        if self.as_json:
            self.say(json.dumps(row, allow_nan=False))

    def say(self, *lines: str) -> None:
        """Print lines to stdout; if nobody reads them any more, end the run unless it has files to write."""
        if lines and self._is_heard:
            try:
                print(*lines, sep="\n", flush=True)
            except BrokenPipeError:
                if not self.writes_files:
                    raise
                self._is_heard = False
                with open(os.devnull, "w") as nowhere:  # noqa: PTH123
                    os.dup2(nowhere.fileno(), sys.stdout.fileno())  # what is left in its buffer has a place to go

    def finish(self) -> None:
        """Write what is of all completed inputs together, however the run ends."""

    def close(self) -> int:
        """Print the table and the summary; return the exit status, 1 if an input failed."""
        self.finish()
        if not (self.as_json or self.quiet):
            if self._counts["done"] and self._columns:
                self._print_table([row for row in self.rows if row["status"] == "done"])
                if self._note and any(row.get("goal") == "eyes" for row in self.rows):
                    print(self._note, file=sys.stderr, flush=True)
            if len(self.rows) > 1 or self._counts["skipped"]:
                print(self._summary(), file=sys.stderr, flush=True)
        return 1 if self._counts["failed"] else 0

    def interrupted(self, n_inputs: int) -> None:
        """Print what was completed before the run was interrupted."""
        self.finish()
        complain(f"interrupted: {self._summary()}, {n_inputs - len(self.rows)} of {n_inputs} inputs left")

    def _summary(self) -> str:
        return ", ".join(f"{n} {status}" for status, n in self._counts.items())

    def _print_table(self, rows: Sequence[Row]) -> None:
        from rich.cells import cell_len

        # On a terminal without the folders of inputs; in a pipe whole.
        if sys.stdout.isatty():
            rows = [{**row, "input": Path(row["input"]).name} for row in rows]
        lines = [[_HEADS.get(column, column) for column in self._columns]]
        lines += [[_cell(column, row.get(column)) for column in self._columns] for row in rows]
        widths = [max(map(cell_len, texts)) for texts in zip(*lines, strict=True)]
        table = []
        for line in lines:
            shown = []
            for column, text, width in zip(self._columns, line, widths, strict=True):
                space = " " * (width - cell_len(text))
                shown.append(text + space if column in TEXT_COLUMNS else space + text)
            table.append("  ".join(shown).rstrip())
        self.say(*table)


def _cell(column: str, value: Any) -> str:
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
    return text.encode(errors="replace").decode()  # file names need not be valid text


def _size(n_bytes: int) -> str:
    value, units = float(n_bytes), ["B", "kB", "MB", "GB", "TB"]
    while value >= 999.5 and len(units) > 1:
        value, units = value / 1000, units[1:]
    return f"{value:.3g}{units[0]}"


def reason(path: str | Path, error: Exception) -> str:
    """Return an error message in one line, without the path, and without the type if the message is meant for users."""
    from cvtimg._shared.messages import one_line

    text = one_line(error).removeprefix(f"{path}: ").removeprefix(f"{url_of(path)}: ")
    name = type(error).__name__
    meant = isinstance(error, (OSError, ValueError, ImportError, MemoryError)) or text in ("", name)
    return text if meant else f"{name}: {text}"


def complain(text: str) -> None:
    """Print an error to stderr in one line, which names the option where the message names it beside an argument."""
    line = re.sub(r"\S+ \((--[^()]+)\)", r"\1", " ".join(text.splitlines()))
    print(f"cvtimg: {line}", file=sys.stderr, flush=True)


@contextmanager
def progress(n_tasks: int, report: Report) -> Iterator[Callable[[], None]]:
    """Show a progress bar on stderr once a run takes long, if that is a terminal that does not also show JSON."""
    # Yields a function to call for each completed input; a single one is told in parts.
    if report.quiet or not sys.stderr.isatty() or (report.as_json and sys.stdout.isatty()):
        yield lambda: None
        return
    started, n_done, bar = monotonic(), 0, None
    with ExitStack() as stack:

        def told(completed: float) -> None:
            nonlocal bar
            if bar is None and monotonic() - started > _LONG:
                from rich.console import Console
                from rich.progress import Progress

                columns: Any = [*Progress.get_default_columns()[1:]]
                columns += ["{task.completed}/{task.total}"] if n_tasks > 1 else []
                # Rich would redirect printed text to its own console, but JSON must go to stdout.
                shown = Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=False)
                bar = stack.enter_context(shown)
                bar.add_task("cvtimg", total=n_tasks)
            if bar is not None:
                bar.update(bar.task_ids[0], completed=completed)

        def step() -> None:
            nonlocal n_done
            n_done += 1
            told(n_done)

        with watched(told) if n_tasks == 1 else nullcontext():
            yield step


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
        row = self._as_written(row)
        if self._before.get(row.get("input")) is row:
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
        tried = [*map(self._as_written, rows)]
        again = {row.get("input") for row in tried}
        self._rows = [*(row for name, row in self._before.items() if name not in again), *tried]
        self._write()

    def _as_written(self, row: Row) -> Row:
        row = row if self._is_json else _flat(row)
        return self._before.get(row.get("input"), row) if row["status"] == "skipped" else row

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
