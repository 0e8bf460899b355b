"""A triangulation whose borders stay: made once, and from then on only vertices move and edges flip."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

import cvtimg.meshes._meshes as _meshes
from cvtimg._shared.extras import optional
from cvtimg._shared.types import Bools, Floats, Indices, Ints, Points, Triangles
from cvtimg.halfedges import MOST_FLIPS, EdgeTable, HalfEdges, connected_parts, edge_keys, find_twins, measure_triangles
from cvtimg.meshes.outlines import StraightParts, cross

#: Smoothing lowers the sum of the shapes of triangles to this power: the larger, the more the worst counts.
_POWER = 16
#: No move leaves a triangle with less than this part of its area: with more, vertices are held where they are.
LEAST_AREA_LEFT = 0.1
#: How vertices move.
FREE, FIXED, SLIDES = 0, 1, 2
NO_EDGES: Triangles = np.empty((0, 2), np.int32)


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Points and edges that a triangulation must have."""

    points: Points  # (B, 2)
    edges: Triangles  # (E, 2): indices of points
    # (E, 2): labels on both sides of each edge from a to b: where the cross product of b - a and the step to it is
    # positive, and where it is negative. Labels <= 0 are outside.
    sides: Triangles
    corners: Bools  # (B,): points that stay where the others move to keep areas
    of_line: Indices | None = None  # (E,): the line of the outline that each edge is on
    slides: Ints = field(default_factory=lambda: np.empty(0, np.int32))  # Points (S,) that may slide along lines

    def chain(self, line: int) -> Ints:
        """Return the points (C,) along a line."""
        own = self.edges[self.of_line == line]
        return np.append(own[:, 0], own[-1:, 1])


class PlaneTriangulation(HalfEdges):
    """Triangles of the plane; `points` change in place.

    Attributes
    ----------
    fixed : (N,) uint8 array
        `FREE`, `FIXED` or `SLIDES`.
    corners : (N,) bool array
        Those of the borders.
    tags : (T,) int32 array
        Label of the side of the border that each triangle is on; flips do not change it.
    borders : (T, 3) uint8 array
        Whether each edge stays.
    outgoing : (N,) int32 array
        A half-edge out of each vertex.
    """

    def __init__(self, points: Points, triangles: Triangles, n_fixed: int = 0, edges: Triangles = NO_EDGES) -> None:
        super().__init__(points, triangles)
        self.fixed = (np.arange(len(points)) < n_fixed).astype(np.uint8)
        self.corners = np.zeros(len(points), bool)
        self.tags = np.ones(len(triangles), np.int32)
        self._mark(edges)

    @classmethod
    def constrained(cls, borders: Borders, inner: Points) -> PlaneTriangulation:
        """Triangulate borders and inner points; keep what is inside, and tag it by the sides of the borders."""
        points = np.concatenate([borders.points, inner])
        triangles = delaunay(points, borders.edges)
        # In the order of the inner points, which is along a curve: neighbors are near in memory.
        triangles = triangles[np.argsort(triangles.max(axis=1))]
        mesh = cls(points, triangles, len(borders.points), borders.edges)
        mesh.corners[: len(borders.points)] = borders.corners
        mesh.fixed[borders.slides] = SLIDES
        mesh._tag(borders)
        inside = mesh.tags > 0
        if not inside.all():
            mesh._keep(inside, borders.edges)
        return mesh

    def flip(self, metric: Points | None) -> None:
        """Flip edges until the triangulation is Delaunay, but for its borders."""
        _meshes.flip(self, metric, MOST_FLIPS * len(self.triangles))

    def moments(self, metric: Points) -> tuple[float, Points, Points]:
        """Compute the energy of the cells, mass times metric (N, 3), and that times the steps to centroids (N, 2)."""
        return _meshes.sum_cells(self, metric)

    def move(self, steps: Points, moving: Bools | None = None, *, whole: bool = False) -> None:
        """Move vertices by (N, 2) steps, or by parts of them where a triangle would turn over.

        Those that are `moving` (N,) do, by default the free ones; if asked by the whole step or not at all.
        """
        part = np.where(self.fixed == FREE if moving is None else moving, 1.0, 0.0)[:, None]
        least = LEAST_AREA_LEFT * self._areas(self.points)
        while True:
            bad = self.triangles[self._areas(self.points + part * steps) < least]
            if not part[bad].any():
                break
            part[bad] = np.where((part[bad] > 1 / 32) & (not whole), part[bad] / 2, 0)
        self.points += part * steps

    def _areas(self, points: Points) -> Floats:
        """Return twice the areas of triangles between points (N, 2)."""
        a, b, c = (points[self.triangles[:, k]] for k in range(3))
        return cross(b - a, c - a)

    def even(self, metric: Points, lines: StraightParts | None = None, share: float = 1.0) -> None:
        """Move vertices so that the edges at each, above all the worst, get nearer to the mean length in a metric.

        They make a share of the best steps; those that slide stay on the lines. The metric (N, 3) is of sizes alone.
        """
        worth, (a, b) = np.ascontiguousarray(metric[:, 0]), self.edges[self._each_once()].T
        mean = float(((worth[a] + worth[b]) / 2 * ((self.points[a] - self.points[b]) ** 2).sum(axis=1)).mean())
        steps, sliding = np.zeros_like(self.points), np.flatnonzero(self.fixed == SLIDES)
        if lines is not None:  # along the chord between the vertices before and after on the border
            ends = np.concatenate([self.border_edges(), self.border_edges()[:, ::-1]])
            beside = ends[np.argsort(ends[:, 0], kind="stable")]
            first = np.searchsorted(beside[:, 0], sliding)
            chords = self.points[beside[first, 1]] - self.points[beside[first + 1, 1]]
            steps[sliding] = chords / np.linalg.norm(chords, axis=1, keepdims=True)
        _meshes.even(self, worth, self.fixed, steps, mean, share)
        if lines is not None:
            steps[sliding] = lines.feet(self.points[sliding] + steps[sliding]) - self.points[sliding]
            self.move(steps, self.fixed == SLIDES, whole=True)

    def smooth(self, among: Bools | None = None) -> None:
        """Move vertices, or some of them (N,), so that triangles around get more equilateral, above all the worst."""
        fixed = self.fixed if among is None else np.where(among, self.fixed, FIXED).astype(np.uint8)
        _meshes.smooth(self, fixed, _POWER)

    def has_angles_below(self, least: float) -> Bools:
        """Tell which vertices (N,) are corners of triangles with an angle below this, in degrees."""
        is_corner = np.zeros(len(self.points), bool)
        is_corner[self.triangles[measure_triangles(self.points, self.triangles).least_angles < least]] = True
        return is_corner

    def locate(self, places: Points, near: Triangles | None = None) -> tuple[Triangles, Points]:
        """Walk to the triangles of (M, 2) places; return them and barycentric coordinates.

        Walks begin at vertices nearby, or at the place before.
        """
        triangles = np.full(len(places), -1, np.int32) if near is None else self.outgoing[near] // 3
        return triangles, _meshes.locate(self, np.ascontiguousarray(places), triangles)

    def half_edges_on_borders(self) -> Indices:
        """Return one half-edge (E,) of each edge that stays."""
        return np.flatnonzero(self._each_once() & (self.borders.ravel() > 0))

    def border_edges(self) -> Triangles:
        """Return the (E, 2) edges that stay, each once."""
        return self.edges[self.half_edges_on_borders()]

    def _each_once(self) -> Bools:
        """Select one half-edge of each edge."""
        return self.twins.ravel() < np.arange(self.twins.size)

    def _mark(self, edges: Triangles) -> None:
        n, n_edges = len(self.points), self.triangles.size
        stays = self.twins.ravel() < 0
        on_border = np.zeros(n, bool)
        on_border[edges] = True
        maybe = np.flatnonzero(on_border[self.edges].all(axis=1))
        stays[maybe] |= np.isin(edge_keys(self.edges[maybe], n), edge_keys(edges, n))
        self.borders = stays.astype(np.uint8).reshape(-1, 3)
        self.outgoing = np.full(n, -1, np.int32)
        self.outgoing[self.triangles.ravel()] = np.arange(n_edges)

    def _tag(self, borders: Borders) -> None:
        """Give the triangles between borders the label beside the longest edge around them; 0 if there is none."""
        n = len(self.points)
        free = np.flatnonzero((self.borders.ravel() == 0) & (self.twins.ravel() >= 0))
        n_parts, part = connected_parts((free // 3, self.twins.ravel()[free] // 3), len(self.triangles))
        at = EdgeTable(borders.edges, n).find(self.edges)
        known, forth = at >= 0, borders.edges[at, 0] == self.edges[:, 0]
        lengths = np.linalg.norm(np.subtract(*self.points[self.edges.T]), axis=1)
        order = np.flatnonzero(known)[np.argsort(lengths[known], kind="stable")]
        tags = np.zeros(n_parts, np.int32)
        tags[part[order // 3]] = np.maximum(borders.sides[at, np.where(forth, 0, 1)], 0)[order]
        self.tags = tags[part]

    def _keep(self, kept: Bools, edges: Triangles) -> None:
        """Leave out triangles, and vertices that have none then."""
        used = np.zeros(len(self.points), bool)
        used[self.triangles[kept]] = True
        number = np.cumsum(used, dtype=np.int32) - 1
        self.tags = self.tags[kept]
        self.points, self.fixed = np.ascontiguousarray(self.points[used]), self.fixed[used]
        self.corners = self.corners[used]
        self.triangles = number[self.triangles[kept]]
        self.twins = find_twins(self.triangles, len(self.points))
        self._mark(number[edges[used[edges].all(axis=1)]])


def delaunay(points: Points, edges: Triangles | None = None) -> Triangles:
    """Compute the (constrained) Delaunay triangulation of the convex hull of (N, 2) points: (T, 3) indices."""
    cdt = optional("pythoncdt", "mesh", "meshes need")
    mesh: Any = cdt.Triangulation(cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0)
    mesh.insert_vertices(np.ascontiguousarray(points, np.float64))
    if edges is not None and len(edges):
        mesh.insert_edges(np.ascontiguousarray(edges, np.uint32))
    mesh.erase_super_triangle()
    table = mesh.triangles_array()
    return np.ascontiguousarray(table[table.dtype.names[0]], np.int32)
