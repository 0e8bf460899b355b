"""Inputs of commands that work on all frames of a film, or rows of an array, together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from cvtimg.batch import WrongUsageError
from cvtimg.cli import options

if TYPE_CHECKING:
    from cvtimg.bases import Snapshots

Frames = Annotated[
    list[str],
    typer.Argument(
        metavar="INPUT...", help="A film (GIF, APNG, WebP), images or a folder of them, or an array, .npy or .zarr."
    ),
]


def _even(text: Any) -> int:
    value = options.whole_number(2, 64)(text)
    if value % 2:
        raise typer.BadParameter(f"{str(text)!r} must be an even number in 2..64")
    return value


Passes = Annotated[
    int, Option(metavar="N", parser=_even, help="How often to read the input, an even number: more is more precise.")
]


def as_given(sources: Sequence[Path]) -> Snapshots:
    """Read one file as a film or an array, and several files as single frames."""
    from cvtimg.bases import as_snapshots

    if len(sources) > 1:
        return as_snapshots(list(sources))
    if not sources:
        raise WrongUsageError("there are no frames")
    return as_snapshots(sources[0])
