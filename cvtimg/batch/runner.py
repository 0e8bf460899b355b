"""A run over many inputs, here or in worker processes, in which one that fails stops no other."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from cvtimg._shared.threads import n_threads, pairwise_sum
from cvtimg.batch.progress import Step, progress
from cvtimg.batch.report import FILE_SUFFIXES, Report, reason
from cvtimg.batch.tasks import Attempt, Missing, Outcome, Row, Task, Work, check_choice, check_no_clash

__all__ = ["Running", "check_can_be_written", "fold", "run"]

#: Bytes of inputs, about 13 photographs of 768 x 512, below which starting workers takes longer than it saves.
_WORTH_WORKERS = 8 << 20
#: What an input costs however small it is, in these bytes.
_LEAST_BYTES = 1 << 17


@dataclass(frozen=True, slots=True)
class Running:
    """How a batch is run.

    Attributes
    ----------
    jobs : int, optional
        Inputs at a time, each in a process of its own; with 1 all in this one. By default as many as threads,
        where there is work for them.
    skip_existing : bool
        Leave out inputs all of whose outputs exist: they are whole, for a file appears whole or not at all.
    file : Path, optional
        A .csv or .jsonl file that gets a row for each input.
    max_pixels : int, optional
        The most pixels that a picture may have, before it is taken for a trap; some 179 million by default.
    dask : str, optional
        Address of the scheduler of a Dask cluster that does the work, or "local" for one of `jobs` processes here.
    """

    jobs: int | None = None
    skip_existing: bool = False
    file: Path | None = None
    max_pixels: int | None = None
    dask: str | None = None


def run(
    tasks: Sequence[Task],
    missing: Missing,
    work: Work,
    report: Report,
    *,
    out_dir: Path | None = None,
    overwrite: bool = False,
    running: Running | None = None,
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
        Hears of each input, in the order of the tasks.
    out_dir : Path, optional
        Folder of outputs, made if it is missing.
    overwrite : bool
        Whether outputs may replace files.
    running : Running, optional
        How many at a time, and what is left out; by default all one after the other in this process.

    Returns
    -------
    int
        The exit status: 1 if an input failed, else 0.

    Raises
    ------
    WrongUsageError
        If an output would replace an input or another output; nothing is done then.
    """
    how = running or Running(jobs=1)
    if how.file:
        check_choice("--report", how.file.suffix.lower(), FILE_SUFFIXES)
    check_no_clash(tasks, how.file)
    todo = [task for task in tasks if not (how.skip_existing and _is_done(task))]
    with _folders(todo, out_dir), _rows_written(report, how, overwrite):
        for text, error in missing:
            report.failed(text, reason(text, error))
        attempt = partial(_attempt, work=work, overwrite=overwrite, how=how)
        with progress(len(todo), report) as step:
            outcomes = _in_order(_perform(attempt, todo, how), step)
            left = iter(todo)
            following = next(left, None)
            for task in tasks:
                if task is not following:
                    report.skipped(task)
                    continue
                outcome = next(outcomes)
                if outcome.result is None:
                    report.failed(task.source, outcome.why)
                else:
                    report.done(outcome.result)
                following = next(left, None)
    return report.close()


def fold(
    tasks: Sequence[Task],
    work: Callable[[Task], Any],
    add: Callable[[Any, Any], Any],
    running: Running | None = None,
) -> tuple[Any, dict[Path, str]]:
    """Add what `work` returns for each task, two by two as they are done.

    Parameters
    ----------
    tasks : sequence of Task
        Inputs; outputs play no part.
    work, add : callable
        From a task to anything that can be pickled, and from two of these to one, in whatever order; themselves
        picklable.
    running : Running, optional
        How many at a time, and where.

    Returns
    -------
    total, dict of Path to str
        The sum of the inputs that did not fail, None of none; and why others failed.
    """
    how = running or Running(jobs=1)
    attempt = partial(_call, work=work, max_pixels=how.max_pixels)
    if how.dask:
        from cvtimg.batch.on_dask import sum_on_dask

        total, why = sum_on_dask(attempt, tasks, add, how.dask, how.jobs or n_threads())
        return total, {tasks[place].source: text for place, text in why.items()}
    failed: dict[Path, str] = {}

    def results() -> Iterator[Any]:
        with closing(_perform(attempt, tasks, how)) as outcomes:
            for place, outcome in outcomes:
                if outcome.why:
                    failed[tasks[place].source] = outcome.why
                else:
                    yield outcome.result

    return pairwise_sum(results(), add), failed


def _call(task: Task, *, work: Callable[[Task], Any], max_pixels: int | None) -> Outcome:
    """Do one task and catch what fails: one bad input, whatever is wrong with it, must not stop the others."""
    try:
        with _limits(max_pixels):
            return Outcome(work(task))
    except Exception as error:
        return Outcome(None, reason(task.source, error))


def _is_done(task: Task) -> bool:
    return bool(task.outputs) and all(path.exists() for path in task.outputs.values())


def _limits(max_pixels: int | None) -> AbstractContextManager[None]:
    if max_pixels is None:
        return nullcontext()
    from cvtimg.pictures.formats.opening import pixels_limited

    return pixels_limited(max_pixels)


def _attempt(task: Task, *, work: Work, overwrite: bool, how: Running) -> Outcome:
    """Do one task that has outputs."""

    def checked(task: Task) -> Row:
        for path in task.outputs.values():
            if how.skip_existing and not overwrite:
                _remove(path)  # a run was stopped between the outputs of this task
            check_can_be_written(path, overwrite)
        return work(task)

    return _call(task, work=checked, max_pixels=how.max_pixels)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _perform(attempt: Attempt, tasks: Sequence[Task], how: Running) -> Generator[tuple[int, Outcome]]:
    """Give the place of each task and its outcome, as they are done."""
    if how.dask:
        from cvtimg.batch.on_dask import on_dask

        return on_dask(attempt, tasks, how.dask, how.jobs or n_threads())
    jobs = min(how.jobs or _jobs_worthwhile(tasks), len(tasks))
    if jobs > 1:
        from cvtimg.batch.workers import in_workers

        return in_workers(attempt, tasks, jobs, max(1, n_threads() // jobs))
    return ((place, attempt(task)) for place, task in enumerate(tasks))


def _jobs_worthwhile(tasks: Sequence[Task]) -> int:
    """Return how many workers to start if nobody says."""
    n_bytes = 0
    for task in tasks:
        n_bytes += _LEAST_BYTES
        with suppress(OSError):
            n_bytes += task.source.stat().st_size
        if n_bytes > _WORTH_WORKERS:
            return n_threads()
    return 1


def _in_order(results: Generator[tuple[int, Outcome]], step: Step) -> Iterator[Outcome]:
    """Hold outcomes back until those before them are known; `step` hears of each at once."""
    known: dict[int, Outcome] = {}
    place = 0
    with closing(results):
        for ready, outcome in results:
            step(outcome.result)
            known[ready] = outcome
            while place in known:
                yield known.pop(place)
                place += 1


def check_can_be_written(path: Path, overwrite: bool) -> None:
    """Fail now rather than after the work: begin to write, and do not go through with it."""
    from cvtimg.files.whole import whole_file, whole_folder

    class EndOfTrialError(Exception):
        pass

    begin = whole_folder if path.suffix.lower() == ".zarr" else whole_file
    with suppress(EndOfTrialError), begin(path, overwrite=overwrite):
        raise EndOfTrialError


@contextmanager
def _folders(tasks: Sequence[Task], out_dir: Path | None) -> Iterator[None]:
    """Make folders for outputs, and take away those into which nothing came; clear what a killed run left there."""
    from cvtimg.files.whole import remove_leftovers

    wanted = dict.fromkeys(path.parent for task in tasks for path in task.outputs.values())
    made: list[Path] = []
    for folder in [out_dir, *wanted] if out_dir else []:
        missing = [above for above in (folder, *folder.parents) if not above.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        made += reversed(missing)
    for folder in wanted:
        remove_leftovers(folder)
    try:
        yield
    finally:
        for folder in reversed(made):
            with suppress(OSError):  # not empty
                folder.rmdir()


@contextmanager
def _rows_written(report: Report, how: Running, overwrite: bool) -> Iterator[None]:
    """Write the file of rows at the end, whatever ends the run."""
    if how.file is None:
        yield
        return
    replace = overwrite or how.skip_existing
    check_can_be_written(how.file, replace)
    try:
        yield
    finally:
        report.write(how.file, overwrite=replace)
