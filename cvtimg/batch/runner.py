"""Run a plan in this process, in workers or on Dask; a failed input does not stop the others."""

import math
import os
import shutil
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import time
from typing import Any, NamedTuple, Self

from cvtimg._shared.threads import n_threads, pairwise_sum
from cvtimg.batch.pipes import as_files, deliver
from cvtimg.batch.plans import Plan, check_no_clash, check_suffix
from cvtimg.batch.report import FILE_SUFFIXES, Report, RowFile, progress, reason
from cvtimg.batch.tasks import Attempt, InputsFailedError, Outcome, Row, Stopwatch, Task, Work
from cvtimg.files.remote import exists, is_remote, local_copy, url_of
from cvtimg.files.whole import check_can_be_written, local_path, remove_leftovers, scratch_folder, whole_file

#: Exit status of an interrupted run, plus the number of the signal.
INTERRUPTED = 128


class Running(NamedTuple):
    """How a plan is run."""

    # Number of cores for worker processes, as many where there are inputs for them; with 1, all inputs are processed in
    # this process. By default the number of threads, if the inputs are worth it.
    jobs: int | None = 1
    # Skip inputs whose outputs all exist. These are complete, because files appear complete or not at all.
    skip_existing: bool = False
    overwrite: bool = False  # Allow outputs to replace existing files
    report_file: Path | None = None  # Report with a row for each input, .csv or .jsonl
    # Address of the scheduler of a Dask cluster, or "local" for a cluster of `jobs` processes on this machine.
    dask: str | None = None
    in_place: bool = False  # Allow outputs to replace their own inputs, once they are complete
    skip_if_larger: bool = False  # Keep the main output only if it is smaller than the input
    # Suffixes of main outputs whose input stays, in place, or is copied, where it is of the same format and smaller.
    keep_smaller: tuple[str, ...] = ()
    preserve: bool = False  # Give outputs the times of their inputs
    dry_run: bool = False  # Print the outputs of each input, and do nothing
    # Modules that tasks import, which workers have from the start.
    late: tuple[str, ...] = ("cvtimg.pictures.files",)
    # Suffixes of inputs elsewhere that the work reads by their URLs, in parts; it gets a copy of any other.
    by_url: tuple[str, ...] = ()
    # Makes a context in which each task is done, which appends to the list the warnings of its row; picklable.
    around: Callable[[list[str]], AbstractContextManager[object]] = nullcontext


def run(plan: Plan, work: Work, report: Report, running: Running) -> int:
    """Run all tasks of a plan, report each in its order, and return the exit status: 0, 1 if some failed, or 130.

    The signals TERM and HUP end a run as INT does, with status 143 and 129.
    """
    check_plan(plan, running)
    report.writes_files = bool(plan.joint or running.report_file or any(task.outputs for task in plan.tasks))
    skips = [
        running.skip_existing
        and (bool(task.outputs) if plan.known is None else task.name in plan.known)
        and all(map(exists, task.outputs.values()))
        for task in plan.tasks
    ]
    if running.dry_run:
        return _rehearse(plan, skips, report, running)
    todo = [task for task, skip in zip(plan.tasks, skips, strict=True) if not skip]
    with _folders(todo, plan.out_dir), _rows_written(report, running) as rows, as_files(todo) as todo:
        for text, error in plan.missing:
            report.failed(text, reason(text, error))
        places = [place for place, skip in enumerate(skips) if not skip]
        told = _InOrder(report, [*plan.tasks], rows)
        for place, task in zip(places, todo, strict=True):
            told.tasks[place] = task
        for place, skip in enumerate(skips):
            if skip:
                told.add(place, Outcome({**plan.tasks[place].facts, "skipped": True}))
        started = time() - 0.05  # seconds by which times of files may lag behind the clock
        try:
            attempt = partial(_attempt, work=work, running=running)
            with Ending() as ending, progress(len(todo), report) as step, _performed(attempt, todo, running) as results:
                for number, outcome in results:
                    with ending.held():
                        step()
                        told.add(places[number], outcome)
        except KeyboardInterrupt as interrupt:
            told.end(started)
            report.interrupted(len(plan.tasks) + len(plan.missing))
            return INTERRUPTED + (interrupt.args[0] if interrupt.args else signal.SIGINT)
    return report.close()


class Ending:
    """Lets the signals INT, TERM and HUP end a block by a KeyboardInterrupt with their number, but not while `held`."""

    def __init__(self) -> None:
        self._number, self._is_held = 0, False
        numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
        is_main = threading.current_thread() is threading.main_thread()  # which alone has handlers
        handlers = {number: signal.getsignal(number) for number in numbers if is_main}
        usual = (signal.SIG_DFL, signal.default_int_handler)  # nohup ignores HUP, and so do we
        self._before = {number: handler for number, handler in handlers.items() if handler in usual}

    def __enter__(self) -> Self:
        for number in self._before:
            signal.signal(number, self._end)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _end(self, number: int, _: object) -> None:
        for other in self._before:  # a second one would end how the first is dealt with
            signal.signal(other, signal.SIG_IGN)
        self._number = number
        if not self._is_held:
            raise KeyboardInterrupt(number)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Do the block to its end."""
        self._is_held = True
        try:
            yield
        finally:
            self._is_held = False
        if self._number:
            raise KeyboardInterrupt(self._number)


def _rehearse(plan: Plan, skips: Sequence[bool], report: Report, running: Running) -> int:
    """Print which file becomes which, and what stands in the way of that; return the exit status of such a run."""
    for text, error in plan.missing:
        report.failed(text, reason(text, error))
    for task, skip in zip(plan.tasks, skips, strict=True):
        if skip:
            report.skipped({**task.facts, "skipped": True})
            continue
        try:
            for path in task.outputs.values():
                if not plan.out_dir or path.parent.exists():  # else the folder is made for it
                    replaces = running.overwrite or running.in_place or running.skip_existing
                    check_can_be_written(path, overwrite=replaces)
        except OSError as error:
            report.failed(task.name, reason(task.source if task.sources else task.name, error))
        else:
            report.would_do(task)
    for path in plan.joint.values():
        report.would_do(Task(tuple(source for task in plan.tasks for source in task.sources), {"": path}))
    return report.close()


class _InOrder:
    """Reports outcomes in the order of the tasks, in whatever order they come; adds rows to a file at once."""

    def __init__(self, report: Report, tasks: list[Task], rows: RowFile | None) -> None:
        self._report, self.tasks, self._rows = report, tasks, rows
        self._known: dict[int, Outcome] = {}
        self._next = 0

    def add(self, place: int, outcome: Outcome) -> None:
        """Take the outcome of a task, and report all before which none is missing."""
        self._known[place] = outcome
        if self._rows:
            for row in outcome.rows:
                self._rows.add(row)
        while self._next in self._known:
            self._tell(self.tasks[self._next], self._known[self._next])
            self._next += 1

    def end(self, started: float) -> None:
        """Report what is done though earlier tasks are not, and outputs that are whole though no outcome says so."""
        # These were written since `started` by a task that was interrupted before it could say so.
        for place, task in enumerate(self.tasks[self._next :], start=self._next):
            if place not in self._known and task.outputs and not task.shown:
                with suppress(OSError):  # no such file, or elsewhere
                    if all(path.stat().st_mtime > started for path in task.outputs.values()):
                        self._known[place] = Outcome(task.facts)
            if place in self._known:
                self._tell(task, self._known[place])

    def _tell(self, task: Task, outcome: Outcome) -> None:
        """Report a task, and copy its output to standard output if it belongs there."""
        for name, why in outcome.failures:
            self._report.failed(name, why)
        if outcome.failures:
            return
        deliver(task)
        if outcome.result.get("skipped"):
            self._report.skipped(outcome.result)
        else:
            self._report.done(outcome.result)


def check_plan(plan: Plan, running: Running) -> None:
    """Refuse outputs that would replace inputs or each other, and joint outputs that cannot be written."""
    check_suffix("--report", running.report_file, FILE_SUFFIXES)
    check_no_clash(plan, running.report_file, in_place=running.in_place)
    for path in plan.joint.values():
        check_can_be_written(path, overwrite=running.overwrite or running.skip_existing)


def fold(
    tasks: Sequence[Task], work: Callable[[Task], Any], add: Callable[[Any, Any], Any], running: Running
) -> tuple[Any, dict[Path, str]]:
    """Add up what `work` returns for each task, in pairs, as they complete; return the sum and why others failed."""
    attempt = partial(_count, work=work)
    failed: dict[Path, str] = {}

    def results() -> Iterator[Any]:
        with _performed(attempt, tasks, running) as outcomes:
            for place, outcome in outcomes:
                if outcome.failures:
                    failed[tasks[place].source] = outcome.failures[0][1]
                else:
                    yield outcome.result

    return pairwise_sum(results(), add), failed


def _attempt(task: Task, *, work: Work, running: Running) -> Outcome:
    """Do one task and return its row; catch all errors, because a bad input must not stop the others."""
    here = task
    try:
        with _copies(task, running) as here:
            for path in here.outputs.values():
                if running.skip_existing and not running.overwrite:
                    # An earlier run stopped between the outputs of this task.
                    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
                check_can_be_written(path, overwrite=running.overwrite or running.in_place)
            stopwatch, before = Stopwatch(), _n_bytes("input_bytes", here.sources)
            times = os.stat(here.source) if running.preserve else None  # noqa: PTH116
            notes: list[str] = []
            aside = here.outputs and (running.skip_if_larger or running.in_place or _may_stay(here, running))
            with running.around(notes):
                done = _worked_aside(here, work, stopwatch, running) if aside else work(here, stopwatch)
            if times and not done.get("skipped"):
                for path in here.outputs.values():
                    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
            row = {**here.facts, **done, **before}
            if not row.get("skipped"):
                row |= _n_bytes("output_bytes", tuple(here.outputs.values()))
            larger = row.get("output_bytes", 0) > row.get("input_bytes", math.inf)  # in another format than the input
            if larger and here.output.suffix.lower() in running.keep_smaller:
                notes.append(f"larger than the {here.source.suffix} file: --skip-if-larger leaves such outputs out")
            if notes:
                row["warning"] = "; ".join([*([row["warning"]] if "warning" in row else []), *notes])
        return Outcome({**row, "seconds": stopwatch.laps} if stopwatch.laps else row)
    except Exception as error:
        return _failed(here, error)


def _count(task: Task, *, work: Callable[[Task], Any]) -> Outcome:
    here = replace(task, outputs={})
    try:
        with _copies(here, Running()) as here:
            return Outcome(work(here))
    except Exception as error:
        return _failed(here, error)


def _failed(task: Task, error: Exception) -> Outcome:
    if isinstance(error, InputsFailedError):
        failed = [(task.wording(name), task.wording(reason(name, why))) for name, why in error.failed]
        return Outcome(None, tuple(failed))
    text = task.wording(reason(task.source if task.sources else task.name, error))
    return Outcome(None, ((task.name, text.removeprefix(f"{task.name}: ")),))


def _n_bytes(column: str, files: Sequence[Path]) -> Row:
    return {column: files[0].stat().st_size} if files and files[0].is_file() else {}


@contextmanager
def _copies(task: Task, running: Running) -> Iterator[Task]:
    """Give a task with files here for those elsewhere: copies of inputs, and outputs, sent when the block succeeds."""
    fetched = [path for path in task.sources if is_remote(path) and path.suffix.lower() not in running.by_url]
    sent = [path for path in task.outputs.values() if is_remote(path)]
    if not fetched and not sent:
        yield task
        return
    overwrite = running.overwrite or running.in_place
    with ExitStack() as stack:
        copies = {path: stack.enter_context(local_path(path, overwrite=overwrite)) for path in sent}
        copies |= {path: stack.enter_context(local_copy(path)) for path in fetched}
        shown = {**task.shown, **{copy: url_of(path) for path, copy in copies.items()}}
        sources = tuple(copies.get(path, path) for path in task.sources)
        yield Task(sources, {option: copies.get(path, path) for option, path in task.outputs.items()}, shown)


def _worked_aside(task: Task, work: Work, stopwatch: Stopwatch, running: Running) -> Row:
    """Do the work in a scratch folder, because the main output may be discarded or replaces its input."""
    with scratch_folder(task.output) as folder:
        trial = folder / task.output.name
        row = work(replace(task, outputs={**task.outputs, "-o": trial}), stopwatch)
        may_stay = _may_stay(task, running)
        if running.skip_if_larger or may_stay:
            larger = trial.stat().st_size >= task.source.stat().st_size
            if larger and (running.skip_if_larger or running.in_place):
                return {**row, "output": None, "skipped": "output not smaller"}
            if larger:
                trial, row["warning"] = task.source, "the output is not smaller: a copy of the input"
        overwrite = running.overwrite or running.in_place
        with trial.open("rb") as source, whole_file(task.output, overwrite=overwrite) as target:
            shutil.copyfileobj(source, target)
    return row


def _may_stay(task: Task, running: Running) -> bool:
    """Whether the input may take the place of the main output."""
    if not (running.keep_smaller and task.sources):
        return False
    suffixes = {path.suffix.lower() for path in (task.source, task.output)}
    return len(suffixes) == 1 and suffixes <= {*running.keep_smaller} and task.source.is_file()


@contextmanager
def _performed(attempt: Attempt, tasks: Sequence[Task], running: Running) -> Generator[Iterable[tuple[int, Outcome]]]:
    """Give the index and the outcome of each task as it completes; at the end of the block, what still works stops."""
    jobs = min(running.jobs or _jobs_worthwhile(tasks), len(tasks))
    if running.dask:
        from cvtimg.batch.executors import on_dask

        results = on_dask(attempt, tasks, running.dask, running.jobs or n_threads())
    elif jobs > 1:
        from cvtimg.batch.executors import in_processes

        cores = min(running.jobs or n_threads(), n_threads())
        results = in_processes(attempt, tasks, jobs, max(1, cores // jobs), running.late)
    else:
        yield enumerate(map(attempt, tasks))
        return
    with closing(results):
        yield results


def _jobs_worthwhile(tasks: Sequence[Task], least: int = 8 << 20, of_input: int = 1 << 17) -> int:
    # Below the `least` bytes of inputs, about 13 photographs of 768 x 512, starting workers takes longer than it saves.
    # Bytes that the start of an input costs beside those it has.
    sources = [source for task in tasks for source in task.sources if os.path.isfile(source)]  # noqa: PTH113
    n_bytes = of_input * len(tasks) + sum(source.stat().st_size for source in sources)
    return n_threads() if n_bytes > least else 1


@contextmanager
def _folders(tasks: Sequence[Task], out_dir: Path | None) -> Iterator[None]:
    """Create folders for outputs, clear what killed runs left there, and at the end remove folders that are empty."""
    outputs = [path for task in tasks for path in task.outputs.values()]
    wanted = dict.fromkeys(path.parent for path in outputs if not is_remote(path))
    made: list[Path] = []
    for folder in [out_dir, *wanted] if out_dir and not is_remote(out_dir) else []:
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
def _rows_written(report: Report, running: Running) -> Iterator[RowFile | None]:
    """Give the report file, and put its rows in order at the end of the run, however it ends."""
    if running.report_file is None:
        yield None
        return
    append = running.skip_existing and not running.overwrite
    rows = RowFile(running.report_file, overwrite=running.overwrite, append=append)
    try:
        yield rows
    finally:
        rows.end(report.rows)
