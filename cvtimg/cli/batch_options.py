"""Options of commands that take many inputs."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated

from typer import Option

from cvtimg.batch import Running
from cvtimg.cli.options import whole_number

_JOBS, _PIXELS = whole_number(1, 1024), whole_number(1, 1 << 62)
Jobs = Annotated[
    int | None,
    Option("--jobs", "-j", metavar="N", parser=_JOBS, help="Inputs at a time; as many as cores, where that pays."),
]
SkipExisting = Annotated[
    bool, Option("--skip-existing", help="Go on with a run that was stopped: leave out what has its outputs.")
]
ReportFile = Annotated[
    Path | None, Option("--report", metavar="FILE", help="Write a row for each input, .csv or .jsonl.")
]
MaxPixels = Annotated[
    int | None,
    Option(
        "--max-pixels",
        metavar="N",
        parser=_PIXELS,
        help="Refuse larger pictures, for safety; by default over 178956970, where not read by tiles.",
    ),
]
Dask = Annotated[
    str | None,
    Option("--dask", metavar="ADDRESS", help="Work on a Dask cluster: tcp://HOST:PORT, or local for one here."),
]


def _options(
    jobs: Jobs = None,
    skip_existing: SkipExisting = False,
    report_file: ReportFile = None,
    max_pixels: MaxPixels = None,
    dask: Dask = None,
) -> Running:
    return Running(jobs, skip_existing, report_file, max_pixels, dask)


def with_running(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command some of the options of a batch; it gets them as one argument, `running`."""
    known = inspect.signature(_options, eval_str=True).parameters

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        theirs = inspect.signature(command, eval_str=True)
        shown = [parameter for name, parameter in theirs.parameters.items() if name != "running"]

        @wraps(command)
        def decorated(**given: object) -> None:
            running = _options(**{name: given.pop(name) for name in names})  # type: ignore[arg-type]
            command(**given, running=running)

        decorated.__dict__["__signature__"] = theirs.replace(parameters=[*shown, *(known[name] for name in names)])
        return decorated

    return decorate


#: For commands whose inputs have outputs of their own.
for_many = with_running(*inspect.signature(_options).parameters)
