"""Outlines as people have them: points, cracks and spikes nearer to each other than anyone means become one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_non_negative, check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Array, Indices, Points
from cvtimg.halfedges import joined_points, unique_edges
from cvtimg.meshes.areas import Areas
from cvtimg.meshes.outlines import ON_LINE

#: Points nearer to each other than this part of the diameter are one. With more, outlines lose what is drawn; with
#: less, digitizing leaves edges that no triangle of a useful size fits: tests/relations/test_outlines.py.
SNAP = 1e-5
#: Passes at most: edges that were bent to a point come near to others.
_PASSES = 8


@dataclass(frozen=True, slots=True)
class Cleaning:
    """What is done to polygons before all else; lengths are in units of their coordinates."""

    snap: float | None = None  # points nearer to each other are one; None for `SNAP` times the diameter
    simplify: float = 0.0  # lines are drawn with fewer points, by moving them about this far
    min_size: float = 0.0  # islands and holes smaller than this are left out; no edge is shorter than half of it
    keep_points: bool = False  # all points that are left are vertices


@dataclass(frozen=True, slots=True)
class OutlineChanges:
    """What polygons lost when they were cleaned.

    Attributes
    ----------
    n_joined : int
        Points that were joined to others, since they were nearer to these than `snap`.
    n_left_out : int
        Islands and holes that were smaller than `min_size`.
    area_change : float
        As a part of the area.
    """

    n_joined: int
    n_left_out: int
    area_change: float


def clean(parts: Array, how: Cleaning) -> tuple[Array, OutlineChanges]:
    """Weld polygons (P,), make them simpler, and leave out details."""
    total, (x0, y0, x1, y1) = float(shapely.area(parts).sum()), shapely.total_bounds(parts)
    diameter = float(np.hypot(x1 - x0, y1 - y0))
    apart = SNAP * diameter if how.snap is None else check_non_negative("snap", how.snap)
    parts, n_joined = weld(shapely.remove_repeated_points(parts), max(apart, ON_LINE * diameter))
    overlap = float(shapely.area(parts).sum()) - (shapely.union_all(parts) if len(parts) > 1 else parts[0]).area
    check_that("parts of the region", overlap <= ON_LINE * total, f"not overlap by more than snap={apart:.2g}")
    n_left_out = 0
    if how.simplify:
        parts = _simplified(parts, how.simplify)
    if how.min_size:
        parts, n_left_out = _without_small(parts, how.min_size)
        parts, _ = weld(_simplified(parts, how.min_size / 2), how.min_size / 2)
    return parts, OutlineChanges(n_joined, n_left_out, float(shapely.area(parts).sum()) / total - 1)


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """Straight edges between points, each once."""

    points: Points  # (N, 2)
    edges: Indices  # (E, 2)

    @classmethod
    def of(cls, parts: object) -> Network:
        """Take the boundaries of polygons."""
        places, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(parts)), return_index=True)
        points, number = np.unique(places, axis=0, return_inverse=True)
        number = number.ravel()
        edges = np.stack([number[:-1], number[1:]], axis=1)[ring[:-1] == ring[1:]]
        return cls(points, edges).once()

    def once(self) -> Network:
        """Leave out edges without a length, and those that are there already."""
        return Network(self.points, unique_edges(self.edges[self.edges[:, 0] != self.edges[:, 1]])[0])

    def ends(self) -> Points:
        """Return both ends (E, 4) of edges, the left one first."""
        return self.points[self.edges].reshape(-1, 4)

    def touching(self, apart: float) -> tuple[Indices, Indices]:
        """Find points nearer than `apart` to an edge that does not end there; return both."""
        tree = shapely.STRtree(shapely.linestrings(self.points[self.edges]))
        used = np.unique(self.edges)
        point, edge = tree.query(shapely.points(self.points[used]), predicate="dwithin", distance=apart)
        point = used[point]
        is_other = (self.edges[edge] != point[:, None]).all(axis=1)
        return point[is_other], edge[is_other]

    def joined(self, apart: float) -> Network:
        """Let points nearer than `apart` to one before them, from left to right, be that one."""
        return Network(self.points, joined_points(self.points, apart)[self.edges]).once()

    def bent(self, point: Indices, edge: Indices) -> Network:
        """Lead edges over the points that touch them."""
        if not len(point):
            return self
        start, step = self.points[self.edges[edge, 0]], np.subtract(*self.points[self.edges[edge][:, ::-1].T])
        order = np.lexsort((((self.points[point] - start) * step).sum(axis=1), edge))
        point, edge = point[order], edge[order]
        places = np.concatenate([self.edges[:, :1].ravel(), point, self.edges[:, 1]])
        of_edge = np.concatenate([np.arange(len(self.edges)), edge, np.arange(len(self.edges))])
        rank = np.repeat([0, 1, 2], [len(self.edges), len(point), len(self.edges)])
        order = np.lexsort((np.arange(len(places)), rank, of_edge))
        places, of_edge = places[order], of_edge[order]
        steps = np.stack([places[:-1], places[1:]], axis=1)[of_edge[1:] == of_edge[:-1]]
        return Network(self.points, steps).once()


def weld(parts: Array, apart: float) -> tuple[Array, int]:
    """Return polygons (P,) no two points of which, and no point and edge, are nearer than `apart`; and points joined.

    All else keeps its coordinates. Polygons that share borders share them still: an empty one has vanished.
    """
    network = given = Network.of(parts)
    for _ in range(_PASSES):
        network = network.joined(apart)
        point, edge = network.touching(apart)
        if not len(point):
            break
        network = network.bent(point, edge)
    n_joined = len(given.points) - len(np.unique(network.edges))
    if len(network.edges) == len(given.edges) and (network.edges == given.edges).all():
        return parts, 0
    # Lines that were bent may cross: they get a point there.
    noded = shapely.union_all(shapely.linestrings(network.points[network.edges]))
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    face, part = shapely.STRtree(parts).query(faces, predicate="intersects")
    shares = shapely.area(shapely.intersection(faces[face], parts[part])) / shapely.area(faces[face])
    is_of = shares > 0.5
    owners = [faces[face[is_of & (part == number)]] for number in range(len(parts))]
    return np.array([shapely.union_all(own) if len(own) else shapely.Polygon() for own in owners]), n_joined


def _without_small(parts: Array, least: float) -> tuple[Array, int]:
    """Leave out islands and holes that a circle of a diameter holds; return how many."""
    left: list[list[Any]] = [[] for _ in parts]
    n_left_out = 0
    for polygon, part in zip(*shapely.get_parts(parts, return_index=True), strict=True):
        rings = shapely.get_rings(polygon)
        is_large = 2 * shapely.minimum_bounding_radius(rings) >= least
        n_left_out += int((~is_large).sum()) if is_large[0] else 1
        if is_large[0]:
            left[part].append(shapely.Polygon(rings[0], rings[1:][is_large[1:]]))
    return np.array([shapely.MultiPolygon(polygons) for polygons in left]), n_left_out


def _simplified(parts: Array, tolerance: float) -> Array:
    """Draw polygons (P,) with fewer points, and move those of new edges by as much as gives each its area."""
    simplify = shapely.simplify if len(parts) == 1 else shapely.coverage_simplify
    found = shapely.orient_polygons(simplify(parts, tolerance))
    before, polygons = shapely.get_parts(parts), shapely.get_parts(found)
    if len(before) != len(polygons):
        return found
    rings, polygon = shapely.get_rings(polygons, return_index=True)
    places, ring = shapely.get_coordinates(rings, return_index=True)
    points, number = np.unique(places, axis=0, return_inverse=True)
    is_step = ring[:-1] == ring[1:]
    steps = np.stack([number.ravel()[:-1], number.ravel()[1:]], axis=1)[is_step]
    edges, which, _ = unique_edges(steps)
    beside = np.zeros((len(edges), 2), np.intp)
    beside[which, np.where(steps[:, 0] < steps[:, 1], 0, 1)] = polygon[ring[:-1][is_step]] + 1
    old = {tuple(ends) for ends in Network.of(parts).ends().tolist()}
    still = edges[[tuple(ends) in old for ends in points[edges].reshape(-1, 4).tolist()]].ravel()
    areas = Areas(beside, np.append(0, shapely.area(before)))
    moved = areas.kept(points, edges, np.arange(len(edges)), np.empty(0, np.intp), still)
    kept = shapely.set_coordinates(found.copy(), moved[number.ravel()])
    return kept if shapely.is_valid(kept).all() else found
