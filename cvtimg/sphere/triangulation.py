"""A Delaunay triangulation of points on the sphere: built once, and kept up to date by flips while the points move."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_places, check_that, refuse
from cvtimg._shared.threads import in_parts
from cvtimg.engine.ordering import along_curve
from cvtimg.sphere import _triangulation

Points = NDArray[np.float64]
Triangles = NDArray[np.int32]

#: Least distance of two points on the unit sphere: doubles cannot tell the convex hull of points that are much nearer.
LEAST_DISTANCE = 1e-7
#: How far from the unit sphere points may be given.
_OFF_THE_SPHERE = 1e-6
#: Least height of the tetrahedron to start from: points that are nearer to one plane have no inside.
_LEAST_HEIGHT = 1e-13
#: Points of the first round of insertion; each further round has about twice as many.
_FIRST_ROUND = 64
#: Flips at most for each triangle; sound input needs about one.
_MOST_FLIPS = 100
#: Steps of the kernels, for each triangle or cell, by which their work is divided among threads.
_WORK = 100


class Triangulation:
    """The Delaunay triangulation of N points on the unit sphere: their convex hull.

    Attributes
    ----------
    points : (N, 3) float64 array
    triangles : (T, 3) int32 array
        T = 2 N - 4 triples of indices, counterclockwise from outside.
    twins : (T, 3) int32 array
        For edge k of triangle t, from its corner k to the next: the same edge of the triangle beyond, as 3 t + k.
    """

    def __init__(self, points: Points, triangles: Triangles | None = None) -> None:
        self.points = np.ascontiguousarray(points)
        self.triangles = np.empty((2 * len(points) - 4, 3), np.int32)
        self.twins = np.empty_like(self.triangles)
        self._arcs: NDArray[np.float64] | None = None
        self._firsts: NDArray[np.int32] | None = None
        if triangles is None:
            self._insert_all()
        else:
            self.triangles[:] = triangles
            heads, following = np.empty(len(points), np.int32), np.empty(self.triangles.size, np.int32)
            n_open = _triangulation.find_twins(self.triangles, self.twins, heads, following)
            check_that("triangles", n_open == 0, "cover the sphere")

    def move(self, points: Points) -> bool:
        """Move all points and flip edges; return False, and change nothing, if a triangle would turn over."""
        arcs, n_turned = self._arcs_of(points)
        if n_turned:
            return False
        wrong = np.empty(self.triangles.size, np.uint8)

        def kernel(start: int, stop: int) -> None:
            _triangulation.find_wrong(points, self.triangles, self.twins, arcs, start, stop, wrong)

        in_parts(kernel, len(arcs), _WORK * len(arcs))
        first = np.flatnonzero(wrong)
        self.points, self._arcs = points, arcs
        if len(first):
            self._firsts = None
            stack = np.empty(self.triangles.size, np.int32)
            stack[: len(first)] = first
            most = _MOST_FLIPS * len(self.triangles)
            if _triangulation.flip(points, self.triangles, self.twins, arcs, stack, len(first), wrong, most) < 0:
                self._insert_all()
        return True

    def replace(self, points: Points) -> None:
        """Move all points anywhere: what flips cannot follow is built anew."""
        if not self.move(points):
            self.points = np.ascontiguousarray(points)
            self._insert_all()

    def n_turned(self, points: Points, which: NDArray[np.bool_]) -> int:
        """Return how many triangles, of those that a mask (T,) selects, turn over when all points move."""
        triangles = self.triangles[which]
        return _triangulation.half_arcs_of_edges(points, triangles, 0, len(triangles), np.empty(triangles.shape))

    def circumcenters(self) -> Points:
        """Return the centers (T, 3) of the circumscribed caps of triangles: the corners of Voronoi cells."""
        centers = np.empty(self.triangles.shape)

        def kernel(start: int, stop: int) -> None:
            _triangulation.circumcenters(self.points, self.triangles, start, stop, centers)

        in_parts(kernel, len(centers), _WORK * len(centers))
        return centers

    def uniform_moments(self) -> Points:
        """Integrate x over each cell, exactly: (N, 3)."""
        if self._arcs is None:
            self._arcs = self._arcs_of(self.points)[0]
        arcs, firsts, moments = self._arcs, self.first_edges(), np.empty_like(self.points)

        def kernel(start: int, stop: int) -> None:
            _triangulation.sum_uniform(self.points, self.triangles, self.twins, arcs, firsts, start, stop, moments)

        in_parts(kernel, len(moments), _WORK * len(moments))
        return moments

    def weighted_moments(self, at_points: Points, centers: Points, at_centers: Points) -> tuple[Points, Points, Points]:
        """Integrate a density over each cell: masses (N,), and those of the density times x (N, 3) and the energy (N,).

        The density is given at points (N,) and at circumcenters (T,), and taken to be linear in between.
        """
        firsts, moments = self.first_edges(), np.empty_like(self.points)
        masses, energies = np.empty((2, len(self.points)))

        def kernel(start: int, stop: int) -> None:
            _triangulation.sum_weighted(
                self.points, self.triangles, self.twins, centers, firsts, at_points, at_centers, start, stop,
                masses, moments, energies,
            )  # fmt: skip

        in_parts(kernel, len(moments), _WORK * len(moments))
        return masses, moments, energies

    def areas(self) -> NDArray[np.float64]:
        """Return the areas (N,) of Voronoi cells; together 4 pi."""
        ones = np.ones(len(self.points)), self.circumcenters(), np.ones(len(self.triangles))
        return self.weighted_moments(*ones)[0]

    def cells(self) -> SphereCells:
        """Return the Voronoi cells of all points."""
        offsets, corners = np.empty(len(self.points) + 1, np.int32), np.empty(self.triangles.size, np.int32)
        _triangulation.list_corners(self.triangles, self.twins, self.first_edges(), offsets, corners)
        return SphereCells(self.circumcenters(), offsets, corners)

    def first_edges(self) -> NDArray[np.int32]:
        """Return the edge (N,) from each vertex to its least neighbor."""
        if self._firsts is None:
            self._firsts = np.empty(len(self.points), np.int32)
            _triangulation.first_edges(self.triangles, self._firsts)
        return self._firsts

    def _arcs_of(self, points: Points) -> tuple[NDArray[np.float64], int]:
        """Return half arcs (T, 3) with the vertices at other points, and how many triangles are turned over there."""
        arcs, turned = np.empty(self.triangles.shape), []

        def kernel(start: int, stop: int) -> None:
            turned.append(_triangulation.half_arcs_of_edges(points, self.triangles, start, stop, arcs))

        in_parts(kernel, len(arcs), _WORK * len(arcs))
        return arcs, sum(turned)

    def _insert_all(self) -> None:
        """Insert all points; the work is on a copy along a curve, so that neighbors are near in memory."""
        self._arcs = self._firsts = None
        curve = along_curve(self.points).astype(np.int32)
        points = self.points[curve]
        four = _four_apart(points)
        order = _insertion_order(len(points), four)
        stack = np.empty(self.triangles.size, np.int32)
        most = _MOST_FLIPS * len(points)
        inside = points[four].mean(axis=0)
        n = _triangulation.insert(points, order, inside, LEAST_DISTANCE**2, most, self.triangles, self.twins, stack)
        if n < len(points):
            gaps = np.linalg.norm(points - points[order[n]], axis=1)
            gaps[order[n]] = np.inf
            _refuse_near(int(curve[order[n]]), int(curve[gaps.argmin()]), float(gaps.min()))
        least, edge = _triangulation.shortest_edge(points, self.triangles)
        if least < LEAST_DISTANCE**2:
            t, k = divmod(edge, 3)
            _refuse_near(int(curve[self.triangles[t, k]]), int(curve[self.triangles[t, (k + 1) % 3]]), least**0.5)
        self._sort()
        self.triangles = curve[self.triangles]

    def _sort(self) -> None:
        """Sort triangles by their least vertex."""
        triangles, twins = np.empty_like(self.triangles), np.empty_like(self.twins)
        counts, places = np.empty(len(self.points) + 1, np.int32), np.empty(triangles.size, np.int32)
        _triangulation.sort_triangles(self.triangles, self.twins, counts, places, triangles, twins)
        self.triangles, self.twins = triangles, twins


@dataclass(frozen=True, slots=True, eq=False)
class SphereCells:
    """The Voronoi cells of N points on the unit sphere.

    Attributes
    ----------
    vertices : (T, 3) float64 array
        Corners of cells: the circumcenters of the T triangles.
    offsets : (N + 1,) int32 array
        The corners of cell i are ``vertices[corners[offsets[i]:offsets[i + 1]]]``, counterclockwise from outside.
    corners : (3 T,) int32 array
        Indices of vertices, which are those of triangles.
    """

    vertices: Points
    offsets: NDArray[np.int32]
    corners: NDArray[np.int32]

    def __post_init__(self) -> None:
        for array in (self.vertices, self.offsets, self.corners):
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __iter__(self) -> Iterator[Points]:
        """Yield the corners of each cell."""
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Points:
        """Return the (C, 3) corners of one cell, counterclockwise from outside."""
        start, stop = self.offsets[index], self.offsets[index + 1]
        corners: Points = self.vertices[self.corners[start:stop]]
        return corners

    def __repr__(self) -> str:
        return f"SphereCells({len(self)} cells, {len(self.vertices)} corners)"


def triangulate(points: ArrayLike) -> NDArray[np.int32]:
    """Triangulate points on the sphere: the Delaunay triangulation, which is their convex hull.

    Parameters
    ----------
    points : (N, 3) array
        N >= 4 points on the unit sphere, at least 1e-7 apart and not all on one circle.

    Returns
    -------
    (2 N - 4, 3) int32 array
        Indices of points, counterclockwise from outside.

    Raises
    ------
    TypeError, ValueError
        If points are not on the unit sphere, are fewer than 4, coincide nearly, or are all on one circle.

    Examples
    --------
    >>> from cvtimg.sphere import triangulate
    >>> len(triangulate([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]))
    8
    """
    return Triangulation(check_sphere_points("points", points, least=4)).triangles


def check_sphere_points(name: str, points: ArrayLike, least: int = 1) -> Points:
    """Return points as an (N, 3) array of unit vectors, with N at least `least`."""
    places = check_places(name, points, 3)
    check_that(name, len(places) >= least, f"have at least {least} points, not {len(places)}")
    lengths = np.sqrt(np.einsum("ij,ij->i", places, places))
    off = np.abs(lengths - 1)
    worst = int(off.argmax())
    if off[worst] > _OFF_THE_SPHERE:
        refuse(f"|{name}[{worst}]|", float(lengths[worst]), "1: points are on the unit sphere")
    # Points that are unit vectors to rounding keep their bits.
    rounded = off <= 4 * np.finfo(float).eps
    return places if rounded.all() else np.where(rounded[:, None], places, places / lengths[:, None])


def unit(vectors: Points) -> Points:
    """Return (N, 3) vectors divided by their lengths."""
    scaled: Points = vectors / np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
    return scaled


def _refuse_near(one: int, other: int, gap: float) -> None:
    check_that(
        f"points {min(one, other)} and {max(one, other)}", False, f"be at least {LEAST_DISTANCE:g} apart, not {gap:.2g}"
    )


def _four_apart(points: Points) -> NDArray[np.int32]:
    """Return four points far apart, of which the first three are counterclockwise from outside."""
    a = 0
    b = int(np.argmin(points @ points[a]))
    along = points[b] - points[a]
    beside = np.cross(points - points[a], along)
    c = int(np.einsum("ij,ij->i", beside, beside).argmax())
    normal = np.cross(along, points[c] - points[a])
    heights = (points - points[a]) @ normal
    d = int(np.abs(heights).argmax())
    check_that("points", abs(heights[d]) > _LEAST_HEIGHT * np.linalg.norm(normal), "not be all on one circle")
    if heights[d] > 0:
        b, c = c, b
    return np.array([a, b, c, d], np.int32)


def _insertion_order(n: int, four: NDArray[np.int32]) -> NDArray[np.int32]:
    """Order points along a curve by random rounds, each about twice as long as the one before.

    N. Amenta, S. Choi, G. Rote, Incremental constructions con BRIO, Proc. Symposium on Computational Geometry (2003)
    211-219, doi 10.1145/777792.777824.
    """
    n_rounds = max(int(np.log2(n / _FIRST_ROUND)), 0) + 1
    rounds = np.minimum(np.random.default_rng(0).geometric(0.5, n), n_rounds).astype(np.uint8)
    rounds[four] = n_rounds + 1
    order = np.argsort(n_rounds + 1 - rounds, kind="stable").astype(np.int32)
    order[:4] = four
    return order
