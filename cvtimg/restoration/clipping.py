"""What clipping takes away from noisy values near the ends of an integer type, and how to put it back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Floats

#: Points of the table for each standard deviation from an end, and the last point: from there on nothing is lost.
_PER_DEVIATION, _LAST = 512, 8 * 512


@dataclass(frozen=True, slots=True, eq=False)
class Clipped:
    """What clipping does to noisy values; arrays of the shape of the true ones."""

    added: Floats  # what it adds to their mean
    slope: Floats  # how much the mean of clipped values follows the true one: 1 far from the ends, 1/2 at an end
    variance: Floats  # variance that is left, as a share of that of the noise

    @classmethod
    def of(cls, true: Floats, sigma: float, white: float, ends: tuple[bool, bool] = (True, True)) -> Clipped:
        """Clip values to 0..white, or at one of these ends, with Gaussian noise of standard deviation `sigma` > 0."""
        inside = np.clip(true, 0, white)
        found = np.zeros_like(inside), np.ones_like(inside), np.ones_like(inside)
        for is_clipped, sign, apart in zip(ends, (1, -1), (inside, white - inside), strict=True):
            if is_clipped:
                place = _places(apart, sigma)
                added, slope_lost, variance_lost = _table()
                found[0][...] += sign * np.float32(sigma) * added[place]
                found[1][...] -= slope_lost[place]
                found[2][...] -= variance_lost[place]
        return cls(*found)


def _places(apart: Floats, sigma: float) -> NDArray[np.int32]:
    """Points of the table for values that are so far from an end."""
    return np.minimum(apart * np.float32(_PER_DEVIATION / sigma) + 0.5, _LAST).astype(np.int32)


@cache
def _table() -> Floats:
    """(3, P) what is added, and what of the slope and of the variance is lost, so far from the lower end."""
    from scipy.special import ndtr

    away = np.arange(_LAST + 1) / _PER_DEVIATION
    beyond, density = ndtr(-away), np.exp(-(away**2) / 2) / np.sqrt(2 * np.pi)
    added = density - away * beyond
    variance = (away**2 + 1) * (1 - beyond) + away * density - (away + added) ** 2
    return np.stack([added, beyond, 1 - variance]).astype(np.float32)


def clipped_ends(values: Floats, true: Floats, sigma: float, white: float) -> tuple[bool, bool]:
    """Tell whether values pile up at 0 and at `white` as Gaussian noise that is clipped there would."""
    _, beyond, _ = _table()

    def piles_up(end: float) -> bool:
        expected = beyond[_places(np.abs(np.clip(true, 0, white) - end), sigma)].sum(dtype=np.float64)
        return bool(np.count_nonzero(values == end) >= expected / 2)

    return piles_up(0.0), piles_up(white)
