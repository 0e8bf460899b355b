"""Weighted samples: what the engine tessellates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.records import ReadOnly


@dataclass(frozen=True, slots=True, eq=False)
class WeightedSamples(ReadOnly):
    """Samples and their weights.

    Attributes
    ----------
    rows : (M, D) array
        One sample per row: uint8, uint16, float32 or float64.
    density : (M,) float64 array
        The weight of each sample, >= 0.
    in_order : bool
        Whether consecutive samples are near each other, which makes computations faster.
    """

    rows: NDArray[Any]
    density: NDArray[np.float64]
    in_order: bool

    def __repr__(self) -> str:
        """Tell size and type in one line."""
        n_samples, n_dims = self.rows.shape
        return f"{type(self).__name__}({n_samples} x {n_dims} {self.rows.dtype}, mass {self.density.sum():g})"

    @property
    def n_samples(self) -> int:
        """Number of samples, M."""
        return len(self.rows)
