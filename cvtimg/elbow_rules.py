"""Where a curve of energies has its elbow: rules by name.

A rule sees E(k) for k = 1, 2, .. and what is needed to judge it, and returns k. `chord` is the default.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]

#: Where samples have no step, energies below this part of E(1) are not told apart.
_RELATIVE_FLOOR = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """What an energy is measured against.

    Attributes
    ----------
    n_values : float
        Samples times channels, of which the energy is the sum.
    peak : float or None
        The greatest value there can be, for the PSNR.
    step : float
        Distance of values that follow each other: 1 for integers, 0 for floating point.
    """

    n_values: float
    peak: float | None
    step: float

    def psnr(self, energies: _Floats) -> _Floats:
        """Peak signal-to-noise ratios in dB, infinite where the energy is 0."""
        if self.peak is None:
            raise ValueError("psnr needs colors of a picture: rows of a table have no peak")
        with np.errstate(divide="ignore"):
            ratios: _Floats = 10 * np.log10(self.peak**2 * self.n_values / energies)
        return ratios


def explained(energies: _Floats) -> _Floats:
    """Share of E(1) that k generators take away; 1 where there is nothing to explain."""
    return 1 - energies / energies[0] if energies[0] else np.ones(len(energies))


def chord(energies: _Floats, scale: Scale) -> int:
    """Farthest below the chord of log E over log k, with an energy that rounding alone would leave added to each."""
    floor = max(scale.n_values * scale.step**2 / 12, _RELATIVE_FLOOR * energies[0])
    return _farthest(np.log(np.arange(1, len(energies) + 1)), np.log(energies + floor))


def chord_linear(energies: _Floats, scale: Scale) -> int:
    """Farthest below the chord of E over k."""
    return _farthest(np.arange(1.0, len(energies) + 1), energies)


def kneedle(energies: _Floats, scale: Scale) -> int:
    """Kneedle of E over k: V. Satopaa and others, ICDCS Workshops 2011, doi 10.1109/ICDCSW.2011.20."""
    if len(energies) < 3:
        return len(energies)
    from kneed import KneeLocator

    numbers = np.arange(1, len(energies) + 1)
    knee = KneeLocator(numbers, energies, curve="convex", direction="decreasing").knee
    return int(knee) if knee is not None else chord_linear(energies, scale)


def variance(energies: _Floats, scale: Scale, share: float = 0.95) -> int:
    """Return the least k that explains this share of the variance, or the last k."""
    return _first(explained(energies) >= share)


def psnr(energies: _Floats, scale: Scale, target: float = 30.0) -> int:
    """Return the least k of this PSNR in dB, or the last k."""
    return _first(scale.psnr(energies) >= target)


#: From energies (n_max,) and their scale to k; a target where a rule has one.
Rule = Callable[..., int]

#: The registry: names for `rule` and ``--rule``.
RULES: dict[str, Rule] = {
    "chord": chord,
    "chord-linear": chord_linear,
    "kneedle": kneedle,
    "variance": variance,
    "psnr": psnr,
}


def _farthest(across: _Floats, down: _Floats) -> int:
    """Return the k farthest below the line between the ends; 1 where the curve does not fall."""
    fall = down[0] - down[-1]
    if len(down) < 3 or fall <= 0:
        return len(down) if fall > 0 else 1
    line = down[0] - fall * (across - across[0]) / (across[-1] - across[0])
    below = line - down
    return int(np.argmax(below)) + 1 if below.max() > 0 else len(down)


def _first(reached: NDArray[Any]) -> int:
    return int(np.argmax(reached)) + 1 if reached.any() else len(reached)
