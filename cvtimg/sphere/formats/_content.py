"""What writers of grids are given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class GridContent:
    """What files hold of a grid.

    Attributes
    ----------
    points : (N, 3) float64 array
        Unit vectors: the generators.
    triangles : (T, 3) int32 array
        Their Delaunay triangulation, counterclockwise from outside.
    areas : (N,) float64 array
        Of the Voronoi cells, on the unit sphere.
    density : (N,) float64 array
        The density at points, at most 1.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int32]
    areas: NDArray[np.float64]
    density: NDArray[np.float64]
