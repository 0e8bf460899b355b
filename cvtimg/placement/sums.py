"""Sums over cells, given by the label of each part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def sum_by_cell(labels: NDArray[np.intp], values: NDArray[np.float64], n_cells: int) -> NDArray[np.float64]:
    """Sum values (M,) or (M, P) over the cells of their labels (M,): (K,) or (K, P)."""
    if values.ndim == 1:
        return np.asarray(np.bincount(labels, values, n_cells), np.float64)
    return np.stack([np.asarray(np.bincount(labels, each, n_cells), np.float64) for each in values.T], axis=1)


def by_mass(values: NDArray[np.float64], masses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide (K, P) sums by (K,) masses; 0 where there is none."""
    has_mass = masses[:, None] > 0
    return np.divide(values, masses[:, None], out=np.zeros_like(values), where=has_mass)
