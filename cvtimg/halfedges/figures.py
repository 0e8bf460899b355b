"""How good triangles are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_places, check_shape, check_triangles

Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class TriangleMeasures:
    """Measures of each of T triangles.

    Attributes
    ----------
    areas : (T,) float64 array
    least_angles, largest_angles : (T,) float64 arrays
        In degrees.
    circumradii : (T,) float64 array
    qualities : (T,) float64 array
        2 r / R, from 0 for triangles without area to 1 for equilateral ones.
    """

    areas: Values
    least_angles: Values
    largest_angles: Values
    circumradii: Values
    qualities: Values


def measure_triangles(points: ArrayLike, triangles: ArrayLike) -> TriangleMeasures:
    """Measure each triangle.

    Parameters
    ----------
    points : (N, 2) or (N, 3) array
    triangles : (T, 3) integer array
        Indices of points, in either direction.

    Returns
    -------
    TriangleMeasures

    Examples
    --------
    >>> from cvtimg.meshes import measure_triangles
    >>> measures = measure_triangles([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])
    >>> measures.areas.tolist(), measures.least_angles.round(9).tolist()
    ([0.5], [45.0])
    """
    places = check_places("points", points)
    check_shape("points", places.shape, places.shape[1] in (2, 3), "(N, 2) or (N, 3), a place in each row")
    corners = check_triangles("triangles", triangles, len(places))
    a, b, c = (places[corners[:, k]] for k in range(3))
    sides = np.sort(
        [np.linalg.norm(c - b, axis=1), np.linalg.norm(a - c, axis=1), np.linalg.norm(b - a, axis=1)], axis=0
    )
    areas = twice_areas(b - a, c - a) / 2
    short, middle, long = sides
    with np.errstate(divide="ignore", invalid="ignore"):
        circumradii = np.where(areas > 0, short * middle * long / (4 * areas), np.inf)
        inradii = 2 * areas / (short + middle + long)
        qualities = np.where(areas > 0, 2 * inradii / circumradii, 0.0)
    # Tangents are exact for narrow angles, and for wide ones, too.
    least = np.degrees(np.arctan2(4 * areas, middle**2 + long**2 - short**2))
    largest = np.degrees(np.arctan2(4 * areas, short**2 + middle**2 - long**2))
    return TriangleMeasures(areas, least, largest, circumradii, qualities)


def twice_areas(u: Values, v: Values) -> Values:
    """Area of each parallelogram with sides u and v, (T, 2) or (T, 3)."""
    if u.shape[1] == 2:
        return np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    return np.linalg.norm(np.cross(u, v), axis=1)
