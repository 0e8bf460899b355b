"""Many inputs: which they are, where their outputs go, and a run in which one that fails stops no other.

Nothing here knows what is done to an input: a command hands over the work, and the columns of its table.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

__all__ = [
    "Missing",
    "Report",
    "Row",
    "Task",
    "WrongUsageError",
    "check_can_be_written",
    "check_choice",
    "check_outputs",
    "complain",
    "find",
    "reason",
    "run",
]

Row = dict[str, Any]
Missing = list[tuple[str, OSError]]

#: Columns that are set flush left.
TEXT_COLUMNS = ("input", "output", "mode", "bands", "icc", "elbow")


class WrongUsageError(Exception):
    """What was asked for makes no sense, whatever is in the inputs."""


@dataclass(frozen=True, slots=True)
class Task:
    """One input, and the files that shall come of it, by kind."""

    source: Path
    outputs: Mapping[str, Path] = field(default_factory=dict)


def find(
    inputs: Iterable[str], expand: Callable[[str], list[Path]], out_dir: Path | None = None
) -> tuple[list[Path], Missing]:
    """List the files that the arguments name, each once, and the arguments that name none.

    What lies in an output folder inside an input folder came from an earlier run, and is no input.
    """
    sources: dict[Path, None] = {}
    missing: Missing = []
    outside = out_dir.resolve() if out_dir else None
    for text in inputs:
        try:
            found = expand(text)
        except OSError as error:
            missing.append((text, error))
            continue
        if outside and Path(text).resolve() in outside.parents:
            found = [path for path in found if outside not in path.resolve().parents]
        sources.update(dict.fromkeys(found))
    return list(sources), missing


def check_choice(option: str, value: str, allowed: Iterable[str]) -> None:
    """Refuse what is not one of the names allowed."""
    if value not in (names := list(allowed)):
        raise WrongUsageError(f"{option}: {value!r} must be one of {', '.join(names)}")


def check_outputs(n_inputs: int, out_dir: Path | None, files: Mapping[str, Path | None]) -> None:
    """Refuse combinations that cannot be; `files` are the options that name one file, the main one under ``-o``."""
    if files["-o"] and out_dir:
        raise WrongUsageError("-o and --out-dir exclude each other")
    given = [option for option, file in files.items() if file]
    if n_inputs > 1 and given:
        raise WrongUsageError(f"{given[0]} is for one input, and these are {n_inputs}")
    if n_inputs > 1 and not out_dir:
        raise WrongUsageError(f"{n_inputs} inputs need --out-dir DIR")


def run(
    tasks: Sequence[Task],
    missing: Missing,
    work: Callable[[Task], Row],
    report: Report,
    *,
    out_dir: Path | None = None,
    overwrite: bool = False,
) -> int:
    """Do all that can be done and name what fails.

    Parameters
    ----------
    tasks : sequence of Task
        Inputs with their outputs.
    missing : list of (str, OSError)
        Arguments that named no input.
    work : callable
        From a task to its row in the report; whatever it raises is the failure of this input alone.
    report : Report
        Hears of each input.
    out_dir : Path, optional
        Folder of outputs, made if it is missing.
    overwrite : bool
        Whether outputs may replace files.

    Returns
    -------
    int
        The exit status: 1 if an input failed, else 0.

    Raises
    ------
    WrongUsageError
        If an output would replace an input or another output; nothing is done then.
    """
    _check_no_clash(tasks)
    with _folder(out_dir) if out_dir else nullcontext():
        for text, error in missing:
            report.failed(text, error)
        with _progress(tasks, report) as steps:
            for task in steps:
                try:
                    for path in task.outputs.values():
                        check_can_be_written(path, overwrite)
                    row = work(task)
                except Exception as error:  # one bad input, whatever is wrong with it, must not stop the others
                    report.failed(task.source, error)
                else:
                    report.done(row)
        return report.close()


def _check_no_clash(tasks: Sequence[Task]) -> None:
    """Refuse outputs that would replace an input or each other, before any work."""
    inputs = {_identity(task.source) for task in tasks}
    owners: dict[str, Path] = {}
    for task in tasks:
        for path in task.outputs.values():
            if path.exists() and _identity(path) in inputs:
                raise WrongUsageError(f"{path} is an input, which is never replaced; choose another output")
            place = os.path.normcase(path.resolve())
            if place in owners:
                twice = owners[place] == task.source
                who = f"two outputs of {task.source}" if twice else f"{owners[place]} and {task.source}"
                raise WrongUsageError(f"{who} would both become {path}")
            owners[place] = task.source


def _identity(path: Path) -> tuple[int, int]:
    """Tell files apart whatever links and names lead to them."""
    status = path.stat()
    return status.st_dev, status.st_ino


def check_can_be_written(path: Path, overwrite: bool) -> None:
    """Fail now rather than after the work: begin to write, and do not go through with it."""
    from cvtimg.files import whole_file

    class EndOfTrialError(Exception):
        pass

    with suppress(EndOfTrialError), whole_file(path, overwrite=overwrite):
        raise EndOfTrialError


@contextmanager
def _folder(path: Path) -> Iterator[None]:
    """Make a folder for outputs, and take it away again if nothing came into it."""
    made = not path.exists()
    path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        if made:
            with suppress(OSError):  # not empty
                path.rmdir()


@contextmanager
def _progress(tasks: Sequence[Task], report: Report) -> Iterator[Iterable[Task]]:
    """Show a bar on stderr where a person watches it, and where it does not mix with JSON on the same terminal."""
    if len(tasks) < 2 or report.quiet or not sys.stderr.isatty() or (report.as_json and sys.stdout.isatty()):
        yield tasks
        return
    from rich.console import Console
    from rich.progress import Progress

    # Rich would send what is printed meanwhile to its own console, but JSON must go to stdout.
    with Progress(console=Console(stderr=True), transient=True, redirect_stdout=False) as bar:
        yield bar.track(tasks, description="cvtimg")


class Report:
    """What people and programs read: a JSON object a line as it comes, or a table at the end; errors on stderr.

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
        self._n_failed = 0

    def done(self, row: Row) -> None:
        """Tell of an input that is done."""
        if self.as_json:
            print(json.dumps(row, allow_nan=False), flush=True)
        elif not self.quiet:
            self._rows.append(row)

    def failed(self, path: str | Path, error: Exception) -> None:
        """Name an input that failed, and why."""
        self._n_failed += 1
        why = reason(path, error)
        complain(f"{path}: {why}")
        if self.as_json:
            print(json.dumps({"input": str(path), "error": why}), flush=True)

    def close(self) -> int:
        """Print the table; return the exit status, 1 if an input failed."""
        if self._rows:
            self._print_table()
        return 1 if self._n_failed else 0

    def _print_table(self) -> None:
        from rich.console import Console
        from rich.table import Table

        # A pipe is as wide as need be. Markup is off, for names of files may have brackets in them.
        narrow = sys.stdout.isatty()
        console = Console(markup=False, highlight=False, emoji=False, width=None if narrow else 10_000)
        table = Table(box=None, pad_edge=False)
        for column in self._columns:
            is_text = column in TEXT_COLUMNS
            head = column.removeprefix("distinct_")
            table.add_column(head, justify="left" if is_text else "right", overflow="fold", no_wrap=not is_text)
        for row in self._rows:
            shown = {**row, "input": Path(row["input"]).name} if narrow else row
            table.add_row(*(_cell(column, shown[column]) for column in self._columns))
        console.print(table)


def _cell(column: str, value: Any) -> str:
    """Word a value of a row for people."""
    if column == "psnr":
        return "exact" if value is None else f"{value:.2f}"
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


def reason(path: str | Path, error: Exception) -> str:
    """Say why in one line, without the path; what is worded for users goes without the name of its type."""
    from cvtimg.files import one_line

    if isinstance(error, MemoryError):
        return "needs more memory than there is"
    text = one_line(error).removeprefix(f"{path}: ")
    name = type(error).__name__
    return text if isinstance(error, (OSError, ValueError)) or text in ("", name) else f"{name}: {text}"


def complain(text: str) -> None:
    """Print an error, in one line, on stderr."""
    print(f"cvtimg: {' '.join(text.splitlines())}", file=sys.stderr, flush=True)
