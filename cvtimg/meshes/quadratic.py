"""Triangles with six nodes, whose sides on borders are parabolas through the outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvtimg._shared.extras import shapely
from cvtimg._shared.records import ReadOnly
from cvtimg._shared.types import Bools, Floats, Indices, Ints, Points
from cvtimg.halfedges import EdgeTable, edges_around, measure_triangles, unique_edges
from cvtimg.labels.contours import OUTSIDE
from cvtimg.meshes.outlines import ON_LINE, Outline, StraightParts, cross
from cvtimg.meshes.triangulation import LEAST_AREA_LEFT


@dataclass(frozen=True, slots=True, eq=False)
class QuadraticTriangles(ReadOnly):
    """Triangles with six nodes.

    Attributes
    ----------
    nodes : (M, 2) float64 array
        The vertices of the mesh, and then one node for each edge: on a border it is on the outline, halfway between the
        ends, elsewhere in the middle.
    triangles : (T, 6) int32 array
        Indices of nodes: the corners, and the nodes of the edges from the first to the second, from that to the third,
        and back; the order of VTK, Gmsh and Abaqus.
    edges : (E, 3) int32 array
        The ends and the node of each edge on a border, as in `Mesh.edges`.
    n_straight : int
        Number of edges on borders that were kept straight, for a triangle would have folded over, or nearly.
    pairs : (P, 2) int32 array or None
        Nodes on periodic sides, as `Mesh.pairs`.
    """

    nodes: Points
    triangles: Ints
    edges: Ints
    n_straight: int
    pairs: Ints | None = None

    @property
    def jacobians(self) -> Points:
        """Bernstein coefficients (T, 6) of the determinants of Jacobians, between which these lie everywhere."""
        return _jacobians(self.nodes, self.triangles)

    @property
    def areas(self) -> Floats:
        """Areas of triangles (T,)."""
        return self.jacobians.mean(axis=1) / 2


def quadratic(points: Points, triangles: Ints, edges: Ints, outline: Outline) -> QuadraticTriangles:
    """Make triangles with six nodes of triangles whose border edges (E, 2) have their ends on an outline, or nearly."""
    n = len(points)
    half_edges = edges_around(triangles)
    each_once, which, _ = unique_edges(half_edges)
    border = EdgeTable(edges, n).find(each_once)
    number = n + EdgeTable(each_once, n).find(edges).astype(np.int32)
    all_six = np.concatenate([triangles, (n + which.reshape(-1, 3)).astype(np.int32)], axis=1)
    with_middles = np.concatenate([edges, number[:, None]], axis=1)
    ways = _Ways.of(outline, points[edges])
    bent = _Bent(all_six, each_once, border)
    places = _snapped(points, triangles, edges, ways)
    bends = np.where(ways.found[:, None], ways.middles - places[edges].mean(axis=1), 0)
    straight = ~ways.found | bent.straighten(places, bends)
    # Edges that are made straight take area from a segment: others give it back, until none folds a triangle.
    for _ in range(4 if outline.mask is not None and outline.areas is not None else 0):
        there, bends_there = _with_areas(places, bends, edges, outline, ways, straight)
        folded = bent.straighten(there, bends_there)
        if (_jacobians(bent.nodes(there, bends_there), all_six) <= 0).any():  # so narrow are triangles there
            break
        places, bends, straight = there, bends_there, straight | folded
        if not folded.any():
            break
    return QuadraticTriangles(bent.nodes(places, bends), all_six, with_middles, int(straight.sum()))


@dataclass(frozen=True, slots=True, eq=False)
class _Bent:
    """How all edges bend with those on borders."""

    triangles: Ints  # (T, 6)
    edges: Ints  # (M, 2): the ends of all edges
    as_border: Indices  # (M,): the number of the border edge that each bends with, or -1

    def nodes(self, places: Points, bends: Points) -> Points:
        """Return all nodes for vertices (N, 2) and the way (E, 2) of the nodes of border edges from their middle."""
        middles = places[self.edges].mean(axis=1)
        middles[self.as_border >= 0] += bends[self.as_border[self.as_border >= 0]]
        return np.concatenate([places, middles])

    def straighten(self, places: Points, bends: Points) -> Bools:
        """Make border edges straight, in place, where triangles fold over or nearly; return which (E,)."""
        straight = np.zeros(len(bends), bool)
        while True:
            jacobians = _jacobians(self.nodes(places, bends), self.triangles)
            bad = self.triangles[jacobians.min(axis=1) < LEAST_AREA_LEFT * jacobians.mean(axis=1), 3:] - len(places)
            new = np.zeros(len(bends) + 1, bool)
            new[self.as_border[bad]] = True  # the last is for none
            new = new[:-1] & ~straight
            if not new.any():
                return straight
            bends[new] = 0
            straight |= new


@dataclass(frozen=True, slots=True, eq=False)
class _Ways:
    """Where edges are along the lines of an outline."""

    line: Indices  # (E,)
    ends: Points  # (E, 2, 2): the places on the lines nearest to the ends
    middles: Points  # (E, 2): the places halfway between these
    off: Bools  # (E, 2): ends that are not on the line
    last: Bools  # (E, 2): ends that are ends of the line, too
    found: Bools  # (E,): edges that follow their line, from near to it and not by a detour, rather than that of another
    back: Bools  # (E,): edges that run against it

    @classmethod
    def of(cls, outline: Outline, ends: Points) -> _Ways:
        parts = StraightParts.of(outline.lines)
        line = parts.of_line[parts.nearest(ends.mean(axis=1))[0]]
        strings = np.array([shapely.LineString(line) for line in outline.lines])[line]
        places = shapely.points(ends)
        along = shapely.line_locate_point(strings[:, None], places)
        gaps = shapely.distance(strings[:, None], places)
        lengths, closed = shapely.length(strings), shapely.is_closed(strings)
        ways = np.diff(along, axis=1)[:, 0]
        ways -= np.where(closed, np.rint(ways / lengths) * lengths, 0)
        middles = along[:, 0] + ways / 2
        middles -= np.where(closed, np.floor(middles / lengths) * lengths, 0)
        chords = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)

        def at(where: Floats) -> Points:
            foot: Points = shapely.get_coordinates(shapely.line_interpolate_point(strings, where))
            return foot

        return cls(
            line,
            np.stack([at(along[:, 0]), at(along[:, 1])], axis=1),
            at(middles),
            gaps > ON_LINE * outline.diameter,
            ((along == 0) | (along == lengths[:, None])) & ~closed[:, None],
            (gaps <= 0.3 * chords[:, None]).all(axis=1) & (np.abs(ways) <= 2 * chords),
            ways < 0,
        )


def _snapped(points: Points, triangles: Ints, edges: Ints, ways: _Ways) -> Points:
    """Move vertices that are off the outline to it, but where a triangle would get too small."""
    moves = ways.off & ways.found[:, None]
    moved = points.copy()
    moved[edges[moves]] = ways.ends[moves]
    least = LEAST_AREA_LEFT * measure_triangles(points, triangles).areas
    while True:
        a, b, c = moved[triangles].transpose(1, 0, 2)
        small = cross(b - a, c - a) / 2 < least
        if not small.any():
            return moved
        moved[triangles[small]] = points[triangles[small]]


def _with_areas(
    places: Points, bends: Points, edges: Ints, outline: Outline, ways: _Ways, straight: Bools
) -> tuple[Points, Points]:
    """Move vertices and nodes on borders, but not at straight edges, by the least that gives segments their areas."""
    assert outline.areas is not None
    a, b = np.where(ways.back[:, None], edges[:, ::-1], edges).T
    middle = len(places) + np.arange(len(edges))
    # A parabola encloses 4/3 of what the two chords over its middle do: so these do, too, with the middle farther out.
    nodes = np.concatenate([places, (places[a] + places[b]) / 2 + 4 / 3 * bends])
    halves = np.stack([np.concatenate([a, middle]), np.concatenate([middle, b])], axis=1)
    on_rim = straight | (outline.sides[ways.line] == OUTSIDE).any(axis=1)
    asked = np.isin(outline.ends[ways.line], outline.still) & ways.last
    still = np.concatenate([edges[on_rim].ravel(), middle[on_rim], edges[asked]])
    kept = outline.areas.kept(nodes, halves, np.tile(ways.line, 2), np.unique(edges[ways.last]), still)
    return kept[: len(places)], 3 / 4 * (kept[middle] - (kept[a] + kept[b]) / 2)


def _jacobians(nodes: Points, triangles: Ints) -> Points:
    """Bernstein coefficients (T, 6) of the determinants of Jacobians: at corners, and between each two of them."""
    corners, middles = nodes[triangles[:, :3]], nodes[triangles[:, 3:]]
    bends = 2 * middles - (corners + np.roll(corners, -1, axis=1)) / 2
    (a, b, c), (ab, bc, ca) = corners.transpose(1, 0, 2), bends.transpose(1, 0, 2)
    # Derivatives at the corners on the way from a to b, and from a to c, which are linear in between.
    u, v = 2 * np.stack([ab - a, b - ab, bc - ca]), 2 * np.stack([ca - a, bc - ab, c - ca])
    both = u[:, None, :, 0] * v[None, :, :, 1] - u[:, None, :, 1] * v[None, :, :, 0]
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)]
    return np.stack([(both[i, j] + both[j, i]) / 2 for i, j in pairs], axis=1)
