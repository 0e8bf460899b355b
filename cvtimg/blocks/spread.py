"""The spread of rows, and columns that are scaled by it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cvtimg._shared.types import Array, Floats


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """Scales columns to mean 0 and variance 1, and back to their own units."""

    means: Floats  # (D,) weighted
    deviations: Floats  # (D,) weighted; 1 for constant columns

    def apply(self, rows: Floats) -> Floats:
        """Standardize rows."""
        return (rows - self.means) / self.deviations

    def undo(self, rows: Floats) -> Floats:
        """Convert standardized rows back to their own units."""
        return rows * self.deviations + self.means


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Sums over rows: mass, (D,) means, sums of weight times squared distance to them; and limits of all rows."""

    mass: float
    means: Floats
    squares: Floats
    low: Array
    high: Array

    @classmethod
    def of(cls, rows: Array, weights: Floats | None = None) -> Spread:
        """Measure (N, D) rows with weights >= 0, 1 by default."""
        weights = np.ones(len(rows)) if weights is None else weights
        none = np.full(rows.shape[1], np.inf)
        low, high = (rows.min(axis=0), rows.max(axis=0)) if len(rows) else (none, -none)
        rows, weights = rows[weights > 0].astype(np.float64), weights[weights > 0]
        mass = float(weights.sum())
        means = np.einsum("n,nd->d", weights, rows) / (mass or 1.0)
        return cls(mass, means, np.einsum("n,nd->d", weights, (rows - means) ** 2), low, high)

    @staticmethod
    def total(parts: Sequence[Spread]) -> Spread:
        """Join the spreads of parts of the rows."""
        names = ("mass", "means", "squares", "low", "high")
        masses, means, squares, low, high = (np.stack([getattr(part, name) for part in parts]) for name in names)
        mean = np.einsum("p,pd->d", masses, means) / (masses.sum() or 1.0)
        between = np.einsum("p,pd->d", masses, (means - mean) ** 2)
        return Spread(float(masses.sum()), mean, squares.sum(axis=0) + between, low.min(axis=0), high.max(axis=0))

    @property
    def scaling(self) -> Scaling:
        """Scales columns to mean 0 and variance 1."""
        deviations = np.sqrt(self.squares / self.mass)
        rounding = 8 * np.finfo(np.float64).eps * np.abs(self.means)
        return Scaling(self.means, np.where(deviations > rounding, deviations, 1.0))

    def energy(self, scaling: Scaling | None = None) -> float:
        """Return the sum of weight times squared distance to the mean: the energy of a single generator."""
        return float((self.squares if scaling is None else self.squares / scaling.deviations**2).sum())
