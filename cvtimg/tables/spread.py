"""The spread of rows of a table, and columns that are scaled by it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """Scales columns to mean 0 and variance 1, and back to their own units."""

    means: NDArray[np.float64]  # (D,) weighted
    deviations: NDArray[np.float64]  # (D,) weighted; 1 for constant columns

    def apply(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standardize rows."""
        return (rows - self.means) / self.deviations

    def undo(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert standardized rows back to their own units."""
        return rows * self.deviations + self.means


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Sums over rows: mass, (D,) means and sums of weight times squared distance to them, and (D,) limits."""

    mass: float
    means: NDArray[np.float64]
    squares: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @classmethod
    def of(cls, rows: NDArray[Any], weights: NDArray[np.float64] | None = None) -> Spread:
        """Measure (N, D) rows of positive weight, 1 by default."""
        weights = np.ones(len(rows)) if weights is None else weights
        rows, weights = rows[weights > 0].astype(np.float64), weights[weights > 0]
        n_dims = rows.shape[1]
        if not len(rows):
            return cls(0.0, np.zeros(n_dims), np.zeros(n_dims), np.full(n_dims, np.inf), np.full(n_dims, -np.inf))
        means = np.average(rows, axis=0, weights=weights)
        squares = np.einsum("n,nd->d", weights, (rows - means) ** 2)
        return cls(float(weights.sum()), means, squares, rows.min(axis=0), rows.max(axis=0))

    @staticmethod
    def total(parts: Sequence[Spread]) -> Spread:
        """Join the spreads of parts of the rows."""
        full = [part for part in parts if part.mass] or list(parts[:1])
        masses = np.array([part.mass for part in full])
        all_means = np.stack([part.means for part in full])
        means = np.average(all_means, axis=0, weights=masses) if masses.any() else all_means[0]
        squares = np.sum([part.squares for part in full], axis=0) + masses @ (all_means - means) ** 2
        low, high = (np.stack([getattr(part, limit) for part in full]) for limit in ("low", "high"))
        return Spread(float(masses.sum()), means, squares, low.min(axis=0), high.max(axis=0))

    @property
    def scaling(self) -> Scaling:
        """Scales columns to mean 0 and variance 1."""
        deviations = np.sqrt(self.squares / self.mass)
        return Scaling(self.means, np.where((self.low == self.high) | (deviations == 0), 1.0, deviations))

    def energy(self, scaling: Scaling | None = None) -> float:
        """Return the sum of weight times squared distance to the mean: the energy of a single generator."""
        return float((self.squares if scaling is None else self.squares / scaling.deviations**2).sum())
