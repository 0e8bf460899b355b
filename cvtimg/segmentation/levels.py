"""Samples as the smallest whole numbers that distinguish them, if they are evenly spaced.

An 8-bit image keeps its levels whatever type holds it: 16-bit integers 257 times as large, or floating point in 0..1.
Results computed from the levels are then identical to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_MOST_LEVELS = 65535
#: This many samples are tried before all are looked at.
_PROBES = 64
#: This many integers usually have the common divisor of all.
_SOME = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Samples are ``offset + step * levels``.

    Attributes
    ----------
    levels : array of uint8, uint16 or float32
        Whole numbers from 0 if samples are evenly spaced, otherwise numbers from 0 to 1.
    offset, step : float
        In the units of the samples.
    """

    levels: NDArray[Any]
    offset: float
    step: float


def to_levels(samples: NDArray[Any]) -> Levels:
    """Find the levels of finite samples: integers or floating point, of any shape, at least one."""
    low, high = samples.min().item(), samples.max().item()
    if low == high:
        return Levels(np.zeros(samples.shape, np.uint8), float(low), 1.0)
    if samples.dtype.kind in "iu" and (whole := _whole_levels(samples, low, high)):
        return whole
    span = float(high) - float(low)
    shares = (samples.astype(np.float64) - low) / span
    n_steps = 0
    if samples.dtype.kind == "f":
        n_steps = _even_steps(shares, 4 * float(np.finfo(samples.dtype).eps) * max(abs(low), abs(high)) / span)
    if n_steps == 0:
        return Levels(shares.astype(np.float32), float(low), span)
    return Levels(np.rint(shares * n_steps).astype(_type_for(n_steps)), float(low), span / n_steps)


def _whole_levels(samples: NDArray[Any], low: int, high: int) -> Levels | None:
    """Find the levels of integers in low..high; None if there are too many."""
    if high - low >= 1 << 63:  # beyond int64
        return None
    steps = samples if low == 0 else (samples.astype(np.int64) if low < 0 else samples) - low
    step = _step(steps.reshape(-1), high - low)
    if high - low > _MOST_LEVELS * step:
        return None
    levels = steps if step == 1 else steps // step
    return Levels(levels.astype(_type_for((high - low) // step), copy=False), float(low), float(step))


def _step(steps: NDArray[Any], most: int) -> int:
    """Return the greatest common divisor of integers in 0..most, which are not all 0."""
    step = int(np.gcd.reduce(steps[:: max(1, steps.size // _SOME)].astype(np.int64)))
    if step == 1:
        return step
    if most > _MOST_LEVELS:
        return int(np.gcd.reduce(steps))
    present = np.zeros(most + 1, bool)
    present[steps] = True
    return int(np.gcd.reduce(np.flatnonzero(present)))


def _type_for(largest: float) -> type[np.uint8] | type[np.uint16]:
    return np.uint8 if largest <= 255 else np.uint16


def _even_steps(shares: NDArray[np.float64], rounding: float) -> int:
    """Return in how many even steps from 0 to 1 all shares lie, but for rounding; 0 if in none."""
    flat = shares.reshape(-1)
    probes = flat[:: max(1, flat.size // _PROBES)]
    n_steps = 0
    # Probes may share a divisor that not all have: go on from there.
    while True:
        n_steps = _fitting(probes, rounding, n_steps + 1)
        if n_steps == 0:
            return 0
        apart = np.abs(flat * n_steps - np.rint(flat * n_steps)) > n_steps * rounding
        if not apart.any():
            return n_steps
        probes = np.append(probes, flat[np.argmax(apart)])


def _fitting(probes: NDArray[np.float64], rounding: float, first: int) -> int:
    """Return the smallest number of steps, from `first` on, that fits all probes; 0 if none does."""
    for start in range(first, _MOST_LEVELS + 1, 1024):
        steps = np.arange(start, min(start + 1024, _MOST_LEVELS + 1))
        steps = steps[steps * rounding < 0.05]
        at = steps[:, None] * probes
        fits = (np.abs(at - np.rint(at)) <= steps[:, None] * rounding).all(axis=1)
        if fits.any():
            return int(steps[np.argmax(fits)])
    return 0
