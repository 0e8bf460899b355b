"""A Delaunay triangulation of points on the sphere: built once, and kept up to date by flips while the points move.

Its cells, and integrals over them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

import cvtimg.sphere._sphere as _sphere
from cvtimg._shared.budgets import GIVEN, IN_CACHE
from cvtimg._shared.checks import check_places, check_that, refuse
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.threads import in_parts, in_stripes
from cvtimg._shared.types import Bools, Floats, Ints, Points, Triangles
from cvtimg.engine.samples import along_curve
from cvtimg.halfedges import MOST_FLIPS, HalfEdges, find_twins, half_edges_out
from cvtimg.sphere.densities import SphereDensity

#: Least distance of two points on the unit sphere: doubles cannot tell the convex hull of points that are much nearer.
LEAST_DISTANCE = 1e-7
#: Steps of the kernels, for each triangle or cell, by which their work is divided among threads.
WORK = 100
#: Cells of a stripe, with 16 numbers each, which stay in the cache until their sums are made.
_ROWS = IN_CACHE // 16


class SphereTriangulation(HalfEdges):
    """The Delaunay triangulation of N points on the unit sphere, T = 2 N - 4 triangles: their convex hull."""

    def __init__(self, points: Points, triangles: Triangles | None = None, twins: Triangles | None = None) -> None:
        self._arcs: Floats | None = None
        self._firsts: Ints | None = None
        if triangles is None:
            self.points = np.ascontiguousarray(points)
            self._build()
        else:
            super().__init__(points, triangles.copy(), twins)
            check_that("triangles", self.is_closed, "cover the sphere")

    def move(self, points: Points) -> bool:
        """Move all points and flip edges; return False, and change nothing, if a triangle would turn over."""
        arcs, n_turned = self._arcs_of(points)
        if n_turned:
            return False
        wrong = np.empty(self.triangles.size, np.uint8)
        self.points, self._arcs = points, arcs
        n_wrong = counted(partial(_sphere.find_wrong, self, arcs, wrong), len(arcs))
        if n_wrong and not _sphere.flip(self, arcs, wrong, self.first_edges(), MOST_FLIPS * len(self.triangles)):
            self._build()
        return True

    def replace(self, points: Points) -> None:
        """Move all points anywhere: what flips cannot follow is built anew."""
        if not self.move(points):
            self.points = np.ascontiguousarray(points)
            self._build()

    def circumcenters(self) -> Points:
        """Return the centers (T, 3) of the circumscribed caps of triangles: the corners of Voronoi cells."""
        return circumcenters(self.points, self.triangles)

    def fills_uniform(self, moments: Points) -> Callable[[int, int], None]:
        """Return what integrates x over cells, for rows of moments (N, 3)."""
        if self._arcs is None:
            self._arcs = self._arcs_of(self.points)[0]
        return partial(_sphere.sum_uniform, self, self._arcs, self.first_edges(), moments)

    def weighted_moments(self, at_points: Points, centers: Points, at_centers: Points) -> tuple[Points, Points, Points]:
        """Integrate a density over each cell: masses (N,), and those of the density times x (N, 3) and the energy (N,).

        The density is given at points (N,) and at circumcenters (T,), and taken to be linear in between.
        """
        moments, (masses, energies) = np.empty_like(self.points), np.empty((2, len(self.points)))
        tables = centers, self.first_edges(), at_points, at_centers
        kernel = partial(_sphere.sum_weighted, self, *tables, masses, moments, energies)
        in_parts(kernel, len(moments), WORK * len(moments))
        return masses, moments, energies

    def areas(self) -> Floats:
        """Return the areas (N,) of Voronoi cells; together 4 pi."""
        uniform = np.ones(len(self.points)), self.circumcenters(), np.ones(len(self.triangles))
        return self.weighted_moments(*uniform)[0]

    def cells(self) -> SphereCells:
        """Return the Voronoi cells of all points."""
        degrees = np.bincount(self.triangles.ravel(), minlength=len(self.points)).astype(np.int32)
        out = half_edges_out(self.first_edges(), self.twins, degrees)
        offsets = np.concatenate([[0], np.cumsum(degrees)]).astype(np.int32)
        return SphereCells(self.circumcenters(), offsets, out[out >= 0] // 3)

    def first_edges(self) -> Ints:
        """Return an edge (N,) from each vertex."""
        if self._firsts is None:
            self._firsts = np.empty(len(self.points), np.int32)
            self._firsts[self.triangles.ravel()] = np.arange(self.triangles.size, dtype=np.int32)
        return self._firsts

    def _arcs_of(self, points: Points) -> tuple[Floats, int]:
        """Return half arcs (T, 3) with the vertices at other points, and how many triangles are turned over there."""
        arcs = np.empty(self.triangles.shape)
        return arcs, counted(partial(_sphere.fill_half_arcs, points, self.triangles, arcs), len(arcs))

    def _build(self) -> None:
        """Triangulate all points; the work is on a copy along a curve, so that neighbors are near in memory."""
        self._arcs = self._firsts = None
        curve = along_curve(self.points).astype(np.int32)
        triangles = _hull(self.points[curve])
        # By the least vertex, which becomes the first: neighbors are near in memory, as vertices are.
        triangles = triangles[np.argsort(triangles.min(axis=1), kind="stable")]
        turns = (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3
        triangles = np.take_along_axis(triangles, turns, axis=1)
        self.twins = find_twins(triangles, len(self.points))
        self.triangles = curve[triangles]


@dataclass(frozen=True, slots=True, eq=False)
class SphereCells(ReadOnly):
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
    offsets: Ints
    corners: Ints

    def _claims(self) -> Claims:
        yield "three cells meet at each corner", np.bincount(self.corners, minlength=len(self.vertices)) == 3
        yield "cells have three corners or more", np.diff(self.offsets) >= 3

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __iter__(self) -> Iterator[Points]:
        """Yield the corners of each cell."""
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> Points:
        """Return the (C, 3) corners of one cell, counterclockwise from outside."""
        start, stop = self.offsets[index], self.offsets[index + 1]
        return self.vertices[self.corners[start:stop]]

    def __repr__(self) -> str:
        return f"SphereCells({len(self)} cells, {len(self.vertices)} corners)"


def triangulate(points: ArrayLike) -> Ints:
    """Triangulate points on the sphere: the Delaunay triangulation, which is their convex hull.

    Parameters
    ----------
    points : (N, 3) array
        N >= 4 points on the unit sphere, at least 1e-7 apart and not all on one circle.

    Returns
    -------
    (2 N - 4, 3) int32 array
        Indices of points, counterclockwise from outside.

    Examples
    --------
    >>> from cvtimg.sphere import triangulate
    >>> len(triangulate([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]))
    8
    """
    return SphereTriangulation(check_sphere_points("points", points, least=4)).triangles


def check_sphere_points(name: str, points: ArrayLike, least: int = 1) -> Points:
    """Return points as an (N, 3) array of unit vectors, with N at least `least`."""
    places = check_places(name, points, 3)
    check_that(name, len(places) >= least, f"have at least {least} points, not {len(places)}")
    lengths = np.sqrt(np.einsum("ij,ij->i", places, places))
    off = np.abs(lengths - 1)
    worst = int(off.argmax())
    if off[worst] > GIVEN:
        refuse(f"|{name}[{worst}]|", float(lengths[worst]), "1: points are on the unit sphere")
    # Points that are unit vectors to rounding keep their bits.
    rounded = off <= 4 * np.finfo(float).eps
    return places if rounded.all() else np.where(rounded[:, None], places, places / lengths[:, None])


def counted(kernel: Callable[[int, int], int], n_items: int) -> int:
    """Call ``kernel(start, stop)`` for parts of triangles, and sum what it counts."""
    counts: list[int] = []
    in_parts(lambda start, stop: counts.append(kernel(start, stop)), n_items, WORK * n_items)
    return sum(counts)


def circumcenters(points: Points, triangles: Triangles) -> Points:
    """Return the unit normals (T, 3) of triangles."""

    def normals(rows: slice) -> Points:
        a, b, c = (points[triangles[rows, k]] for k in range(3))
        return unit(np.cross(b - a, c - a))

    return np.concatenate(in_stripes(normals, len(triangles), WORK * len(triangles), _ROWS))


def unit(vectors: Points) -> Points:
    """Return (N, 3) vectors divided by their lengths."""
    return vectors / np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]


def _hull(points: Points) -> Triangles:
    """Return the triangles (T, 3) of the convex hull of points, counterclockwise from outside."""
    from scipy.spatial import ConvexHull, QhullError, cKDTree

    gaps, near = cKDTree(points).query(points, 2)
    first, second = sorted(near[gaps[:, 1].argmin()].tolist())
    apart = f"be at least {LEAST_DISTANCE:g} apart, not {gaps[:, 1].min():.2g}"
    check_that(f"points {first} and {second}", gaps[:, 1].min() >= LEAST_DISTANCE, apart)
    try:
        hull = ConvexHull(points)
    except QhullError as error:
        raise ValueError("points must not be all on one circle") from error
    check_that("points", len(hull.vertices) == len(points), "be farther apart, or not nearly all on one circle")
    triangles = np.ascontiguousarray(hull.simplices, np.int32)
    a, b, c = points[triangles].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    triangles[inward] = triangles[inward, ::-1]
    return triangles


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Sums over the cells of N points."""

    masses: Floats  # (N,): integral of the density
    # (N, 3): integral of the density times x, without its part along the point: mass times the way to the center of
    # mass. No pull at points that are not free.
    pulls: Points
    areas: Floats  # (N,): by which steps are measured
    energy: float  # integral of the density times the squared distance to the points
    offset: float  # root mean square of the distances of free points to centers of mass, by the sizes of cells


#: Integrates over the cells of a triangulation; of the points only some may be free (N,).
SumCells = Callable[[SphereTriangulation, Bools | None], Cells]


def uniform_cells(mesh: SphereTriangulation, free: Bools | None = None) -> Cells:
    """Integrate over cells for the density 1, exactly but for areas, which are lengths of moments."""
    pulls, areas = np.empty_like(mesh.points), np.empty(len(mesh.points))
    along, offset = _leveled(mesh, pulls, areas, None, areas, free, mesh.fills_uniform(pulls))
    return Cells(areas, pulls, areas, 8 * np.pi - 2 * along, offset)


@dataclass(frozen=True, slots=True)
class WeightedCells:
    """Integrates a density over cells: linear between points and corners of cells."""

    density: SphereDensity

    def __call__(self, mesh: SphereTriangulation, free: Bools | None = None) -> Cells:
        """Sum cells."""
        centers, at_points = mesh.circumcenters(), self.density(mesh.points)
        masses, pulls, energies = mesh.weighted_moments(at_points, centers, self.density(centers))
        areas = np.empty_like(masses)
        _, offset = _leveled(mesh, pulls, masses, at_points, areas, free, lambda *_: None)
        return Cells(masses, pulls, areas, float(energies.sum()), offset)


def _leveled(
    mesh: SphereTriangulation,
    moments: Points,
    masses: Floats,
    at_points: Floats | None,
    areas: Floats,
    free: Bools | None,
    fill: Callable[[int, int], None],
) -> tuple[float, float]:
    """Take the parts along points out of moments that are filled in; return the sum of these, and the offset.

    Areas are filled in, too: masses by the density at points, or lengths of moments without one.
    """
    marks = None if free is None else free.view(np.uint8)

    def level(rows: slice) -> tuple[float, float]:
        fill(rows.start, rows.stop)
        ends = rows.start, rows.stop
        sums: tuple[float, float] = _sphere.level(mesh.points, moments, masses, at_points, areas, marks, *ends)
        return sums

    along, squares = np.sum(in_stripes(level, len(masses), 2 * WORK * len(masses), _ROWS), axis=0).tolist()
    return along, (squares / (len(masses) if free is None else np.count_nonzero(free))) ** 0.5
