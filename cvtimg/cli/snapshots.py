"""Inputs of commands that work on all frames of a film, or rows of an array, together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cvtimg.batch import WrongUsageError

if TYPE_CHECKING:
    from cvtimg.bases import Snapshots


def as_given(sources: Sequence[Path]) -> Snapshots:
    """Read one file as a film or an array, and several files as single frames."""
    from cvtimg.bases import as_snapshots

    if len(sources) > 1:
        return as_snapshots(list(sources))
    if not sources:
        raise WrongUsageError("there are no frames")
    return as_snapshots(sources[0])
