"""What files hold of a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class GridContent:
    """A grid of the sphere, as it goes into a file.

    Attributes
    ----------
    points : (N, 3) float64 array
        Generators, unit vectors.
    triangles : (T, 3) int32 array
        Indices of points, counterclockwise as seen from outside.
    density : (N,) float64 array
        At the generators.
    radius : float
        Of the sphere in the file; lengths and areas are in its unit.
    """

    points: Values
    triangles: NDArray[np.int32]
    density: Values
    radius: float
