"""Masks for ordered dithering: small squares of turns that repeat over the image."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@cache
def bayer_mask(side: int) -> NDArray[np.uint8]:
    """Return the (side, side) Bayer matrix; the side is a power of two up to 16.

    B. E. Bayer, "An optimum method for two-level rendition of continuous-tone pictures", IEEE International Conference
    on Communications 1 (1973) 26.11-26.15.

    Examples
    --------
    >>> bayer_mask(4).tolist()
    [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]
    """
    mask = np.zeros((1, 1), np.int64)
    while len(mask) < side:
        mask = np.block([[4 * mask, 4 * mask + 2], [4 * mask + 3, 4 * mask + 1]])
    return mask.astype(np.uint8)


@cache
def blue_noise_mask() -> NDArray[np.uint8]:
    """Return a (64, 64) mask of 16 turns without low frequencies, made by ``docs/make_blue_noise.py``."""
    mask = np.load(Path(__file__).parent / "blue_noise.npy")
    turns: NDArray[np.uint8] = (mask.astype(np.int64) * 16 // mask.size).astype(np.uint8)
    return turns
