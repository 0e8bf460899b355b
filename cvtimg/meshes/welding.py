"""Outlines as people have them: points, cracks and spikes nearer to each other than anyone means become one."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_non_negative, check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Array
from cvtimg.halfedges import unique_edges
from cvtimg.meshes.areas import Areas
from cvtimg.meshes.outlines import ON_LINE

#: Points nearer to each other than this part of the diameter are one. With more, outlines lose what is drawn; with
#: less, digitizing leaves edges that no triangle of a useful size fits: tests/relations/test_outlines.py.
SNAP = 1e-5
#: Ends are cut off that have more area than this, by the square of their width.
_TIP = 0.5


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
    first, second = shapely.STRtree(parts).query(parts, predicate="intersects")
    both = shapely.buffer(shapely.intersection(parts[first], parts[second])[first < second], -apart / 2)
    check_that("parts of the region", shapely.is_empty(both).all(), f"not overlap by more than snap={apart:.2g}")
    given, parts = parts, weld(parts, max(apart, ON_LINE * diameter))
    n_joined = n_points(given) - n_points(parts)
    n_left_out = 0
    if how.simplify:
        parts = _simplified(parts, how.simplify)
    if how.min_size:
        parts, n_left_out = _without_small(parts, how.min_size)
        parts = _simplified(parts, how.min_size / 2)
        parts = _without_tips(parts, how.min_size) if len(parts) == 1 else parts
        parts = weld(parts, how.min_size / 2)
    return parts, OutlineChanges(max(n_joined, 0), n_left_out, float(shapely.area(parts).sum()) / total - 1)


def weld(parts: Array, apart: float) -> Array:
    """Return polygons (P,) no two points of which, and no point and edge, are nearer than `apart`.

    Polygons that share borders share them still: an empty one has vanished. Gaps that are thinner are closed.
    """
    welded = np.asarray(shapely.coverage_clean(parts, gap_width=apart, snapping_distance=apart))
    same = shapely.equals_exact(shapely.normalize(welded), shapely.normalize(parts), 0)
    return np.where(same, parts, welded)  # rings that are right begin where they did


def n_points(parts: Array) -> int:
    """Count the points of polygons (P,), those that are shared once."""
    return len(np.unique(shapely.get_coordinates(parts), axis=0))


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


def _without_tips(parts: Array, least: float) -> Array:
    """Cut off the ends of bays and spits where these are narrower: edges across would be shorter."""
    inner = shapely.buffer(parts, -least / 2, join_style="mitre")
    lost = shapely.get_parts(parts - shapely.buffer(inner, least / 2, join_style="mitre", mitre_limit=1))
    lost = lost[shapely.area(lost) > _TIP * least**2]
    return parts - shapely.union_all(lost)


def _simplified(parts: Array, tolerance: float) -> Array:
    """Draw polygons (P,) with fewer points, and move those of new edges by as much as gives each its area."""
    simplify = shapely.simplify if len(parts) == 1 else shapely.coverage_simplify
    simpler = shapely.orient_polygons(simplify(parts, tolerance))
    before, polygons = shapely.get_parts(parts), shapely.get_parts(simpler)
    if len(before) != len(polygons):
        return simpler
    rings, polygon = shapely.get_rings(polygons, return_index=True)
    places, ring = shapely.get_coordinates(rings, return_index=True)
    points, number = np.unique(places, axis=0, return_inverse=True)
    is_step = ring[:-1] == ring[1:]
    steps = np.stack([number.ravel()[:-1], number.ravel()[1:]], axis=1)[is_step]
    edges, which, _ = unique_edges(steps)
    beside = np.zeros((len(edges), 2), np.intp)
    beside[which, np.where(steps[:, 0] < steps[:, 1], 0, 1)] = polygon[ring[:-1][is_step]] + 1
    given, ring = shapely.get_coordinates(shapely.get_rings(before), return_index=True)
    both = np.concatenate([given[:-1], given[1:]], axis=1)[ring[:-1] == ring[1:]]
    old = {tuple(ends) for way in (both, both[:, [2, 3, 0, 1]]) for ends in way.tolist()}
    still = edges[[tuple(ends) in old for ends in points[edges].reshape(-1, 4).tolist()]].ravel()
    areas = Areas(beside, np.append(0, shapely.area(before)))
    moved = areas.kept(points, edges, np.arange(len(edges)), np.empty(0, np.intp), still)
    kept = shapely.set_coordinates(simpler.copy(), moved[number.ravel()])
    return kept if shapely.is_valid(kept).all() else simpler
