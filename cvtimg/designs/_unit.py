"""Points in the unit cube, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_rows


def check_unit_points(name: str, points: ArrayLike) -> NDArray[np.float64]:
    """Return `points` as an (n, d) float64 array in the unit cube."""
    array = check_rows(name, points).astype(np.float64)
    if array.min() < 0 or array.max() > 1:
        raise ValueError(f"{name} in {array.min():g}..{array.max():g} must be in 0..1, the unit cube")
    return array
