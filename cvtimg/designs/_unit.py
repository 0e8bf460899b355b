"""Points in the unit cube, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_rows, check_within


def check_unit_points(name: str, points: ArrayLike) -> NDArray[np.float64]:
    """Return `points` as an (n, d) float64 array in the unit cube."""
    array = check_rows(name, points).astype(np.float64)
    check_within(name, array, 0, 1, ", the unit cube")
    return array
