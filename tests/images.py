"""Images that several tests look at: one of each kind of sample, and clean ones with noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_RNG = np.random.default_rng(5)
GREY = _RNG.integers(0, 256, (5, 7), np.uint8)
RGB = _RNG.integers(0, 256, (5, 7, 3), np.uint8)
RGBA = _RNG.integers(0, 256, (5, 7, 4), np.uint8)
BITS = _RNG.integers(0, 2, (5, 7)).astype(bool)
DEEP = _RNG.integers(0, 65536, (5, 7), np.uint16)
DEEP_RGB = _RNG.integers(0, 65536, (5, 7, 3), np.uint16)
DEEP_RGBA = _RNG.integers(0, 65536, (5, 7, 4), np.uint16)


def noisy(clean: NDArray[Any], sigma: Any, seed: int = 0, dtype: type | None = np.uint8) -> NDArray[Any]:
    """Add white noise to levels of 8 bits, or without a type to any."""
    found = clean + np.random.default_rng(seed).normal(0, 1, clean.shape) * sigma
    return found if dtype is None else np.rint(found).clip(0, 255).astype(dtype)
