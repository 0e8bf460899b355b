"""Images that several tests look at: one of each kind of sample."""

from __future__ import annotations

import numpy as np

_RNG = np.random.default_rng(5)
GREY = _RNG.integers(0, 256, (5, 7), np.uint8)
RGB = _RNG.integers(0, 256, (5, 7, 3), np.uint8)
RGBA = _RNG.integers(0, 256, (5, 7, 4), np.uint8)
BITS = _RNG.integers(0, 2, (5, 7)).astype(bool)
DEEP = _RNG.integers(0, 65536, (5, 7), np.uint16)
DEEP_RGB = _RNG.integers(0, 65536, (5, 7, 3), np.uint16)
DEEP_RGBA = _RNG.integers(0, 65536, (5, 7, 4), np.uint16)
