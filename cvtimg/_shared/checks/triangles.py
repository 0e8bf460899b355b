"""Checks of triangles and of what their vertices are given by."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks.tables import check_shape, check_within
from cvtimg._shared.checks.values import check_that, refuse_type


def check_triangles(name: str, triangles: ArrayLike, n_points: int) -> NDArray[np.int32]:
    """Return triangles as a (T, 3) int32 array of indices of points, T >= 1."""
    corners = np.asarray(triangles)
    check_shape(name, corners.shape, corners.ndim == 2 and corners.shape[1] == 3 and len(corners) > 0, "(T, 3), T >= 1")
    if corners.dtype.kind not in "iu":
        refuse_type(name, corners.dtype, "integers")
    check_within(name, corners, 0, n_points - 1, ", as the points")
    return corners.astype(np.int32, copy=False)


def check_have_area(name: str, areas: NDArray[np.float64]) -> None:
    """Refuse triangles without area; the areas (T,) may have a sign."""
    flat = np.flatnonzero(areas == 0)
    check_that(f"{name}[{flat[0] if len(flat) else 0}]", not len(flat), "have an area > 0")
