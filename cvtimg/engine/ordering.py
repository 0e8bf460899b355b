"""The order of samples along a curve that fills their space, so that near ones follow each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: A key of 64 bits has 16 for each of so many channels.
MAX_ORDERED_DIMS = 4
#: Shifts and masks that bring three zeros between the bits of a 16-bit number.
_SPREAD_BY_4 = ((24, 0x000000FF000000FF), (12, 0x000F000F000F000F), (6, 0x0303030303030303), (3, 0x1111111111111111))


def along_curve(colors: NDArray[Any]) -> NDArray[np.intp]:
    """Return the order of (M, D <= 4) colors along a Morton curve over their range, in steps of a 2^16th part of it."""
    low, high = float(colors.min()), float(colors.max())
    scale = 65535 / (high - low) if high > low else 0.0
    keys = np.zeros(len(colors), np.uint64)
    for dim in range(colors.shape[1]):
        level = ((colors[:, dim].astype(np.float64) - low) * scale).astype(np.uint64)
        for shift, mask in _SPREAD_BY_4:
            level = (level | level << np.uint64(shift)) & np.uint64(mask)
        keys |= level << np.uint64(dim)
    return np.argsort(keys, kind="stable")
