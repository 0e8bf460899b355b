"""Show the progress of a run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from cvtimg.batch.report import Report
from cvtimg.batch.tasks import Row

__all__ = ["Step", "progress"]

Step = Callable[[Row | None], None]


@contextmanager
def progress(n_tasks: int, report: Report) -> Iterator[Step]:
    """Show a progress bar on stderr, if that is a terminal that does not also show JSON.

    Yields a function to call with the row of each completed input, or None for one that failed.
    """
    if n_tasks < 2 or report.quiet or not sys.stderr.isatty() or (report.as_json and sys.stdout.isatty()):
        yield lambda row: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = BarColumn(), TaskProgressColumn(), MofNCompleteColumn(), TextColumn("{task.fields[speed]}")
    start, n_pixels = perf_counter(), 0
    # Rich would redirect printed text to its own console, but JSON must go to stdout.
    console = Console(stderr=True)
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True, redirect_stdout=False) as bar:
        shown = bar.add_task("cvtimg", total=n_tasks, speed="")

        def step(row: Row | None) -> None:
            nonlocal n_pixels
            n_pixels += row.get("width", 0) * row.get("height", 0) if row else 0
            speed = f"{n_pixels / 1e6 / (perf_counter() - start):.1f} MP/s" if n_pixels else ""
            bar.update(shown, advance=1, speed=speed)

        yield step
