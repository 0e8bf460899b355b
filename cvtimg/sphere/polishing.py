"""Small moves after a descent that bring the angles of triangles within bounds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.sphere import _triangulation
from cvtimg.sphere.descent import Projection
from cvtimg.sphere.triangulation import Triangulation, unit

#: Angles in degrees that are aimed at: beyond them corners push, so that none comes near to 90 degrees.
BOUNDS = (47.0, 80.0)
#: A move by the slope of what angles cost, in squares of the size of a cell; and the longest, in sizes.
_RATE, _LONGEST = 0.25, 0.05


def polish_angles(
    mesh: Triangulation,
    sizes: NDArray[np.float64],
    most: int,
    *,
    bounds: tuple[float, float] = BOUNDS,
    free: NDArray[np.bool_] | None = None,
    project: Projection | None = None,
) -> None:
    """Descend the sum of squares by which cosines of angles are out of bounds, with flips in between.

    Parameters
    ----------
    mesh : Triangulation
        Is changed.
    sizes : (N,) array
        Of the cells: roots of their areas.
    most : int
        Moves at most; it ends when no angle is out of bounds.
    bounds : pair of float
        For angles, in degrees.
    free, project
        As in `cvtimg.sphere.descent.Terms`.
    """
    least_cosine, largest_cosine = np.cos(np.radians(bounds[::-1]))
    slopes = np.empty_like(mesh.points)
    for _ in range(most):
        if not _triangulation.sum_corner_slopes(mesh.points, mesh.triangles, least_cosine, largest_cosine, slopes):
            return
        moving = np.flatnonzero(slopes.any(axis=1) if free is None else slopes.any(axis=1) & free)
        step = (-_RATE * sizes[moving] ** 2)[:, None] * slopes[moving]
        lengths = np.sqrt(np.einsum("ij,ij->i", step, step)) / (_LONGEST * sizes[moving])
        step /= np.maximum(lengths, 1)[:, None]
        there = mesh.points.copy()
        there[moving] = unit(mesh.points[moving] + step)
        mesh.replace(there if project is None else project(there, mesh.points))
