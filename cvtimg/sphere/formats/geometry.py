"""What touches what in a grid of the sphere; places, lengths and areas, and what edges weigh in a C-grid of velocities.

Cells belong to generators, edges to pairs of neighbors, and vertices to Delaunay triangles. A half-edge h = 3 t + k
leads from corner k of triangle t to the next one; its twin leads back, in the triangle beyond.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from cvtimg._shared.budgets import ROWS_AT_ONCE
from cvtimg._shared.checks import check_that
from cvtimg._shared.types import Array, Bools, Floats, Ints
from cvtimg.halfedges import find_twins, half_edges_out
from cvtimg.sphere.triangulation import circumcenters, unit

Indices = Ints


@dataclass(frozen=True, slots=True, eq=False)
class Connectivity:
    """Indices from 0, and -1 where a cell has fewer than M neighbors.

    All orders are counterclockwise, seen from outside: around a cell, edge j is that with neighbor j, and vertex j lies
    between edges j and j + 1. The vertices of an edge follow each other as seen along the way from its first cell to
    its second: from the right to the left.
    """

    degrees: Indices  # (N,): number of edges
    # (N, M).
    cells_on_cell: Indices
    edges_on_cell: Indices
    vertices_on_cell: Indices
    # (E, 2).
    cells_on_edge: Indices
    vertices_on_edge: Indices
    # (T, 3): edge k is that between cells k and k + 1.
    cells_on_vertex: Indices
    edges_on_vertex: Indices


def connect(triangles: Indices, n: int) -> Connectivity:
    """Find out what touches what in a closed triangulation of `n` points."""
    starts = triangles.ravel()
    ends = triangles[:, [1, 2, 0]].ravel()
    twins = find_twins(triangles, n).ravel()
    numbers = np.arange(len(starts), dtype=np.int32)
    closed = (twins >= 0).all() and (twins[twins] == numbers).all()
    check_that("triangles", closed, "close the sphere, each edge in two triangles that go around in the same direction")
    halves = numbers[numbers < twins]
    edge_of = np.empty(len(starts), np.int32)
    edge_of[halves] = edge_of[twins[halves]] = np.arange(len(halves), dtype=np.int32)
    degrees = np.bincount(starts, minlength=n).astype(np.int32)
    first = np.empty(n, np.int32)
    first[starts[::-1]] = numbers[::-1]
    outgoing = half_edges_out(first, twins, degrees)
    there = outgoing >= 0
    return Connectivity(
        degrees,
        cells_on_cell=np.where(there, ends[outgoing], -1).astype(np.int32),
        edges_on_cell=np.where(there, edge_of[outgoing], -1).astype(np.int32),
        vertices_on_cell=np.where(there, outgoing // 3, -1).astype(np.int32),
        cells_on_edge=np.stack([starts[halves], ends[halves]], axis=1),
        vertices_on_edge=np.stack([twins[halves] // 3, halves // 3], axis=1),
        cells_on_vertex=triangles,
        edges_on_vertex=edge_of.reshape(-1, 3),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """Measures of cells, edges and vertices, on the unit sphere."""

    vertices: Floats  # (T, 3): circumcenters of the triangles
    edges: Floats  # (E, 3): middles between neighboring generators
    # (E,): from generator to generator, and from vertex to vertex, along great circles.
    cell_distances: Floats
    edge_lengths: Floats
    # (E,): of the direction from the first cell to the second with the east, counterclockwise, in -pi..pi.
    angles: Floats
    # (T, 3): part of each triangle in the cell of each corner. They have signs: those of an obtuse angle's neighbors
    # are negative in part, and all add up to the cells.
    kites: Floats
    # (N,).
    cell_areas: Floats
    triangle_areas: Floats


def measure(points: Floats, around: Connectivity) -> Geometry:
    """Measure a grid whose generators are unit vectors."""
    triangles = around.cells_on_vertex

    def of_triangles(triangles: Indices) -> tuple[Floats]:
        return (circumcenters(points, triangles),)

    def of_edges(cells: Indices, ends: Indices) -> tuple[Floats, ...]:
        first, second = points[cells[:, 0]], points[cells[:, 1]]
        middles = unit(first + second)
        lengths = _arcs(vertices[ends[:, 1]], vertices[ends[:, 0]])
        _, longitudes = latitudes_longitudes(middles)
        east = np.stack([-np.sin(longitudes), np.cos(longitudes), np.zeros(len(middles))], axis=1)
        axes = np.cross(middles, east), east
        northward, eastward = (np.einsum("ij,ij->i", second - first, axis) for axis in axes)
        return middles, _arcs(first, second), lengths, np.arctan2(northward, eastward)

    def of_corners(triangles: Indices, vertices: Floats, around: Indices) -> tuple[Floats]:
        each = (
            _triangle_areas(points[triangles[:, k]], edges[around[:, k]], vertices)
            + _triangle_areas(points[triangles[:, k]], vertices, edges[around[:, k - 1]])
            for k in range(3)
        )
        return (np.stack(list(each), axis=1),)

    (vertices,) = _in_blocks(of_triangles, triangles)
    edges, distances, lengths, angles = _in_blocks(of_edges, around.cells_on_edge, around.vertices_on_edge)
    (kites,) = _in_blocks(of_corners, triangles, vertices, around.edges_on_vertex)
    areas = np.bincount(triangles.ravel(), kites.ravel(), minlength=len(points)).astype(np.float64, copy=False)
    return Geometry(vertices, edges, distances, lengths, angles, kites, areas, kites.sum(axis=1))


def _in_blocks(measure: Callable[..., tuple[Array, ...]], *tables: Array) -> list[Array]:
    """Measure some rows of tables at a time, so that what is needed in between is small."""
    arrays, size = list[Array](), ROWS_AT_ONCE // 16  # rows have 16 numbers or so
    for start in range(0, len(tables[0]), size):
        block = measure(*(table[start : start + size] for table in tables))
        arrays = arrays or [np.empty((len(tables[0]), *values.shape[1:]), values.dtype) for values in block]
        for whole, values in zip(arrays, block, strict=True):
            whole[start : start + size] = values
    return arrays


def latitudes_longitudes(places: Floats) -> tuple[Floats, Floats]:
    """Return latitudes in -pi/2..pi/2 and longitudes in 0..2 pi, below 2 pi."""
    latitudes = np.arctan2(places[:, 2], np.hypot(places[:, 0], places[:, 1]))
    longitudes = np.arctan2(places[:, 1], places[:, 0]) % (2 * np.pi)
    return latitudes, np.where(longitudes < 2 * np.pi, longitudes, 0.0)


def tangential_weights(around: Connectivity, geometry: Geometry) -> tuple[Indices, Floats]:
    """Compute how velocities u through edges nearby add up to that along an edge, to the left of that through it.

    Along edge e it is the sum of weights[e, j] u[edges_on_edge[e, j]], (E, 2 M) arrays: the other edges of the first
    cell, then of the second, counterclockwise from the edge; -1 after the last.

    J. Thuburn, T. D. Ringler, W. C. Skamarock, J. B. Klemp, Numerical representation of geostrophic modes on
    arbitrarily structured C-grids, Journal of Computational Physics 228 (2009), doi 10.1016/j.jcp.2009.08.006.
    """

    def of_edges(edges: Indices, pairs: Indices) -> tuple[Indices, Floats]:
        first, second = of_cells(edges, pairs[:, 0], 1.0), of_cells(edges, pairs[:, 1], -1.0)
        tables, weights = (first[0], second[0]), (first[1], second[1])
        return _those_first(np.concatenate(tables, axis=1), np.concatenate(weights, axis=1))

    def of_cells(edges: Indices, cells: Indices, sign: float) -> tuple[Indices, Floats]:
        around_cell, corners = around.edges_on_cell[cells], around.vertices_on_cell[cells]
        kites = np.where(around.cells_on_vertex[corners] == cells[:, None, None], geometry.kites[corners], 0)
        shares = kites.sum(axis=2) / geometry.cell_areas[cells, None]
        steps, degrees = np.arange(corners.shape[1] + 1), around.degrees[cells, None]
        turned = ((around_cell == edges[:, None]).argmax(axis=1)[:, None] + steps) % degrees
        passed = np.cumsum(np.take_along_axis(shares, turned[:, :-1], 1), axis=1)
        others = np.take_along_axis(around_cell, turned[:, 1:], 1)
        outward = np.where(around.cells_on_edge[others, 0] == cells[:, None], sign, -sign)
        lengths = geometry.edge_lengths[others] / geometry.cell_distances[edges, None]
        there = steps[1:] < degrees
        return np.where(there, others, -1), np.where(there, (0.5 - passed) * outward * lengths, 0.0)

    numbers = np.arange(len(around.cells_on_edge), dtype=np.int32)
    edges_on_edge, weights = _in_blocks(of_edges, numbers, around.cells_on_edge)
    return edges_on_edge, weights


def _those_first(table: Indices, weights: Floats) -> tuple[Indices, Floats]:
    """Move entries of a table that are -1, and their weights, behind the others of their rows."""
    order = np.argsort(table < 0, axis=1, kind="stable")
    return np.take_along_axis(table, order, 1), np.take_along_axis(weights, order, 1)


def _arcs(a: Floats, b: Floats) -> Floats:
    return np.asarray(2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=1) / 2, 1)))


def _triangle_areas(a: Floats, b: Floats, c: Floats) -> Floats:
    """Area of spherical triangles, > 0 if they go around counterclockwise.

    A. Van Oosterom, J. Strackee, The solid angle of a plane triangle, IEEE Trans. Biomedical Engineering 30 (1983). The
    triple product is taken of differences, so that small triangles keep their digits.
    """
    triple = np.einsum("ij,ij->i", a, np.cross(b - a, c - a))
    cosines = np.einsum("ij,ij->i", a, b) + np.einsum("ij,ij->i", b, c) + np.einsum("ij,ij->i", c, a)
    return np.asarray(2 * np.arctan2(triple, 1 + cosines))


@dataclass(frozen=True, eq=False)
class GridContent:
    """A grid of the sphere, as it goes into a file."""

    points: Floats  # (N, 3): generators, unit vectors
    triangles: Indices  # (T, 3): indices of points, counterclockwise as seen from outside
    density: Floats  # (N,): at the generators
    radius: float  # Of the sphere in the file; lengths and areas are in its unit
    flags: Mapping[str, Indices] = field(default_factory=dict)  # (N,): of cells, such as 1 on land
    attributes: Mapping[str, str] = field(default_factory=dict)  # of the whole file, where a format has them

    @cached_property
    def around(self) -> Connectivity:
        """What touches what."""
        return connect(self.triangles, len(self.points))

    @property
    def identity(self) -> str:
        """Ten characters that stand for the grid: a hash, so that equal grids have equal files."""
        from hashlib import sha256

        return sha256(self.points.tobytes() + self.triangles.tobytes()).hexdigest()[:10]

    @cached_property
    def geometry(self) -> Geometry:
        """Measures on the unit sphere."""
        return measure(self.points, self.around)

    @cached_property
    def tangential(self) -> tuple[Indices, Floats]:
        """Edges on edges, and their weights; see `tangential_weights`."""
        return tangential_weights(self.around, self.geometry)


@dataclass(frozen=True, eq=False)
class CulledContent(GridContent):
    """Some cells of a grid, and the edges and vertices that these have, all in the order of the grid.

    Where a cell is left out, its index is -1, and its part of triangles is 0. The first cell of each edge is there:
    edges that lost theirs are turned, with their vertices, angles and weights. MpasCellCuller leaves the same.
    """

    whole: GridContent = field(kw_only=True)
    kept: Bools = field(kw_only=True)  # (N,): of the whole

    @classmethod
    def of(cls, whole: GridContent, kept: Bools, flags: Mapping[str, Indices]) -> CulledContent:
        """Keep some cells; `flags` are those of these. The whole grid is the parent, before its own."""
        points, density = whole.points[kept], whole.density[kept]
        older = whole.attributes.get("parent_id")
        attributes = {**whole.attributes, "parent_id": "\n".join(filter(None, [whole.identity, older]))}
        return cls(points, whole.triangles, density, whole.radius, flags, attributes, whole=whole, kept=kept)

    @cached_property
    def _edges(self) -> Bools:
        return np.asarray(self.kept[self.whole.around.cells_on_edge].any(axis=1))

    @cached_property
    def _vertices(self) -> Bools:
        return np.asarray(self.kept[self.whole.around.cells_on_vertex].any(axis=1))

    @cached_property
    def _turned(self) -> Bools:
        """Which of the edges that are left have lost their first cell."""
        return ~self.kept[self.whole.around.cells_on_edge[self._edges, 0]]

    @cached_property
    def around(self) -> Connectivity:
        """What touches what."""
        old, turned = self.whole.around, self._turned[:, None]
        cell, edge, vertex = (_renumbered(which) for which in (self.kept, self._edges, self._vertices))
        cells, vertices = old.cells_on_edge[self._edges], old.vertices_on_edge[self._edges]
        return Connectivity(
            old.degrees[self.kept],
            cells_on_cell=cell[old.cells_on_cell[self.kept]],
            edges_on_cell=edge[old.edges_on_cell[self.kept]],
            vertices_on_cell=vertex[old.vertices_on_cell[self.kept]],
            cells_on_edge=cell[np.where(turned, cells[:, ::-1], cells)],
            vertices_on_edge=vertex[np.where(turned, vertices[:, ::-1], vertices)],
            cells_on_vertex=cell[old.cells_on_vertex[self._vertices]],
            edges_on_vertex=edge[old.edges_on_vertex[self._vertices]],
        )

    @cached_property
    def geometry(self) -> Geometry:
        """Measures on the unit sphere."""
        old, edges, vertices = self.whole.geometry, self._edges, self._vertices
        angles = old.angles[edges]
        kites = np.where(self.around.cells_on_vertex >= 0, old.kites[vertices], 0.0)
        return Geometry(
            old.vertices[vertices],
            old.edges[edges],
            old.cell_distances[edges],
            old.edge_lengths[edges],
            np.where(self._turned, angles - np.copysign(np.pi, angles), angles),
            kites,
            old.cell_areas[self.kept],
            kites.sum(axis=1),
        )

    @cached_property
    def tangential(self) -> tuple[Indices, Floats]:
        """Edges on edges that are left, and their weights: turned edges count with the other sign."""
        table, weights = (values[self._edges] for values in self.whole.tangential)
        table = _renumbered(self._edges)[table]
        signs = np.append(np.where(self._turned, -1.0, 1.0), 0.0)
        return _those_first(table, signs[:-1, None] * weights * signs[table])


def _renumbered(kept: Bools) -> Indices:
    """Return the new number of each that is kept, and -1 for others; the last is that of -1."""
    return np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1).astype(np.int32)
