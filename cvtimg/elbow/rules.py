"""Where a curve of energies has its elbow: rules by name.

A rule sees E(k) for k = 1, 2, .. and what is needed to judge it, and returns k. `chord` is the default.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.colors import fidelity

_Floats = NDArray[np.float64]

#: The chord spans these numbers of generators, so that no longer curve moves the elbow.
CHORD_ENDS = 32
#: Energies below this part of E(1) are not told apart where there are no colors that 8 bits would round.
_RELATIVE_FLOOR = 1e-3


@dataclass(frozen=True, slots=True)
class Scale:
    """What an energy is measured against.

    Attributes
    ----------
    n_values : float
        Samples times channels, of which the energy is the sum.
    peak : float or None
        The greatest value of a color; None for what has no PSNR.
    """

    n_values: float
    peak: float | None

    def psnr(self, energies: _Floats) -> _Floats:
        """Peak signal-to-noise ratios in dB, infinite where the energy is 0."""
        if self.peak is None:
            raise ValueError("rule='psnr' needs colors in the space rgb: other samples have no peak")
        ratios: _Floats = fidelity.psnr(energies / self.n_values, self.peak)
        return ratios

    def floor(self, energies: _Floats) -> float:
        """Return the energy below which differences are of no interest: what rounding to 8 bits leaves."""
        if self.peak is None:
            return float(_RELATIVE_FLOOR * energies[0])
        return self.n_values * (self.peak / 255) ** 2 / 12


def explained(energies: _Floats) -> _Floats:
    """Share of E(1) that k generators take away; 1 where there is nothing to explain."""
    return 1 - energies / energies[0] if energies[0] else np.ones(len(energies))


def chord(energies: _Floats, scale: Scale) -> int:
    """Farthest below the chord of log E over log k, up to k = 32, with the same small energy added to each E."""
    if energies[0] == 0:
        return 1
    known = energies[:CHORD_ENDS]
    if energies[-1] == 0:  # and so for every greater k
        known = np.append(known, np.zeros(CHORD_ENDS - len(known)))
    return min(_farthest(np.log(np.arange(1, len(known) + 1)), np.log(known + scale.floor(energies))), len(energies))


def chord_linear(energies: _Floats, scale: Scale) -> int:
    """Farthest below the chord of E over k."""
    return _farthest(np.arange(1.0, len(energies) + 1), energies)


def kneedle(energies: _Floats, scale: Scale) -> int:
    """Kneedle of E over k, by the package kneed; where it finds no knee, the chord of E over k."""
    if len(energies) < 3 or energies[-1] == energies[0]:
        return chord_linear(energies, scale)
    from kneed import KneeLocator

    numbers = np.arange(1, len(energies) + 1)
    knee = KneeLocator(numbers, energies, curve="convex", direction="decreasing").knee
    return int(knee) if knee is not None else chord_linear(energies, scale)


def variance(energies: _Floats, scale: Scale, target: float = 0.95) -> int:
    """Return the least k that explains this share of the variance, or the last k."""
    return _first(explained(energies) >= target)


def psnr(energies: _Floats, scale: Scale, target: float = 30.0) -> int:
    """Return the least k of this PSNR in dB, or the last k."""
    return _first(scale.psnr(energies) >= target)


#: The registry: names for `rule` and ``--rule``, each from energies (n_max,) and their scale to k.
RULES: dict[str, Callable[..., int]] = {
    "chord": chord,
    "chord-linear": chord_linear,
    "kneedle": kneedle,
    "variance": variance,
    "psnr": psnr,
}
#: Those that take a target.
TARGETED = ("variance", "psnr")


def _farthest(across: _Floats, down: _Floats) -> int:
    """Return the k farthest below the line between the ends; the first or the last where none is below."""
    fall = down[0] - down[-1]
    if fall <= 0:
        return 1
    line = down[0] - fall * (across - across[0]) / (across[-1] - across[0])
    below = line - down
    return int(np.argmax(below)) + 1 if below.max() > 1e-12 * fall else len(down)


def _first(reached: NDArray[np.bool_]) -> int:
    return int(np.argmax(reached)) + 1 if reached.any() else len(reached)
