"""The state of a long descent in a file, so that a run that was cut off goes on where it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg.files.whole import StrPath, whole_file


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A file with generators, and the energies that led to them.

    Attributes
    ----------
    path : path or None
        The file; None to save nothing.
    job : str
        Names the samples and the options. The state of another job is refused.
    """

    path: StrPath | None
    job: str

    def load(self) -> tuple[NDArray[np.float64], list[float]] | None:
        """Return what was saved, or None if there is no file.

        Raises
        ------
        ValueError
            If the file is of another job, or no checkpoint.
        """
        if self.path is None or not Path(self.path).exists():
            return None
        try:
            with np.load(self.path) as saved:
                state: dict[str, Any] = dict(saved)
        except (ValueError, EOFError, BadZipFile, AttributeError):
            state = {}
        check_that(f"checkpoint={str(self.path)!r}", "job" in state, "be a file that an earlier run saved")
        same = str(state["job"]) == self.job
        check_that(f"checkpoint={str(self.path)!r}", same, "be of the same samples, blocks and options")
        return state["generators"], state["energies"].tolist()

    def save(self, generators: NDArray[np.float64], energies: Sequence[float]) -> None:
        """Write the state, whole or not at all."""
        if self.path is not None:
            with whole_file(self.path, overwrite=True) as file:
                np.savez(file, job=self.job, generators=generators, energies=np.array(energies, np.float64))
