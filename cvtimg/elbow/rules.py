"""Rules that find the elbow of a curve of energies.

A rule takes E(k) for k = 1, 2, ... and their scale, and returns k.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cvtimg._shared import pixels
from cvtimg._shared.types import Floats

#: The rules that look at the shape of a curve end at this number of generators, so that a longer one does not move it.
CHORD_ENDS = 32
#: At a clear elbow the power of k by which E falls is at least this multiple of the one after it, and log E is at least
#: this far below the chord. Of 360 clouds without clusters 4 have such powers, two of them at depths of .002 and .02;
#: of 234 known numbers of clusters 6 standard deviations apart, the least have 3.07 and .139.
_BEND, _DEPTH = 2.0, 0.1
#: Energies below this fraction of E(1) are treated as equal for samples that are not 8-bit colors.
_RELATIVE_FLOOR = 1e-3


class Scale(NamedTuple):
    """What energies are measured against."""

    n_values: float  # Number of samples times channels that the energy is summed over
    peak: float | None  # Value of white; None for samples without a PSNR

    def psnr(self, energies: Floats) -> Floats:
        """Return the peak signal-to-noise ratios in dB, infinite where the energy is 0."""
        peak = self.peak or np.nan
        if self.peak is None:
            raise ValueError("the rule 'psnr' needs colors in the space rgb: other samples have no peak")
        return pixels.psnr(energies / self.n_values, peak)

    def floor(self, energies: Floats) -> float:
        """Return the energy below which differences do not matter: that of rounding to 8 bits."""
        if self.peak is None:
            return float(_RELATIVE_FLOOR * energies[0])
        return self.n_values * (self.peak / 255) ** 2 / 12


def explained(energies: Floats) -> Floats:
    """Return the fraction of E(1) that k generators remove; 1 if there is nothing to explain."""
    return 1 - energies / energies[0] if energies[0] else np.ones(len(energies))


def judged(energies: Floats, scale: Scale) -> tuple[int, bool]:
    """Find the point farthest below the chord of log E over log k up to k = 32; also return whether it is clear."""
    # A small energy is added to each E.
    # Without clusters E(k) is proportional to k^(-2/D) whatever D is (P. Zador, IEEE Trans. Information Theory 28
    # (1982), doi 10.1109/TIT.1982.1056490), so that the powers before and after any k are equal.
    if energies[0] == 0:
        return 1, True
    known = energies[:CHORD_ENDS]
    if energies[-1] == 0:  # and so for every greater k
        known = np.append(known, np.zeros(CHORD_ENDS - len(known)))
    across, down = np.log(np.arange(1, len(known) + 1)), np.log(known + scale.floor(energies))
    k = _farthest(across, down)
    if not 1 < k < len(known):
        return min(k, len(energies)), False
    line = down[0] + (down[-1] - down[0]) * across[k - 1] / across[-1]
    powers = -np.diff(down[k - 2 : k + 1]) / np.diff(across[k - 2 : k + 1])
    clear = powers[0] >= _BEND * powers[1] and line - down[k - 1] >= _DEPTH
    return min(k, len(energies)), bool(clear)


def chord_linear(energies: Floats) -> int:
    """Find the point farthest below the chord of E over k up to k = 32."""
    known = energies[:CHORD_ENDS]
    return _farthest(np.arange(1.0, len(known) + 1), known)


def _farthest(across: Floats, down: Floats) -> int:
    """Return the k farthest below the line between the ends; the first or the last if none is below."""
    fall = down[0] - down[-1]
    if fall <= 0:
        return 1
    line = down[0] - fall * (across - across[0]) / (across[-1] - across[0])
    below = line - down
    return int(np.argmax(below)) + 1 if below.max() > 1e-12 * fall else len(down)


class TargetMissedError(ValueError):
    """No number of generators in the curve reaches the target of a rule."""


def _first_reaching(target: float, values: Floats, unit: str) -> int:
    reached = values >= target
    if not reached.any():
        last = f"n_max={len(values)} generators: {values[-1]:.4g} {unit}"
        raise TargetMissedError(f"target={target:g} is not reached by {last}")
    return int(np.argmax(reached)) + 1


#: The registry of rules: the values of `rule` and ``--rule``. Each takes energies (n_max,) and their scale.
RULES: dict[str, Callable[..., int]] = {
    "chord": lambda energies, scale: judged(energies, scale)[0],
    "variance": lambda energies, _, target=0.95: _first_reaching(
        target, explained(energies), "of the variance explained"
    ),
    "psnr": lambda energies, scale, target=30.0: _first_reaching(target, scale.psnr(energies), "dB"),
}
#: Rules that take a target.
TARGETED = ("variance", "psnr")
