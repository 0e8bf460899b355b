"""Images that several tests look at: one of each kind of sample."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter

from cvtimg._shared.types import Ints, Ints64

_RNG = np.random.default_rng(5)
GREY = _RNG.integers(0, 256, (5, 7), np.uint8)
RGB = _RNG.integers(0, 256, (5, 7, 3), np.uint8)
RGBA = _RNG.integers(0, 256, (5, 7, 4), np.uint8)
BITS = _RNG.integers(0, 2, (5, 7)).astype(bool)
DEEP = _RNG.integers(0, 65536, (5, 7), np.uint16)
DEEP_RGB = _RNG.integers(0, 65536, (5, 7, 3), np.uint16)
DEEP_RGBA = _RNG.integers(0, 65536, (5, 7, 4), np.uint16)


def blobs(seed: int, shape: tuple[int, int] = (160, 160), n_labels: int = 3, spread: float = 6.0) -> Ints64:
    """Draw labels of smoothed noise, from 1: any number of pieces each, which meet in threes."""
    fields = np.random.default_rng(seed).normal(size=(n_labels, *shape))
    return 1 + gaussian_filter(fields, (0, spread, spread)).argmax(axis=0)


def discs(places: Sequence[tuple[float, float, float]], shape: tuple[int, int]) -> Ints:
    """Label the pixels of discs, given as (y, x, radius), from 1; where two meet, by what is nearer in radii."""
    down, right = np.indices(shape)
    away = np.stack([np.hypot(down - y, right - x) / radius for y, x, radius in places])
    return np.where(away.min(axis=0) < 1, away.argmin(axis=0) + 1, 0).astype(np.int32)
