"""Where a tree is cut by default: at the threshold of photographs, unless that shows nothing of what is in an image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: The best threshold for training pictures of the Berkeley Segmentation Data Set, against regions that people drew.
OF_PHOTOGRAPHS = 0.5
#: Noise stays below this.
_LEAST = 0.25
#: The threshold is lowered where borders above it have less than the first of these shares of the power of all, and
#: until they have the second. Training pictures have shares from 0.21 on, but for one, which is texture.
_HARDLY_ANY, _MOST = 0.15, 2 / 3
#: Leaves that explain less of the variance than this lie in noise or texture, where there are no faint regions to find.
_EXPLAINED = 2 / 3


def default_threshold(lengths: NDArray[np.int32], altitudes: NDArray[np.float64], explained: float) -> float:
    """Choose where to cut a tree.

    Many small or faint objects, such as nuclei in a micrograph, differ by less than regions of photographs do. Power is
    length times squared altitude.

    Parameters
    ----------
    lengths, altitudes : (B,) arrays
        Of the borders between leaves.
    explained : float
        Part of the variance of the image that the means of the leaves have.

    Returns
    -------
    float
    """
    order = np.argsort(-altitudes, kind="stable")
    power = np.cumsum(lengths[order] * altitudes[order] ** 2)
    if explained < _EXPLAINED or not len(power) or power[-1] <= 0:
        return OF_PHOTOGRAPHS
    n_above = np.count_nonzero(altitudes > OF_PHOTOGRAPHS)
    if n_above and power[n_above - 1] >= _HARDLY_ANY * power[-1]:
        return OF_PHOTOGRAPHS
    last = altitudes[order[np.searchsorted(power, _MOST * power[-1])]]
    return min(max(float(np.nextafter(last, 0)), _LEAST), OF_PHOTOGRAPHS)
