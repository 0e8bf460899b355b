"""Triangles of a surface and the half-edges between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg._shared.threads import in_parts
from cvtimg.sphere import _triangulation
from cvtimg.surfaces import _surfaces

Points = NDArray[np.float64]
Triangles = NDArray[np.int32]

#: Flips at most for each triangle; rounding on curved surfaces might let two edges take turns for ever.
_MOST_FLIPS = 20
#: Steps of the kernel to find the nearest point.
_WORK = 300


class HalfEdges:
    """A triangulated surface; half-edge 3 t + k leads from corner k of triangle t to the next one.

    Attributes
    ----------
    points : (N, 3) float64 array
    triangles : (T, 3) int32 array
        Counterclockwise from outside.
    twins : (T, 3) int32 array
        For each half-edge that which leads back, or -1 on a boundary.
    """

    def __init__(self, points: Points, triangles: Triangles, twins: Triangles | None = None) -> None:
        self.points = np.ascontiguousarray(points)
        self.triangles = np.ascontiguousarray(triangles, np.int32)
        self.twins = find_twins(self.triangles, len(points)) if twins is None else twins

    @property
    def is_closed(self) -> bool:
        """Whether there is no boundary."""
        return bool((self.twins >= 0).all())

    @property
    def euler_characteristic(self) -> int:
        """Vertices minus edges plus triangles: 2 for a sphere, 0 for a torus."""
        n_edges = (self.triangles.size + np.count_nonzero(self.twins < 0)) // 2
        return int(len(self.points) - n_edges + len(self.triangles))

    def areas(self) -> NDArray[np.float64]:
        """Return the areas (T,) of triangles."""
        a, b, c = (self.points[self.triangles[:, k]] for k in range(3))
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    def vertex_areas(self) -> NDArray[np.float64]:
        """Return a third of the areas (N,) of the triangles at each vertex."""
        shares = np.repeat(self.areas() / 3, 3)
        return np.bincount(self.triangles.ravel(), shares, len(self.points)).astype(np.float64, copy=False)

    def face_normals(self, faces: Triangles | slice = slice(None)) -> Points:
        """Return outward unit normals of triangles, of all by default."""
        a, b, c = (self.points[corners] for corners in self.triangles[faces].T)
        return unit(np.cross(b - a, c - a))

    def normals(self) -> Points:
        """Return outward unit normals (N, 3) at the vertices: the mean of their triangles."""
        across, corners = self.face_normals(), self.triangles.ravel()
        return unit(np.stack([np.bincount(corners, np.repeat(x, 3), len(self.points)) for x in across.T], axis=1))

    def flip(self, normals: Points) -> int:
        """Flip edges until opposite angles add up to at most 180 degrees, but fold nothing; return how many."""
        stack, waiting = np.empty(self.triangles.size, np.int32), np.empty(self.triangles.size, np.uint8)
        most = _MOST_FLIPS * len(self.triangles)
        return _surfaces.flip(self.points, normals, self.triangles, self.twins, most, stack, waiting)

    def folds(self, points: Points, normals: Points) -> NDArray[np.bool_]:
        """Tell which vertices, moved to `points`, have a triangle that faces inward."""
        wrong = np.empty(len(points), np.uint8)
        _surfaces.find_inward(points, normals, self.triangles, wrong)
        return wrong.view(np.bool_)

    def moments(self, density: NDArray[np.float64]) -> tuple[NDArray[np.float64], Points]:
        """Return the masses (N,) of the cells of points, and the steps (N, 3) to their centers of mass."""
        masses, pulls = np.empty(len(self.points)), np.empty(self.points.shape)
        _surfaces.sum_cells(self.points, density, self.triangles, self.twins, masses, pulls)
        # A cell of no mass, or of a negative one where angles are obtuse, stays.
        heavy = masses > 1e-9 * masses.mean()
        return masses, np.where(heavy[:, None], pulls / np.where(heavy, masses, 1)[:, None], 0)

    def nearest(self, places: Points, faces: Triangles) -> tuple[Points, Triangles]:
        """Walk from faces to the nearest points to places; return them and their faces."""
        found, last = np.ascontiguousarray(places).copy(), faces.copy()

        def kernel(start: int, stop: int) -> None:
            _surfaces.nearest(self.points, self.triangles, self.twins, start, stop, found, last)

        in_parts(kernel, len(found), _WORK * len(found))
        return found, last


def unit(vectors: Points) -> Points:
    """Scale (N, 3) vectors to length 1."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300))


def find_twins(triangles: Triangles, n: int) -> Triangles:
    """Return the half-edge that leads back along each one, (T, 3), or -1."""
    twins = np.empty(triangles.shape, np.int32)
    _triangulation.find_twins(triangles, twins, np.empty(n, np.int32), np.empty(triangles.size, np.int32))
    return twins


def check_manifold(triangles: Triangles, n: int) -> None:
    """Refuse triangles that go around in different directions, or that meet at an edge of others."""
    keys = np.sort(triangles.astype(np.int64).ravel() * n + triangles[:, [1, 2, 0]].ravel())
    demand = "go around in one direction, at most two at an edge: turn some, or divide the surface"
    check_that("faces", (np.diff(keys) > 0).all(), demand)


def divide_fans(points: Points, triangles: Triangles, twins: Triangles) -> tuple[Points, Triangles]:
    """Give each fan of triangles a vertex of its own where several meet in one, and leave out unused vertices."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    numbers = np.arange(triangles.size)
    before = np.where(numbers % 3 == 0, numbers + 2, numbers - 1)
    beyond = twins.ravel()[before]
    there = beyond >= 0
    links = coo_array((np.ones(there.sum(), np.int8), (numbers[there], beyond[there])), (len(numbers), len(numbers)))
    n_fans, fan = connected_components(links, directed=False)
    origin = np.empty(n_fans, np.int64)
    origin[fan] = triangles.ravel()
    return points[origin], fan.astype(np.int32).reshape(-1, 3)
