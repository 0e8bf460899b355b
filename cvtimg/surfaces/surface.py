"""Surfaces in space: what every one can tell, those that are given by triangles, and densities at their vertices."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_have_area, check_places, check_triangles, check_weights
from cvtimg._shared.types import Floats, Points, Triangles
from cvtimg.halfedges import measure_triangles
from cvtimg.surfaces.triangulation import SurfaceTriangulation, check_directions, divided


class Surface(ABC):
    """A surface in space, with triangles that are on it or near to it."""

    __slots__ = ()
    #: Whether no two faces meet at an angle, but for those of its triangles.
    is_smooth: ClassVar[bool] = False

    @property
    @abstractmethod
    def triangulation(self) -> SurfaceTriangulation:
        """Triangles that have the shape of the surface, as coarse as that allows."""

    @abstractmethod
    def on_surface(self, places: Points) -> Points:
        """Move (N, 3) places in triangles of `triangulation`, or in parts of these, to the surface."""

    @abstractmethod
    def nearest(self, places: Points, faces: Triangles, fine: SurfaceTriangulation) -> tuple[Points, Points, Triangles]:
        """Move (N, 3) places near triangles of `fine`, whose vertices are on the surface, to the surface.

        Returns the points, their outward unit normals, and the triangles of `fine` near to them.
        """


@dataclass(frozen=True, slots=True)
class SurfaceRepairs:
    """What was mended when a surface was read.

    Attributes
    ----------
    n_joined : int
        Vertices that were joined to others.
    n_degenerate, n_doubled : int
        Faces that were left out, since they had no area or were there already.
    n_flipped : int
        Faces that were turned over, to go around in the direction of those beside them.
    """

    n_joined: int = 0
    n_degenerate: int = 0
    n_doubled: int = 0
    n_flipped: int = 0


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class TriangulatedSurface(Surface):
    """A surface of triangles, closed or with a boundary; more than two may meet at an edge.

    Parameters
    ----------
    vertices : (V, 3) array
    faces : (F, 3) integer array
        Indices of vertices. All go around in one direction; where they go clockwise, as seen from outside of a closed
        surface, they are turned. `as_surface` mends what does not.
    repairs : SurfaceRepairs, optional
        What was mended before.

    Examples
    --------
    >>> from cvtimg.surfaces import TriangulatedSurface
    >>> vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> surface = TriangulatedSurface(vertices, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    >>> surface.area, surface.triangulation.is_closed
    (2.366..., True)
    """

    _triangulation: SurfaceTriangulation
    repairs: SurfaceRepairs

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, repairs: SurfaceRepairs | None = None) -> None:
        points = check_places("vertices", vertices, 3)
        triangles = check_triangles("faces", faces, len(points))
        check_have_area("faces", measure_triangles(points, triangles).areas)
        check_directions(points, triangles)
        mesh = divided(points, triangles)
        if mesh.is_closed and np.linalg.det(mesh.points[mesh.triangles] - points.mean(axis=0)).sum() < 0:
            mesh = SurfaceTriangulation(mesh.points, mesh.triangles[:, ::-1])
        object.__setattr__(self, "_triangulation", mesh)
        object.__setattr__(self, "repairs", repairs or SurfaceRepairs())

    def __repr__(self) -> str:
        kind = "closed" if self.triangulation.is_closed else "with a boundary"
        return f"<TriangulatedSurface of {len(self.triangulation.triangles)} triangles, {kind}>"

    @property
    def triangulation(self) -> SurfaceTriangulation:
        """The triangles."""
        return self._triangulation

    @property
    def area(self) -> float:
        """The area of all triangles."""
        return float(self.triangulation.areas().sum())

    def on_surface(self, places: Points) -> Points:
        """Return the places, which are on the surface."""
        return places

    def nearest(self, places: Points, faces: Triangles, fine: SurfaceTriangulation) -> tuple[Points, Points, Triangles]:
        """Walk over the triangles of `fine`, which are parts of those of the surface."""
        feet, faces = fine.nearest(places, faces)
        return feet, fine.face_normals(faces), faces


class VertexDensity:
    """A density given at vertices, linear on the triangles between them.

    Parameters
    ----------
    vertices : (V, 3) array
    faces : (F, 3) integer array
        Indices of vertices.
    values : (V,) array
        Densities at the vertices: finite, >= 0 and not all 0.

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
        self._mesh = SurfaceTriangulation(points.copy(), triangles.copy())
        self._used = np.unique(triangles)
        self._tree: Any = KDTree(points[self._used])
        self._face = self._mesh.face_of_each()

    def __call__(self, places: Points) -> Floats:
        """Return the density (N,) at (N, 3) places on the surface or near to it."""
        places = check_places("places", places, 3)
        start = self._face[self._used[self._tree.query(places)[1]]]
        feet, faces = self._mesh.nearest(places, start)
        corners = self._mesh.triangles[faces]
        a, b, c = (self._mesh.points[corners[:, k]] for k in range(3))
        # Shares of a triangle opposite to its corners.
        shares = np.stack([np.linalg.norm(np.cross(q - feet, r - feet), axis=1) for q, r in ((b, c), (c, a), (a, b))])
        return (shares * self._values[corners].T).sum(axis=0) / shares.sum(axis=0)
