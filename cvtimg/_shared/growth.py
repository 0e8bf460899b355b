"""Limits of the growth of sizes from pixel to pixel.

Two passes reach all where steps are alike everywhere: the best way from one pixel to another takes steps of two
neighboring directions only, in any order. G. Borgefors, Distance transformations in digital images, Computer Vision,
Graphics, and Image Processing 34 (1986) 344-371, doi 10.1016/S0734-189X(86)80047-0.
"""

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.types import Array

#: Sizes that fall by less than this part of them stay.
_ROUNDING = float(np.finfo(np.float32).resolution)


def limit_growth(sizes: Array, across: float, along: ArrayLike) -> None:
    """Lower sizes (H, W), in place, until they grow by no more than that from each pixel to the eight around it.

    They may grow by `across` to the next row and by `along`, (H,) or alike in all rows, to the next column.
    """
    height, width = sizes.shape
    steps = np.broadcast_to(along, height)
    number = np.arange(width)
    while True:
        before = sizes.copy()
        for rows in (range(height), range(height - 1, -1, -1)):
            least = np.full(width, np.inf)
            for row in rows:
                aslant, ramp = np.hypot(across, steps[row]), steps[row] * number
                wide = np.minimum(sizes[row], least + across)
                wide[1:] = np.minimum(wide[1:], least[:-1] + aslant)
                wide[:-1] = np.minimum(wide[:-1], least[1:] + aslant)
                after = np.minimum.accumulate(wide - ramp) + 2 * ramp
                least = np.minimum.accumulate(after[::-1])[::-1] - ramp
                sizes[row] = least
        if np.ndim(along) == 0 or np.allclose(sizes, before, _ROUNDING, 0):
            return
