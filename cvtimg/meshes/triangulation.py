"""A triangulation whose borders stay: made once, and from then on only vertices move and edges flip."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.extras import needs
from cvtimg.halfedges import EdgeTable, HalfEdges, edge_keys, find_twins
from cvtimg.meshes import _meshes
from cvtimg.meshes.fields import lengths_of

Points = NDArray[np.float64]
Triangles = NDArray[np.int32]

#: Flips at most, for each triangle: in a metric that varies, flips might never end.
_MOST_FLIPS = 20
#: How vertices move.
FREE, FIXED, SLIDES = 0, 1, 2


def places_at(at: NDArray[np.float64], lengths: NDArray[np.float64], places: Points) -> Points:
    """Return the places (..., 2) at lengths along a line over (P, 2) places, with the lengths (P,) until there."""
    return np.stack([np.interp(at, lengths, places[:, axis]) for axis in (0, 1)], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Lines, and the vertices that slide along them."""

    vertices: NDArray[np.int32]  # (S,)
    along: NDArray[np.float64]  # (S,): where they are: the length along all lines, one after the other
    reach: Points  # (S, 2): the least and the greatest value that `along` may have
    # (P, 2): points of the lines, and the lengths until there.
    places: Points
    lengths: NDArray[np.float64]
    periods: NDArray[np.float64]  # (S,): lengths of closed lines, which go on at their start; 0 for vertices of others
    starts: NDArray[np.float64]  # (S,): where the line of each vertex starts

    def tangents(self) -> Points:
        """Return the directions (S, 2) of the lines where the vertices are."""
        at = np.searchsorted(self.lengths, self._on_line(self.along), side="right")
        at = np.clip(at, 1, len(self.lengths) - 1)
        steps = self.places[at] - self.places[at - 1]
        return steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-300)

    def moved(self, by: NDArray[np.float64]) -> Tracks:
        """Return the tracks with vertices moved by lengths (S,), as far as they may."""
        return replace(self, along=np.clip(self.along + by, *self.reach.T))

    def kept(self, kept: NDArray[np.bool_], number: NDArray[np.int32] | None = None) -> Tracks:
        """Return the tracks of some of the vertices (S,), with new numbers (N,) of all vertices."""
        vertices = self.vertices[kept]
        return replace(
            self,
            vertices=vertices if number is None else number[vertices],
            along=self.along[kept],
            reach=self.reach[kept],
            periods=self.periods[kept],
            starts=self.starts[kept],
        )

    def points(self) -> Points:
        """Return where the vertices are, (S, 2)."""
        return places_at(self._on_line(self.along), self.lengths, self.places)

    def _on_line(self, along: NDArray[np.float64]) -> NDArray[np.float64]:
        """Go around closed lines."""
        periods = np.where(self.periods > 0, self.periods, np.inf)
        since = along - self.starts
        return along - np.floor(since / periods) * self.periods


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Points and edges that a triangulation must have."""

    points: Points  # (B, 2)
    edges: Triangles  # (E, 2): indices of points
    # (E, 2): labels on both sides of each edge from a to b: where the cross product of b - a and the step to it is
    # positive, and where it is negative. Labels <= 0 are outside.
    sides: Triangles
    corners: NDArray[np.bool_]  # (B,): points that stay where the others move to keep areas
    of_line: NDArray[np.intp] | None = None  # (E,): the line of the outline that each edge is on
    tracks: Tracks | None = None  # Along which some of the points may slide

    def chain(self, line: int) -> NDArray[np.int32]:
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
    tracks : Tracks or None
        Of the vertices that slide.
    tags : (T,) int32 array
        Label of the side of the border that each triangle is on; flips do not change it.
    borders : (T, 3) uint8 array
        Whether each edge stays.
    outgoing : (N,) int32 array
        A half-edge out of each vertex.
    """

    def __init__(self, points: Points, fixed: NDArray[np.bool_], triangles: Triangles, edges: Triangles) -> None:
        super().__init__(points, triangles)
        self.fixed = fixed.astype(np.uint8)
        self.corners = np.zeros(len(points), bool)
        self.tracks: Tracks | None = None
        self.tags = np.ones(len(triangles), np.int32)
        self._mark(edges)

    @classmethod
    def constrained(cls, borders: Borders, inner: Points) -> PlaneTriangulation:
        """Triangulate borders and inner points; keep what is inside, and tag it by the sides of the borders."""
        points = np.concatenate([borders.points, inner])
        fixed = np.arange(len(points)) < len(borders.points)
        triangles = delaunay(points, borders.edges)
        # In the order of the inner points, which is along a curve: neighbors are near in memory.
        triangles = triangles[np.argsort(triangles.max(axis=1))]
        mesh = cls(points, fixed, triangles, borders.edges)
        mesh.corners[: len(borders.points)] = borders.corners
        if borders.tracks is not None:
            mesh.tracks = borders.tracks
            mesh.fixed[mesh.tracks.vertices] = SLIDES
        mesh._tag(borders)
        inside = mesh.tags > 0
        if not inside.all():
            mesh._keep(inside, borders.edges)
        return mesh

    def flip(self, metric: Points | None) -> None:
        """Flip edges until the triangulation is Delaunay, but for its borders."""
        _meshes.flip(self, metric, _MOST_FLIPS * len(self.triangles))

    def moments(self, metric: Points) -> tuple[float, Points, Points]:
        """Compute the energy of the cells, mass times metric (N, 3), and that times the steps to centroids (N, 2)."""
        return _meshes.sum_cells(self, metric)

    def move(self, steps: Points, fixed: NDArray[np.uint8] | None = None) -> Points:
        """Move vertices by (N, 2) steps, or by parts of them where a triangle would turn over; return what was done.

        Those in `fixed` (N,) stay, if that is given, instead of those on borders.
        """
        done = steps.copy()
        _meshes.move(self, self.fixed if fixed is None else fixed, done)
        return done

    def even(self, metric: Points, share: float = 1.0) -> None:
        """Move vertices so that the edges at each, above all the worst, get nearer to the mean length in a metric.

        They make a share of the best steps. Those on borders slide along them, as far as their tracks lead.
        """
        a, b = self.edges[self._each_once()].T
        mean = float((lengths_of((metric[a] + metric[b]) / 2, self.points[a] - self.points[b]) ** 2).mean())
        steps = np.zeros_like(self.points)
        tracks = self.tracks
        if tracks is not None:
            tangents = steps[tracks.vertices] = tracks.tangents()
        _meshes.even(self, metric, self.fixed, steps, mean, share)
        if tracks is None:
            return
        moved = tracks.moved((steps[tracks.vertices] * tangents).sum(axis=1))
        steps[tracks.vertices] = moved.points() - self.points[tracks.vertices]
        _meshes.move(self, np.maximum(self.fixed, FIXED), steps)
        stayed = (steps[tracks.vertices] == 0).all(axis=1)
        self.tracks = replace(moved, along=np.where(stayed, tracks.along, moved.along))

    def smooth(self, metric: Points, power: int) -> None:
        """Move vertices so that the triangles around each, above all the worst, get more equilateral in its metric."""
        _meshes.smooth(self, metric, self.fixed, power)

    def locate(self, places: Points, near: Triangles | None = None) -> tuple[Triangles, Points]:
        """Walk to the triangles of (M, 2) places; return them and barycentric coordinates.

        Walks begin at vertices nearby, or at the place before.
        """
        found = np.full(len(places), -1, np.int32) if near is None else self.outgoing[near] // 3
        return found, _meshes.locate(self, np.ascontiguousarray(places), found)

    def state(self) -> tuple[NDArray[Any], ...]:
        """Return a copy of all that moves and flips change."""
        return tuple(each.copy() for each in (self.points, self.triangles, self.twins, self.borders, self.outgoing))

    def restore(self, state: tuple[NDArray[Any], ...]) -> None:
        """Go back to what `state` returned."""
        self.points, self.triangles, self.twins, self.borders, self.outgoing = state

    def half_edges_on_borders(self) -> NDArray[np.intp]:
        """Return one half-edge (E,) of each edge that stays."""
        return np.flatnonzero(self._each_once() & (self.borders.ravel() > 0))

    def border_edges(self) -> Triangles:
        """Return the (E, 2) edges that stay, each once."""
        return self.edges[self.half_edges_on_borders()]

    def _each_once(self) -> NDArray[np.bool_]:
        """Select one half-edge of each edge."""
        return self.twins.ravel() < np.arange(self.twins.size)

    def _mark(self, edges: Triangles) -> None:
        """Mark the edges that stay."""
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
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n, n_triangles = len(self.points), len(self.triangles)
        free = np.flatnonzero((self.borders.ravel() == 0) & (self.twins.ravel() >= 0))
        links = coo_array(
            (np.ones(len(free), np.int8), (free // 3, self.twins.ravel()[free] // 3)), (n_triangles, n_triangles)
        )
        n_parts, part = connected_components(links, directed=False)
        at = EdgeTable(borders.edges, n).find(self.edges)
        known, forth = at >= 0, borders.edges[at, 0] == self.edges[:, 0]
        lengths = np.linalg.norm(np.subtract(*self.points[self.edges.T]), axis=1)
        order = np.flatnonzero(known)[np.argsort(lengths[known], kind="stable")]
        tags = np.zeros(n_parts, np.int32)
        tags[part[order // 3]] = np.maximum(borders.sides[at, np.where(forth, 0, 1)], 0)[order]
        self.tags = tags[part]

    def _keep(self, kept: NDArray[np.bool_], edges: Triangles) -> None:
        """Leave out triangles, and vertices that have none then."""
        used = np.zeros(len(self.points), bool)
        used[self.triangles[kept]] = True
        number = np.cumsum(used, dtype=np.int32) - 1
        tags = self.tags[kept]
        if self.tracks is not None:
            self.tracks = self.tracks.kept(used[self.tracks.vertices], number)
        self.points, self.fixed = np.ascontiguousarray(self.points[used]), self.fixed[used]
        self.corners = self.corners[used]
        self.triangles = number[self.triangles[kept]]
        self.twins = find_twins(self.triangles, len(self.points))
        self._mark(number[edges[used[edges].all(axis=1)]])
        self.tags = tags


def delaunay(points: Points, edges: Triangles | None = None) -> Triangles:
    """Compute the (constrained) Delaunay triangulation of the convex hull of (N, 2) points: (T, 3) indices."""
    try:
        import pythoncdt as cdt
    except ImportError as error:
        raise ImportError(f"meshes need {needs('PythonCDT', 'mesh')}") from error
    found: Any = cdt.Triangulation(cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0)
    found.insert_vertices(np.ascontiguousarray(points, np.float64))
    if edges is not None and len(edges):
        found.insert_edges(np.ascontiguousarray(edges, np.uint32))
    found.erase_super_triangle()
    table = found.triangles_array()
    return np.ascontiguousarray(table[table.dtype.names[0]], np.int32)
