"""The state of a long descent in a file, so that a run that was cut off goes on where it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg.files.arrays import UnfitArraysError, load_arrays, save_arrays
from cvtimg.files.remote import exists
from cvtimg.files.whole import StrPath

_KIND = "checkpoint"


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A file or URL with generators, and the energies that led to them."""

    path: StrPath | None  # The file; None to save nothing
    job: str  # Names the samples and the options. The state of another job is refused.

    def load(self) -> tuple[NDArray[np.float64], list[float]] | None:
        """Return what was saved, or None if there is no file; a file of another job is refused."""
        if self.path is None or not exists(self.path):
            return None
        try:
            state = load_arrays(self.path, _KIND, ("job", "generators", "energies"))
        except UnfitArraysError as error:
            raise ValueError(f"checkpoint={str(self.path)!r} must be a file that an earlier run saved") from error
        same = str(state["job"]) == self.job
        check_that(f"checkpoint={str(self.path)!r}", same, "be of the same samples, blocks and options")
        return state["generators"], state["energies"].tolist()

    def save(self, generators: NDArray[np.float64], energies: Sequence[float]) -> None:
        """Write the state, whole or not at all."""
        if self.path is not None:
            state = {"job": self.job, "generators": generators, "energies": np.array(energies, np.float64)}
            save_arrays(self.path, _KIND, state, overwrite=True)
