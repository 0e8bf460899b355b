"""Options that several commands have."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from string import hexdigits
from typing import Annotated, Any

import typer
from typer import Option

from cvtimg.batch import check_choice

MAX_COLORS = 1 << 16  # as in remapping.py, which would import NumPy for --help


def whole_number(low: int, high: int) -> Callable[[str | int], int]:
    """Make a parser for an option: Typer's own says neither what was given nor all that is allowed."""

    def parse(text: str | int) -> int:
        with suppress(ValueError):
            if low <= int(text) <= high:
                return int(text)
        raise typer.BadParameter(f"{str(text)!r} must be a whole number in {low}..{high}")

    return parse


def count_or_auto(low: int, high: int) -> Callable[[str | int], int | str]:
    """Make a parser for a number of generators, which the elbow of the energy may pick."""
    parse_count = whole_number(low, high)

    def parse(text: str | int) -> int | str:
        if text == "auto":
            return text
        with suppress(typer.BadParameter):
            return parse_count(text)
        raise typer.BadParameter(f"{str(text)!r} must be auto or a whole number in {low}..{high}")

    return parse


def number(low: float, high: float = math.inf) -> Callable[[str | float], float]:
    """Make a parser for a finite number."""
    allowed = f">= {low:g}" if high == math.inf else f"in {low:g}..{high:g}"

    def parse(text: str | float) -> float:
        with suppress(ValueError):
            if low <= float(text) <= high and math.isfinite(float(text)):
                return float(text)
        raise typer.BadParameter(f"{str(text)!r} must be a number {allowed}")

    return parse


def color(text: str) -> str:
    """Check a color in the way of style sheets, and return its digits with those of alpha."""
    digits = text.removeprefix("#")
    if len(digits) in (6, 8) and set(digits) <= set(hexdigits):
        return f"{digits:f<8}"
    raise typer.BadParameter(f"{text!r} must be a color as '#rrggbb' or '#rrggbbaa'")


# The names stand here as text, for the registries would import NumPy; a test holds them together.
EFFORT_HELP = "Time to take: fast, balanced or best."
METHOD_NAMES = "lloyd, transfer, macqueen, probabilistic or optimal1d"
SPACE_NAMES = "rgb, linear, lab or oklab"
DITHER_NAMES = "none, floyd-steinberg or blue-noise"
PALETTE_NAMES = ".gpl, .json, .hex, .act, .ase, .css or .png"
SEEDING_NAMES = "split, k-means++, maximin or random"

SEED = whole_number(0, 2**63 - 1)
Pictures = Annotated[
    list[str], typer.Argument(metavar="INPUT", help="Pictures, folders, patterns like 'a/*.tif', or - for a list.")
]
Output = Annotated[Path | None, Option("--output", "-o", metavar="FILE", help="Output, for one input.")]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Folder for outputs NAME.png, in folders as inputs are.")]
Effort = Annotated[str, Option(metavar="NAME", help=EFFORT_HELP)]
Init = Annotated[str, Option(metavar="NAME", help=f"Colors to begin with: {SEEDING_NAMES}.")]
Seed = Annotated[int, Option("--seed", metavar="N", parser=SEED, help="Seed of what is drawn.")]
Method = Annotated[
    str | None, Option(metavar="NAME", help=f"How generators move, by default as suits: {METHOD_NAMES}.")
]
VolumePower = Annotated[
    float,
    Option("--volume-power", metavar="P", parser=number(0), help="How much more a large cell counts, >= 0; 0 for not."),
]
Overwrite = Annotated[bool, Option("--overwrite", help="Replace outputs that exist. Inputs are never replaced.")]
AsJson = Annotated[bool, Option("--json", help="Print a JSON object a line for each input, not a table.")]
Quiet = Annotated[bool, Option("--quiet", help="Print nothing but errors.")]


def engine(*, effort: str, method: str | None, init: str, volume_power: float, seed: int) -> dict[str, Any]:
    """Check the options of the engine, and name them as `tessellate` does."""
    from cvtimg.engine import EFFORTS, METHODS, SEEDINGS

    check_choice("--effort", effort, EFFORTS)
    if method:
        check_choice("--method", method, METHODS)
    check_choice("--init", init, SEEDINGS)
    return {"effort": effort, "method": method, "init": init, "volume_power": volume_power, "rng": seed}
