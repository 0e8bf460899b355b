"""How good a grid of the sphere is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.halfedges import measure_triangles

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GridMeasures:
    """Measures of a triangulation of the sphere. Angles are those between chords, as on a map of each triangle.

    Attributes
    ----------
    least_angle, largest_angle : float
        In degrees; 60 for equilateral triangles.
    n_obtuse : int
        Triangles with an angle above 90 degrees, whose circumcenter is outside.
    least_quality, mean_quality : float
        2 r / R of triangles, for the radii of the incircle and the circumcircle; 1 if they are equilateral.
    uniformity : float
        The least of the distances from a point to its nearest neighbor by that to its farthest one.
    shortest_edge, longest_edge : float
        Distances of neighbors, as angles in radians.
    n_pentagons, n_hexagons, n_heptagons, n_others : int
        Cells by their number of sides.
    """

    least_angle: float
    largest_angle: float
    n_obtuse: int
    least_quality: float
    mean_quality: float
    uniformity: float
    shortest_edge: float
    longest_edge: float
    n_pentagons: int
    n_hexagons: int
    n_heptagons: int
    n_others: int


def measure_grid(points: Points, triangles: NDArray[np.int32]) -> GridMeasures:
    """Measure a grid.

    Parameters
    ----------
    points : (N, 3) array
        Unit vectors.
    triangles : (T, 3) integer array
        Indices of points; they cover the sphere.

    Returns
    -------
    GridMeasures

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.sphere import measure_grid, triangulate
    >>> octahedron = np.concatenate([np.eye(3), -np.eye(3)])
    >>> measures = measure_grid(octahedron, triangulate(octahedron))
    >>> round(measures.least_angle, 9), measures.n_obtuse, measures.n_others
    (60.0, 0, 6)
    """
    each = measure_triangles(points, triangles)
    nearest, farthest = np.full(len(points), np.inf), np.zeros(len(points))
    for k in range(3):  # the side from each corner to the next; the surface is closed, so that these are all
        length = np.linalg.norm(points[triangles[:, k]] - points[triangles[:, k - 2]], axis=1)
        np.minimum.at(nearest, triangles[:, k], length)
        np.maximum.at(farthest, triangles[:, k], length)
    degrees = np.bincount(np.bincount(triangles.ravel(), minlength=len(points)), minlength=8)
    return GridMeasures(
        least_angle=float(each.least_angles.min()),
        largest_angle=float(each.largest_angles.max()),
        n_obtuse=int((each.largest_angles > 90 + 1e-9).sum()),
        least_quality=float(each.qualities.min()),
        mean_quality=float(each.qualities.mean()),
        uniformity=float((nearest / farthest).min()),
        shortest_edge=float(2 * np.arcsin(nearest.min() / 2)),
        longest_edge=float(2 * np.arcsin(farthest.max() / 2)),
        n_pentagons=int(degrees[5]),
        n_hexagons=int(degrees[6]),
        n_heptagons=int(degrees[7]),
        n_others=len(points) - int(degrees[5:8].sum()),
    )
