"""How good points on a surface are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_places, check_triangles
from cvtimg.halfedges import measure_triangles


@dataclass(frozen=True, slots=True)
class SurfaceMeasures:
    """Measures of triangles on a surface.

    Attributes
    ----------
    least_angle, largest_angle : float
        In degrees; 60 for equilateral triangles.
    n_obtuse : int
        Triangles with an angle above 90 degrees.
    least_quality, mean_quality : float
        2 r / R of triangles, for the radii of incircle and circumcircle; 1 if they are equilateral.
    below_30 : float
        Share of the triangles with an angle below 30 degrees.
    euler_characteristic : int
        Vertices minus edges plus triangles: 2 for a sphere, 0 for a torus.
    is_closed : bool
        Whether there is no boundary.
    """

    least_angle: float
    largest_angle: float
    n_obtuse: int
    least_quality: float
    mean_quality: float
    below_30: float
    euler_characteristic: int
    is_closed: bool


def measure_surface(points: ArrayLike, triangles: ArrayLike) -> SurfaceMeasures:
    """Measure any triangulation of a surface.

    Parameters
    ----------
    points : (N, 3) array
    triangles : (T, 3) integer array
        Indices of points.

    Returns
    -------
    SurfaceMeasures

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.surfaces import measure_surface
    >>> tetrahedron = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    >>> measures = measure_surface(tetrahedron, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    >>> round(measures.least_angle, 9), measures.euler_characteristic, measures.is_closed
    (60.0, 2, True)
    """
    places = check_places("points", points, 3)
    corners = check_triangles("triangles", triangles, len(places))
    each = measure_triangles(places, corners)
    ends = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, counts = np.unique(ends, axis=0, return_counts=True)
    return SurfaceMeasures(
        least_angle=float(each.least_angles.min()),
        largest_angle=float(each.largest_angles.max()),
        n_obtuse=int((each.largest_angles > 90 + 1e-9).sum()),
        least_quality=float(each.qualities.min()),
        mean_quality=float(each.qualities.mean()),
        below_30=float((each.least_angles < 30).mean()),
        euler_characteristic=len(np.unique(corners)) - len(edges) + len(corners),
        is_closed=bool((counts == 2).all()),
    )
