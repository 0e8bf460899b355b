"""Surfaces that are given by triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_have_area, check_places, check_triangles
from cvtimg.meshes import measure_triangles
from cvtimg.surfaces.base import Points, Surface, Triangles
from cvtimg.surfaces.halves import HalfEdges, check_manifold, divide_fans, find_twins


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class TriangulatedSurface(Surface):
    """A surface of triangles, closed or with a boundary.

    Parameters
    ----------
    vertices : (V, 3) array
    faces : (F, 3) integer array
        Indices of vertices. All go around in one direction; where they go clockwise, as seen from outside of a closed
        surface, they are turned.

    Raises
    ------
    TypeError, ValueError
        If vertices are not finite, a face has no area, three faces meet at an edge, or faces go around in different
        directions.

    Examples
    --------
    >>> from cvtimg.surfaces import TriangulatedSurface
    >>> vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> surface = TriangulatedSurface(vertices, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    >>> surface.area, surface.triangulation.is_closed
    (2.366..., True)
    """

    _triangulation: HalfEdges

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        points = check_places("vertices", vertices, 3)
        triangles = check_triangles("faces", faces, len(points))
        check_have_area("faces", measure_triangles(points, triangles).areas)
        check_manifold(triangles, len(points))
        points, triangles = divide_fans(points, triangles, find_twins(triangles, len(points)))
        mesh = HalfEdges(points, triangles)
        if mesh.is_closed and np.linalg.det(points[triangles] - points.mean(axis=0)).sum() < 0:
            mesh = HalfEdges(points, triangles[:, ::-1])
        object.__setattr__(self, "_triangulation", mesh)

    def __repr__(self) -> str:
        kind = "closed" if self.triangulation.is_closed else "with a boundary"
        return f"<TriangulatedSurface of {len(self.triangulation.triangles)} triangles, {kind}>"

    @property
    def triangulation(self) -> HalfEdges:
        """The triangles."""
        return self._triangulation

    @property
    def area(self) -> float:
        """The area of all triangles."""
        return float(self.triangulation.areas().sum())

    def on_surface(self, places: Points) -> Points:
        """Return the places, which are on the surface."""
        return places

    def nearest(self, places: Points, faces: Triangles, fine: HalfEdges) -> tuple[Points, Points, Triangles]:
        """Walk over the triangles of `fine`, which are parts of those of the surface."""
        found, faces = fine.nearest(places, faces)
        return found, fine.face_normals(faces), faces
