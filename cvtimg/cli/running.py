"""Run the plan of a command with the options that all commands share."""

import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from cvtimg._shared.choices import Arguments, Options
from cvtimg.batch.pipes import is_standard
from cvtimg.batch.plans import Outputs, Pattern, Plan, plan_each, plan_one
from cvtimg.batch.report import Report
from cvtimg.batch.runner import Running, run
from cvtimg.batch.tasks import InputsFailedError, Row, Stopwatch, Task, WrongUsageError
from cvtimg.options.common import READING
from cvtimg.options.record import Given

# Commands get from here what all of them need.
__all__ = ["Given", "Plan", "Report", "Row", "Stopwatch", "Task", "Todo", "WrongUsageError", "only", "plan_of",
           "planned", "plot", "read_beside", "running_of", "selected"]  # fmt: skip

#: What is left to do when a command line is read: what runs its plan, and returns the exit status.
Todo: TypeAlias = Callable[[], int]
_Read = TypeVar("_Read")
#: Options that choose within files.
CHOICES = tuple(option.name for option in READING if option.name != "max_pixels")


def plan_of(
    given: Given,
    named: Pattern | None = None,
    *,
    together: bool = False,
    joined: Collection[str] = (),
    more: Outputs | None = None,
    also_read: Collection[Path] = (),
    **how: Any,
) -> Plan:
    """Plan a command: the roles of its options say which files it reads, and which it writes for each input.

    The main output is that of ``-o``, `named` by default. Options in `joined` name files that are written once for all
    inputs, and `more` has outputs that no option names. `together` makes one task of all inputs; `how` is for
    `plan_each`.
    """
    inputs: Sequence[str] = ()
    read = list(also_read)
    outputs: Arguments = {"-o": named, **(more or {})}  # in this order
    for name, option in given.options.items():
        value = getattr(given, name)
        paths = [part for part in (value if option.many else [value]) or () if isinstance(part, Path)]
        if not option.words:
            inputs = value or ()
        elif option.role == "reads":
            read += paths
        elif option.role == "writes" and paths:
            outputs[option.flag] = paths[0]
    joint = {flag: outputs.pop(flag) for flag in joined if flag in outputs}
    if together:
        return plan_one(inputs, outputs, also_read=read)
    return plan_each(inputs, outputs, out_dir=getattr(given, "out_dir", None), also_read=read, joint=joint, **how)


def planned(plan: Plan, work: Callable[..., Row], report: Report | Sequence[str], given: Given, **how: Any) -> Todo:
    """Return what runs a plan, by `work` for each task, a function of a module, and returns the exit status."""
    # `report` may be the columns of its table; `how` holds fields of Running.
    sends = any(is_standard(path) for task in plan.tasks for path in task.outputs.values())
    if sends and given.as_json:
        raise WrongUsageError("--json needs standard output for itself; name the output by -o FILE")
    if not isinstance(report, Report):
        report = Report(report, as_json=given.as_json, quiet=given.quiet)
    report.quiet |= sends and not given.dry_run  # a table would mix with the output
    running = running_of(given)._replace(**how, around=partial(_as_asked, given=given))
    return partial(run, plan, partial(work, given=given), report, running)


def plot(path: Path | None, given: Given, draw: str, *drawn: Any, **more: Any) -> None:
    """Write what a function of `cvtimg.plotting` draws, if that is asked for."""
    if path is not None:
        from cvtimg import plotting

        plotting.save_plot(path, getattr(plotting, draw), *drawn, **more, overwrite=given.overwrite)


def only(arguments: Options, names: Collection[str]) -> Arguments:
    """Return those of some arguments that a function takes."""
    return {name: value for name, value in arguments.items() if name in names}


def read_beside(path: Path, read: Callable[[Path], _Read]) -> _Read:
    """Read a file that is given beside the inputs, or instead; errors about it name it."""
    try:
        return read(path)
    except OSError as error:
        raise InputsFailedError([(str(path), error)]) from error


def running_of(given: Given) -> Running:
    """Return how a batch is run, by the options that the command has."""
    names = ("overwrite", "dask", "skip_existing", "in_place", "skip_if_larger", "preserve", "dry_run")
    jobs = given.jobs if hasattr(given, "jobs") else 1
    options = {name: getattr(given, name) for name in names if hasattr(given, name)}
    return Running(jobs, report_file=given.report, **options)


@contextmanager
def _as_asked(notes: list[str], *, given: Given) -> Iterator[None]:
    """Read images as asked; what the library warns of is noted, in the words of the command."""
    with selected(given), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        try:
            yield
        except ValueError as error:
            unfit = getattr(error, "option", None)  # of a file of another kind
            text = error.reason.format(given.condition(unfit)) if unfit else given.worded(str(error))  # type: ignore[attr-defined]
            if text == str(error):
                raise
            raise ValueError(text) from error
    notes += dict.fromkeys(given.worded(str(warning.message)) for warning in caught)


def selected(given: Given) -> ExitStack:
    """Return a context in which images are read as --page, --axes, --channel and their kin, and --max-pixels say."""
    stack = ExitStack()
    chosen = {name: getattr(given, name, None) for name in CHOICES}
    if any(value is not None for value in chosen.values()):
        from cvtimg.pictures.formats.opening import Selection, selecting

        stack.enter_context(selecting(Selection(**chosen)))
    if (most := getattr(given, "max_pixels", None)) is not None:
        from cvtimg.pictures.formats.opening import pixels_limited

        stack.enter_context(pixels_limited(most))
    return stack
