"""Densities that are given at the vertices of a surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_places, check_triangles, check_weights
from cvtimg.surfaces.base import Points
from cvtimg.surfaces.halves import HalfEdges


class VertexDensity:
    """A density given at vertices, linear on the triangles between them.

    Parameters
    ----------
    vertices : (V, 3) array
    faces : (F, 3) integer array
        Indices of vertices.
    values : (V,) array
        Densities at the vertices: finite, >= 0 and not all 0.

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here.

    Examples
    --------
    >>> from cvtimg.surfaces import VertexDensity
    >>> density = VertexDensity([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], [0, 4, 8])
    >>> density([[0.5, 0, 0], [0.25, 0.5, 0]]).tolist()
    [2.0, 5.0]
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, values: ArrayLike) -> None:
        from scipy.spatial import KDTree

        points = check_places("vertices", vertices, 3)
        triangles = check_triangles("faces", faces, len(points))
        self._values = check_weights("values", values, (len(points),), "vertex").copy()
        self._mesh = HalfEdges(points.copy(), triangles.copy())
        self._used = np.unique(triangles)
        self._tree: Any = KDTree(points[self._used])
        self._face = np.empty(len(points), np.int32)
        self._face[triangles.ravel()] = np.arange(triangles.size, dtype=np.int32) // 3

    def __call__(self, places: Points) -> NDArray[np.float64]:
        """Return the density (N,) at (N, 3) places on the surface or near to it."""
        places = check_places("places", places, 3)
        start = self._face[self._used[self._tree.query(places)[1]]]
        found, faces = self._mesh.nearest(places, start)
        corners = self._mesh.triangles[faces]
        a, b, c = (self._mesh.points[corners[:, k]] for k in range(3))
        # Shares of a triangle opposite to its corners.
        shares = np.stack([np.linalg.norm(np.cross(q - found, r - found), axis=1) for q, r in ((b, c), (c, a), (a, b))])
        density: NDArray[np.float64] = (shares * self._values[corners].T).sum(axis=0) / shares.sum(axis=0)
        return density
