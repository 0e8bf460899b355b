"""Samples and their density: what the engine tessellates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class WeightedSamples:
    """Samples and their density.

    Attributes
    ----------
    rows : (M, D) array
        A sample in each row: uint8, uint16, float32 or float64.
    density : (M,) float64 array
        The weight of each sample, >= 0.
    in_order : bool
        Whether samples that follow each other are near each other.
    """

    rows: NDArray[Any]
    density: NDArray[np.float64]
    in_order: bool

    def __post_init__(self) -> None:
        for array in (self.rows, self.density):
            array.flags.writeable = False

    @property
    def n_samples(self) -> int:
        """Number of samples, M."""
        return len(self.rows)
