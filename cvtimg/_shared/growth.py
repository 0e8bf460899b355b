"""Limits of the growth of sizes from pixel to pixel.

Two passes reach all where steps are alike everywhere: the best way from one pixel to another takes steps of two
neighboring directions only, in any order. G. Borgefors, Distance transformations in digital images, Computer Vision,
Graphics, and Image Processing 34 (1986) 344-371, doi 10.1016/S0734-189X(86)80047-0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Sizes that fall by less than this part of them stay: that is the rounding of single precision.
_ROUNDING = 1e-6


def limit_growth(sizes: NDArray[Any], across: float, along: ArrayLike, *, around: bool = False) -> None:
    """Lower sizes (H, W), in place, until they grow by no more than that from each pixel to the eight around it.

    They may grow by `across` to the next row and by `along`, (H,) or alike in all rows, to the next column; the first
    column follows the last one if the picture goes `around`.
    """
    height, width = sizes.shape
    steps = np.broadcast_to(along, height)
    pad = width if around else 1
    number = np.arange(width + 2 * pad)
    mode: Any = "wrap" if around else "edge"
    changed = True
    while changed:
        changed = False
        for rows in (range(height), range(height - 1, -1, -1)):
            least = np.full(len(number), np.inf)
            for row in rows:
                beside = np.minimum(least[:-2], least[2:]) + np.hypot(across, steps[row])
                wide = np.pad(sizes[row].astype(np.float64), pad, mode=mode)
                wide = np.minimum(wide, least + across)
                wide[1:-1] = np.minimum(wide[1:-1], beside)
                ramp = steps[row] * number
                after = np.minimum.accumulate(wide - ramp) + ramp
                before = np.minimum.accumulate((wide + ramp)[::-1])[::-1] - ramp
                least = np.pad(np.minimum(after, before)[pad:-pad], pad, mode=mode)
                changed |= bool((least[pad:-pad] < (1 - _ROUNDING) * sizes[row]).any())
                sizes[row] = least[pad:-pad]
