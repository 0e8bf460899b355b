"""Cells of points as convex polygons that fill a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Polygons = tuple[NDArray[np.float64], ...]


def triangle_polygons(points: NDArray[np.float64], triangles: NDArray[np.int32]) -> Polygons:
    """Return the corners of triangles, all in the sense of `power_cells`."""
    corners = points[triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turned = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    return tuple(triangle[:: -1 if flip else 1] for triangle, flip in zip(corners, turned, strict=True))
