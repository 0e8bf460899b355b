"""What clipping takes away from noisy values near the ends of an integer type, and how to put it back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_stripes
from cvtimg.restoration.versions import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Clipped:
    """What clipping does to noisy values; arrays of the shape of the true ones."""

    added: Floats  # what it adds to their mean
    slope: Floats  # how much the mean of clipped values follows the true one: 1 far from the ends, 1/2 at an end
    variance: Floats  # variance that is left, as a share of that of the noise

    @classmethod
    def of(cls, true: Floats, sigma: Floats, white: float, ends: tuple[bool, bool] = (True, True)) -> Clipped:
        """Clip values to 0..white, or at one of these ends, with Gaussian noise of standard deviations `sigma` > 0."""
        from scipy.special import ndtr

        inside = np.clip(true, 0, white)
        added, slope, variance = np.zeros_like(inside), np.ones_like(inside), np.ones_like(inside)
        for is_clipped, sign, apart in zip(ends, (1, -1), (inside, white - inside), strict=True):
            if is_clipped:
                away = apart / sigma
                beyond, density = ndtr(-away), np.exp(-(away**2) / 2) / np.float32(np.sqrt(2 * np.pi))
                more = density - away * beyond
                added += sign * sigma * more
                slope -= beyond
                variance += (away**2 + 1) * (1 - beyond) + away * density - (away + more) ** 2 - 1
        return cls(added, slope, np.maximum(variance, np.float32(1e-6)))


def clipped_ends(
    values: Floats, known: NDArray[np.bool_], true: Floats, sigma: Floats, white: float
) -> tuple[bool, bool]:
    """Tell whether known values pile up at 0 and at `white` as Gaussian noise that is clipped there would."""
    from scipy.special import ndtr

    def piles_up(end: float) -> bool:
        def expected(rows: slice) -> float:
            away = np.abs(np.clip(true[rows], 0, white) - end) / sigma[rows]
            return float(ndtr(-away).sum(dtype=np.float64, where=known[rows]))

        n_there = int(np.count_nonzero((values == end) & known))
        return n_there > 0 and n_there >= sum(in_stripes(expected, len(values), work=32.0 * values.size)) / 2

    return piles_up(0.0), piles_up(white)
