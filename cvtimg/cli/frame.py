"""The frame of all commands: groups of options passed as one argument, and the run of a plan."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from functools import partial, wraps
from typing import Any, get_type_hints

import typer

from cvtimg.batch import Plan, Report, Row, Stopwatch, Task, Work, WrongUsageError, run
from cvtimg.batch.pipes import is_standard
from cvtimg.cli.options import CommonOptions

__all__ = ["run_plan", "with_groups"]


def with_groups(command: Callable[..., Any]) -> Callable[..., Any]:
    """Turn a function that returns an exit status into a command.

    Parameters annotated with a dataclass of options become the options in it.
    """
    signature = inspect.signature(command, eval_str=True)
    annotations = {name: parameter.annotation for name, parameter in signature.parameters.items()}
    groups: dict[str, Any] = {name: kind for name, kind in annotations.items() if is_dataclass(kind)}
    shown = [it for name, it in signature.parameters.items() if name not in groups]
    shown += [parameter for group in groups.values() for parameter in _parameters(group)]

    @wraps(command)
    def ungrouped(**given: Any) -> None:
        made = {
            name: group(**{one.name: given.pop(one.name) for one in fields(group)}) for name, group in groups.items()
        }
        raise typer.Exit(command(**given, **made))

    ungrouped.__dict__["__signature__"] = signature.replace(parameters=shown)
    return ungrouped


def _parameters(group: Any) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=hints[one.name])
        for one in fields(group)
    ]


def run_plan(
    plan: Plan,
    work: Work,
    report: Report | Sequence[str],
    common: CommonOptions,
    *,
    max_pixels: int | None = None,
    **running: Any,
) -> int:
    """Run a plan and report it.

    Parameters
    ----------
    plan : Plan
        Tasks to do.
    work : callable
        Does a task, given with its stopwatch, and returns the columns of its row; picklable if run in other processes.
    report : Report or sequence of str
        Report, or the columns of its table.
    common : CommonOptions
        Common options of the run.
    max_pixels : int, optional
        Largest number of pixels of an image; about 179 million by default.
    **running
        Further fields of `Running`: skip_existing, in_place, skip_if_larger, by_url.

    Returns
    -------
    int
        Exit status.
    """
    sends = any(is_standard(path) for task in plan.tasks for path in task.outputs.values())
    if sends and common.as_json:
        raise WrongUsageError("--json needs standard output for itself; name the output by -o FILE")
    if not isinstance(report, Report):
        report = Report(report, as_json=common.as_json, quiet=common.quiet)
    report.quiet |= sends  # a table would mix with the output
    if max_pixels is not None:
        work = partial(_limited, work=work, max_pixels=max_pixels)
    return run(plan, work, report, common.running(**running))


def _limited(task: Task, stopwatch: Stopwatch, *, work: Work, max_pixels: int) -> Row:
    from cvtimg.pictures.formats.opening import pixels_limited

    with pixels_limited(max_pixels):
        return work(task, stopwatch)
