"""Options that several commands share, each declared once, and the groups of options that travel together.

This module is imported for ``--help``, so heavy imports are inside functions.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from string import hexdigits
from typing import Annotated, Any, Literal, TypeAlias

import typer
from typer import Option

from cvtimg._shared.choices import AveragingName, EffortName, InitName, MethodName, SpaceName
from cvtimg.batch import Running, WrongUsageError
from cvtimg.batch.pipes import STANDARD

MAX_COLORS = 1 << 16  # as in remapping.py, which would import NumPy for --help


# Parsers, because the messages of Typer's own give neither the value nor all that is allowed.


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
    """Extend a parser to accept "auto"."""

    def parse_or_auto(text: Any) -> Any:
        if text == "auto":
            return text
        try:
            return parse(text)
        except typer.BadParameter as error:
            raise typer.BadParameter(str(error).replace(" must be ", " must be auto or ", 1)) from error

    return parse_or_auto


def color(text: str) -> str:
    """Check a color in the notation of CSS, and return its eight hexadecimal digits, alpha included."""
    digits = text.removeprefix("#")
    if len(digits) in (3, 4):
        digits = "".join(2 * digit for digit in digits)
    if len(digits) in (6, 8) and set(digits) <= set(hexdigits):
        return f"{digits:f<8}"
    from PIL import ImageColor

    if isinstance(known := ImageColor.colormap.get(text.lower()), str):
        return f"{known.removeprefix('#'):f<8}"
    raise typer.BadParameter(f"{text!r} must be a color as '#rgb', '#rrggbb', '#rrggbbaa', or a name as 'white'")


def color_or_file(text: str | Path) -> str | Path:
    """Check that an argument is a color or an existing file."""
    try:
        return color(str(text))
    except typer.BadParameter as error:
        if Path(text).is_file():
            return Path(text)
        raise typer.BadParameter(f"{error!s}, or a palette file") from None


def n_bytes(text: str | int) -> int:
    """Parse a size such as 60000, 60K (1024 bytes each), 60kB (1000 bytes each) or 1.5M."""
    match = re.fullmatch(r"(\d+(?:\.\d*)?)([kKMG]?)(B?)", str(text).strip())
    if match:
        unit = (1000 if match[3] else 1024) ** " KMG".index(match[2].upper() or " ")
        if 1 <= (size := int(float(match[1]) * unit)) < 1 << 62:
            return size
    raise typer.BadParameter(f"{str(text)!r} must be a number of bytes >= 1, such as 60000, 60K or 1.5M")


def output_file(standard: str) -> Callable[[str | Path], Path]:
    """Make a parser for an output; `standard` is the suffix of the format that goes to standard output as "-"."""

    def parse(text: str | Path) -> Path:
        form, colon, name = str(text).rpartition(":")
        if str(text) == f"zarr:{STANDARD}":
            raise typer.BadParameter("a Zarr array is a folder and cannot go to standard output")
        if name == STANDARD and colon and form.isalnum():
            return Path(f"{STANDARD}.{form}")
        return Path(f"{STANDARD}{standard}" if str(text) in (STANDARD, "/dev/stdout") else text)

    return parse


# Choices

AveragingChoice: TypeAlias = Literal["none", AveragingName]
PALETTE_NAMES = ".gpl, .json, .hex, .act, .ase, .css, .pal, .txt, .aseprite or .png"

# Inputs and outputs

Images = Annotated[
    list[str],
    typer.Argument(
        metavar="INPUT...",
        help="Images, URLs, folders, patterns like 'a/*.tif', - for standard input, or @FILE for a list of names (@- "
        "for one on standard input).",
    ),
]
Output = Annotated[
    Path | None,
    Option(
        "--output",
        "-o",
        metavar="FILE",
        parser=output_file(".png"),
        help="Output file, for one input; - for standard output, in PNG or in another format as webp:-.",
    ),
]
OutDir = Annotated[
    Path | None, Option(metavar="DIR", help="Folder for outputs, which keep the names and subfolders of the inputs.")
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
        help="Refuse larger images, for safety; 178956970 by default.",
    ),
]


@dataclass(frozen=True, slots=True)
class InputOptions:
    """What to read of files that hold more than an image."""

    page: Annotated[
        int | None,
        Option(
            "--page", metavar="N", parser=whole_number(1, 1 << 31), help="Read only page N of files of several pages."
        ),
    ] = None
    channel_axis: Annotated[
        int | None,
        Option(
            "--channel-axis",
            metavar="AXIS",
            parser=whole_number(0, 2),
            help="Axis of the bands in .npy arrays: 0 for (bands, height, width).",
        ),
    ] = None

    def chosen(self, work: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that reads what is chosen."""
        given = self.page is not None or self.channel_axis is not None
        return partial(_chosen, work=work, page=self.page, channel_axis=self.channel_axis) if given else work


def _chosen(*arguments: Any, work: Callable[..., Any], page: int | None, channel_axis: int | None) -> Any:
    from cvtimg.pictures.formats.opening import Selection, selecting

    with selecting(Selection(page, channel_axis)):
        return work(*arguments)


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
Averaging = Annotated[AveragingChoice, Option(help="Smooth noise, before or after pixels are assigned to segments.")]

Mask = Annotated[
    Path | None,
    Option(metavar="FILE", help="Image of the same size (one, or one per page or frame): leave out black pixels."),
]
NoData = Annotated[
    float | None,
    Option(
        "--nodata",
        metavar="V",
        help="Ignore pixels with the value V in every band; by default the nodata value of a GeoTIFF.",
    ),
]

Missing = Annotated[Literal["error", "drop"], Option(help="What to do with rows of tables that lack a value.")]


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
    """Options of every command: whether to replace files, and what to print."""

    overwrite: Annotated[bool, Option("--overwrite", help="Replace existing outputs, but never an input.")] = False
    as_json: Annotated[bool, Option("--json", help="Print one JSON object per line and input, not a table.")] = False
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False
    report_file: Annotated[
        Path | None, Option("--report", metavar="FILE", help="Write a row for each input, .csv or .jsonl.")
    ] = None

    def __post_init__(self) -> None:
        if self.as_json and self.quiet:
            raise WrongUsageError("--json and --quiet exclude each other")

    def running(self, **more: Any) -> Running:
        """Return how to run a batch; `more` has settings that only some commands have, such as skip_existing."""
        return Running(1, overwrite=self.overwrite, report_file=self.report_file, **more)


@dataclass(frozen=True, slots=True)
class BatchOptions(CommonOptions):
    """Options of commands that process each input separately."""

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

    def running(self, **more: Any) -> Running:
        """Return how to run a batch."""
        return Running(self.jobs, overwrite=self.overwrite, report_file=self.report_file, dask=self.dask, **more)
