"""Rules that find the elbow of a curve of energies.

A rule takes E(k) for k = 1, 2, ... and their scale, and returns k. `chord` is the default.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.extras import optional
from cvtimg.colors import fidelity

_Floats = NDArray[np.float64]

#: The rules that look at the shape of a curve end at this number of generators, so that a longer one does not move it.
CHORD_ENDS = 32
#: Energies below this fraction of E(1) are treated as equal for samples that are not 8-bit colors.
_RELATIVE_FLOOR = 1e-3


class Scale(NamedTuple):
    """What energies are measured against."""

    n_values: float  # Number of samples times channels that the energy is summed over
    peak: float | None  # Value of white; None for samples without a PSNR

    def psnr(self, energies: _Floats) -> _Floats:
        """Return the peak signal-to-noise ratios in dB, infinite where the energy is 0."""
        peak = self.peak or np.nan
        if self.peak is None:
            raise ValueError("the rule 'psnr' needs colors in the space rgb: other samples have no peak")
        return fidelity.psnr(energies / self.n_values, peak)

    def floor(self, energies: _Floats) -> float:
        """Return the energy below which differences do not matter: that of rounding to 8 bits."""
        if self.peak is None:
            return float(_RELATIVE_FLOOR * energies[0])
        return self.n_values * (self.peak / 255) ** 2 / 12


def explained(energies: _Floats) -> _Floats:
    """Return the fraction of E(1) that k generators remove; 1 if there is nothing to explain."""
    return 1 - energies / energies[0] if energies[0] else np.ones(len(energies))


def chord(energies: _Floats, scale: Scale) -> int:
    """Find the point farthest below the chord of log E over log k up to k = 32; a small energy is added to each E."""
    if energies[0] == 0:
        return 1
    known = energies[:CHORD_ENDS]
    if energies[-1] == 0:  # and so for every greater k
        known = np.append(known, np.zeros(CHORD_ENDS - len(known)))
    return min(_farthest(np.log(np.arange(1, len(known) + 1)), np.log(known + scale.floor(energies))), len(energies))


def chord_linear(energies: _Floats, scale: Scale) -> int:
    """Find the point farthest below the chord of E over k up to k = 32."""
    known = energies[:CHORD_ENDS]
    return _farthest(np.arange(1.0, len(known) + 1), known)


def kneedle(energies: _Floats, scale: Scale) -> int:
    """Apply Kneedle to E over k up to k = 32, by the package kneed; if it finds no knee, use the chord of E over k."""
    known = energies[:CHORD_ENDS]
    if len(known) < 3 or known[-1] == known[0]:
        return chord_linear(known, scale)
    kneed = optional("kneed", "kneedle", "rule='kneedle' needs")
    knee = kneed.KneeLocator(np.arange(1, len(known) + 1), known, curve="convex", direction="decreasing").knee
    return int(knee) if knee is not None else chord_linear(energies, scale)


def variance(energies: _Floats, scale: Scale, target: float = 0.95) -> int:
    """Return the smallest k that explains this fraction of the variance."""
    return _first_reaching(target, explained(energies), "of the variance explained")


def psnr(energies: _Floats, scale: Scale, target: float = 30.0) -> int:
    """Return the smallest k of this PSNR in dB."""
    return _first_reaching(target, scale.psnr(energies), "dB")


#: The registry of rules: the values of `rule` and ``--rule``. Each takes energies (n_max,) and their scale.
RULES: dict[str, Callable[..., int]] = {
    "chord": chord,
    "chord-linear": chord_linear,
    "kneedle": kneedle,
    "variance": variance,
    "psnr": psnr,
}
#: Rules that take a target.
TARGETED = ("variance", "psnr")


def _farthest(across: _Floats, down: _Floats) -> int:
    """Return the k farthest below the line between the ends; the first or the last if none is below."""
    fall = down[0] - down[-1]
    if fall <= 0:
        return 1
    line = down[0] - fall * (across - across[0]) / (across[-1] - across[0])
    below = line - down
    return int(np.argmax(below)) + 1 if below.max() > 1e-12 * fall else len(down)


class TargetMissedError(ValueError):
    """No number of generators in the curve reaches the target of a rule."""


def _first_reaching(target: float, values: _Floats, unit: str) -> int:
    reached = values >= target
    if not reached.any():
        raise TargetMissedError(
            f"target={target:g} is not reached by n_max={len(values)} generators: {values[-1]:.4g} {unit}"
        )
    return int(np.argmax(reached)) + 1
