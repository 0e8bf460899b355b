"""Options that several commands share, each declared once, and the groups of options that travel together.

This module is imported for ``--help``: what is heavy is imported where it is used. Choices stand here as `Literal`,
for the registries would import NumPy; a test holds them together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from string import hexdigits
from typing import Annotated, Any, Literal, TypeAlias

import typer
from typer import Option

from cvtimg.batch import Running, WrongUsageError

MAX_COLORS = 1 << 16  # as in remapping.py, which would import NumPy for --help


# Parsers: Typer's own say neither what was given nor all that is allowed.


def whole_number(low: int, high: int) -> Callable[[str | int], int]:
    """Make a parser for a whole number in low..high."""

    def parse(text: str | int) -> int:
        with suppress(ValueError):
            if low <= int(text) <= high:
                return int(text)
        raise typer.BadParameter(f"{str(text)!r} must be a whole number in {low}..{high}")

    return parse


def number(low: float = -math.inf, high: float = math.inf, *, above: float = -math.inf) -> Callable[[Any], float]:
    """Make a parser for a finite number in low..high that is greater than `above`."""
    limits = [f"> {above:g}"] if above > -math.inf else []
    if low > -math.inf:
        limits = [f"in {low:g}..{high:g}" if high < math.inf else f">= {low:g}"]
    elif high < math.inf:
        limits.append(f"at most {high:g}")
    allowed = " ".join(["a number", " and ".join(limits)]).strip()

    def parse(text: str | float) -> float:
        with suppress(ValueError):
            value = float(text)
            if math.isfinite(value) and low <= value <= high and value > above:
                return value
        raise typer.BadParameter(f"{str(text)!r} must be {allowed}")

    return parse


def or_auto(parse: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Let "auto" stand beside what a parser takes."""

    def parse_or_auto(text: Any) -> Any:
        if text == "auto":
            return text
        try:
            return parse(text)
        except typer.BadParameter as error:
            raise typer.BadParameter(str(error).replace(" must be ", " must be auto or ", 1)) from error

    return parse_or_auto


def color(text: str) -> str:
    """Check a color in the way of style sheets, and return its digits with those of alpha."""
    digits = text.removeprefix("#")
    if len(digits) in (6, 8) and set(digits) <= set(hexdigits):
        return f"{digits:f<8}"
    raise typer.BadParameter(f"{text!r} must be a color as '#rrggbb' or '#rrggbbaa'")


# Choices

EffortName: TypeAlias = Literal["fast", "balanced", "best"]
MethodName: TypeAlias = Literal["lloyd", "transfer", "macqueen", "probabilistic", "optimal1d"]
InitName: TypeAlias = Literal["split", "k-means++", "maximin", "random"]
SpaceName: TypeAlias = Literal["rgb", "linear", "lab", "oklab"]
AveragingName: TypeAlias = Literal["none", "before", "after"]
PALETTE_NAMES = ".gpl, .json, .hex, .act, .ase, .css or .png"

# Inputs and outputs

Images = Annotated[
    list[str], typer.Argument(metavar="INPUT...", help="Images, folders, patterns like 'a/*.tif', or - for a list.")
]
Output = Annotated[Path | None, Option("--output", "-o", metavar="FILE", help="Output file; for one input.")]
OutDir = Annotated[
    Path | None, Option(metavar="DIR", help="Folder for outputs NAME.png; subfolders are kept as in the input.")
]
SkipExisting = Annotated[
    bool, Option("--skip-existing", help="Skip inputs whose outputs all exist, to resume a run that was stopped.")
]
MaxPixels = Annotated[
    int | None,
    Option(
        "--max-pixels",
        metavar="N",
        parser=whole_number(1, 1 << 62),
        help="Refuse larger images, for safety; 178956970 by default, no limit for images read in tiles.",
    ),
]

# The method

Effort = Annotated[EffortName, Option(help="How long to search for a better result.")]
Space = Annotated[SpaceName, Option(help="Color space in which distances are measured.")]
Seed = Annotated[
    int, Option("--seed", metavar="N", parser=whole_number(0, 2**63 - 1), help="Seed of the random number generator.")
]
VolumePower = Annotated[
    float,
    Option(
        metavar="P", parser=number(0), help="Weight cells by their size to this power (0: all cells count the same)."
    ),
]
Averaging = Annotated[AveragingName, Option(help="Smooth noise, before or after pixels are assigned to segments.")]


@dataclass(frozen=True, slots=True)
class EngineOptions:
    """How generators are found: the options of `cvtimg.tessellate`."""

    effort: Effort = "balanced"
    method: Annotated[
        MethodName | None, Option(help="Algorithm that moves the generators; by default the one that suits.")
    ] = None
    volume_power: VolumePower = 0
    init: Annotated[InitName, Option(help="How initial generators are chosen.")] = "split"
    seed: Seed = 0

    @property
    def keywords(self) -> dict[str, Any]:
        """The options under their names in Python."""
        given = {"effort": self.effort, "method": self.method, "init": self.init}
        return {**given, "volume_power": self.volume_power, "rng": self.seed}


# The run


@dataclass(frozen=True, slots=True)
class CommonOptions:
    """Options of every command: what may be replaced, and what is printed."""

    overwrite: Annotated[bool, Option("--overwrite", help="Replace existing outputs; inputs are never replaced.")] = (
        False
    )
    as_json: Annotated[bool, Option("--json", help="Print one JSON object per line and input, not a table.")] = False
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False
    report_file: Annotated[
        Path | None, Option("--report", metavar="FILE", help="Write a row for each input, .csv or .jsonl.")
    ] = None

    def __post_init__(self) -> None:
        if self.as_json and self.quiet:
            raise WrongUsageError("--json and --quiet exclude each other")

    def running(self, *, skip_existing: bool = False) -> Running:
        """Tell a batch how to run."""
        return Running(1, skip_existing, self.overwrite, self.report_file)


@dataclass(frozen=True, slots=True)
class BatchOptions(CommonOptions):
    """Options of commands that work on each input by itself."""

    jobs: Annotated[
        int | None,
        Option(
            "--jobs",
            "-j",
            metavar="N",
            parser=whole_number(1, 1024),
            help="Number of inputs processed at the same time; by default one per core where that is faster.",
        ),
    ] = None
    dask: Annotated[
        str | None,
        Option(
            "--dask",
            metavar="ADDRESS",
            help="Run on a Dask cluster: tcp://HOST:PORT, or local to start one on this machine.",
        ),
    ] = None

    def running(self, *, skip_existing: bool = False) -> Running:
        """Tell a batch how to run."""
        return Running(self.jobs, skip_existing, self.overwrite, self.report_file, self.dask)
