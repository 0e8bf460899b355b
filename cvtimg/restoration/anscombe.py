"""Levels bent so that noise whose variance follows them is even: the generalized Anscombe transform.

M. Makitalo and A. Foi, IEEE Trans. Image Processing 22 (2013) 91-103, doi 10.1109/TIP.2012.2202675. The inverse is that
of the mean of bent values, which is not the bent mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Doubles = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """Levels from `low` to `high` that are bent so that noise is even; they keep their ends."""

    constant: _Doubles  # (C,) and (C,): variance of noise = constant + slope x level, in any unit
    slope: _Doubles
    low: float
    high: float

    @classmethod
    def between(cls, first: _Doubles, last: _Doubles, low: float, high: float) -> Bend:
        """Make it from the (C,) variances at both ends."""
        rise = np.where(np.abs(last - first) < 1e-3 * first, 1e-3 * first, last - first)  # it is divided by the slope
        slope = rise / (high - low)
        return cls(first - slope * low, slope, low, high)

    @property
    def _roots(self) -> tuple[_Doubles, _Doubles, _Doubles]:
        """(C,) standard deviation at the low and at the high end, and what noise of one is bent to."""
        first, last = (np.sqrt(self.variance(np.full(len(self.slope), end))) for end in (self.low, self.high))
        return first, last, (first + last) / 2

    def lines(self, variance: float) -> _Doubles:
        """(C, 2) constant and slope of the variance of noise that has this variance once it is bent."""
        return np.stack([self.constant, self.slope], axis=1) * (variance / self._roots[2] ** 2)[:, None]

    def unit(self, values: NDArray[np.float32]) -> float:
        """Root mean square noise at levels, (..., C), for noise of one once they are bent."""
        return float(np.sqrt(np.mean(self.variance(values) / self._roots[2] ** 2)))

    def variance(self, level: NDArray[Any]) -> NDArray[Any]:
        """(..., C) variance of noise at a level, (..., C)."""
        return self.constant + self.slope * np.clip(level, self.low, self.high)

    def bent(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """(..., C) values with even noise."""
        constant, slope, first, _, scale = (one.astype(np.float32) for one in (self.constant, self.slope, *self._roots))
        inside = np.clip(values, self.low, self.high)
        root = np.sqrt(constant + slope * inside)
        return np.asarray(self.low + scale * (2 / slope * (root - first) + (values - inside) / root), np.float32)

    def straight(self, bent: NDArray[Any]) -> NDArray[Any]:
        """(..., C) levels whose noisy values have these means once they are bent."""
        first, last, scale = self._roots
        means = (bent - self.low) / scale
        ends = -self.slope / (4 * first), 2 / self.slope * (last - first) - self.slope / (4 * last)
        inside = np.clip(means, *ends)
        root = first + self.slope * inside / 2
        root = (root + np.sqrt(root**2 + self.slope**2 / 2)) / 2
        levels = self.low + (root**2 - first**2) / self.slope + (means - inside) * root
        return levels.astype(bent.dtype, copy=False)
