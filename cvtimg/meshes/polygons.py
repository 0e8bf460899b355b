"""Outlines of polygons, which may touch: of one region, or of several parts that share borders.

Points, cracks and spikes nearer to each other than anyone means become one first.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_non_negative, check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Array, Bools, Indices, Points
from cvtimg.halfedges import unique_edges
from cvtimg.meshes.areas import Areas
from cvtimg.meshes.outlines import CLEAR_CORNER, ON_LINE, TOLERANCE, Outline, label_outline, split_line, turns_of
from cvtimg.placement import Box, PictureRegion, PolygonRegion, Region
from cvtimg.placement.polygons import SMOOTH

#: Points nearer to each other than this part of the diameter are one. With more, outlines lose what is drawn; with
#: less, digitizing leaves edges that no triangle of a useful size fits: tests/relations/test_outlines.py.
SNAP = 1e-5
#: Ends are cut off that have more area than this, by the square of their width.
_TIP = 0.5
#: Where the boundary of a polygon turns by more than `SMOOTH`, it has a corner that stays; `CLEAR_CORNER` is enough
#: between two sides longer than this part of the diameter, for these are no samples of a curve.
_LONG = 0.1


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


def outline_of(region: Region, how: Cleaning) -> Outline:
    """Return the outline of a region: contours of masks are smoothed, polygons are cleaned."""
    check_that(repr(region), region.n_dims == 2, "be in the plane")
    if isinstance(region, PictureRegion):
        check_that("keep_points", not how.keep_points, "be False: contours of masks have no points to keep")
        return label_outline(region.mask.astype(np.int32), None, TOLERANCE)
    if isinstance(region, Box) and any(region.periodic):
        raise ValueError(f"{region!r} must not be periodic: a mesh needs a boundary")
    return outline_of_parts([region], replace(how, min_size=0.0) if isinstance(region, Box) else how)


def outline_of_parts(regions: Sequence[Region], how: Cleaning) -> Outline:
    """Return the borders of regions, which have the labels 1, 2, ..., and share those between them."""
    parts, changes = clean(np.array([PolygonRegion(region.outline()).geometry for region in regions]), how)
    whole = parts[0] if len(parts) == 1 else shapely.union_all(parts)
    check_that("min_size" if how.min_size else "snap", whole.area > 0, "be less: nothing of the region is left")
    polygons, part = shapely.get_parts(parts, return_index=True)
    rings, polygon = shapely.get_rings(shapely.orient_polygons(polygons), return_index=True)
    lines, faces = _lines([shapely.get_coordinates(ring) for ring in rings], polygon, how.keep_points)
    labels = np.concatenate([[0], part + 1, np.zeros(len(rings), np.intp)]).astype(np.int32)
    bounds, areas = np.array(whole.bounds).reshape(2, 2), Areas.of(lines, faces)
    about = labels[faces], bounds, None, PolygonRegion(whole).contains, areas
    return Outline.of(lines, *about, polygons=whole, changes=changes)


def _lines(rings: list[Points], polygon: Indices, keep_points: bool) -> tuple[list[Points], Indices]:
    """Cut rings, with their polygon (R,) on the left, at corners, and where others leave or join them.

    Returns each line once, and the faces (M, 2) on both of its sides: polygons from 1, and then holes; 0 outside.
    """
    places, number = np.unique(np.concatenate([ring[:-1] for ring in rings]), axis=0, return_inverse=True)
    of_ring = np.repeat(np.arange(len(rings)), [len(ring) - 1 for ring in rings])
    numbers = np.split(number.ravel(), np.flatnonzero(np.diff(of_ring)) + 1)
    steps = np.concatenate([np.stack([ring, np.roll(ring, -1)], axis=1) for ring in numbers])
    edges, which, _ = unique_edges(steps)
    beside = np.zeros((len(edges), 2), np.intp)
    back = (steps[:, 0] > steps[:, 1]).astype(np.intp)
    is_hole = np.append(False, np.diff(polygon) == 0)[of_ring]
    beside[which, 1 - back] = np.where(is_hole, polygon.max() + 2 + of_ring, 0)
    beside[which, back] = polygon[of_ring] + 1
    is_end = (np.bincount(edges.ravel(), minlength=len(places)) != 2) | keep_points
    for ring, ring_numbers in zip(rings, numbers, strict=True):
        is_end[ring_numbers[_turns(ring)]] = True
    lines, faces, known = [], [], np.zeros(len(edges), bool)
    first = 0
    for ring, ring_numbers in zip(rings, numbers, strict=True):
        for line in split_line(np.append(np.arange(len(ring_numbers)), 0), np.flatnonzero(is_end[ring_numbers])):
            along = which[first + line[:-1]]
            if not known[along].any():
                known[along] = True
                lines.append(ring[line])
                faces.append(beside[along[0], :: -1 if back[first + line[0]] else 1])
        first += len(ring_numbers)
    return lines, np.array(faces)


def _turns(ring: Points) -> Bools:
    """Tell at which points a ring has a corner."""
    turns = turns_of(np.roll(ring[:-1], 1, axis=0), ring[:-1], np.roll(ring[:-1], -1, axis=0))
    sides = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    shorter = np.minimum(sides, np.roll(sides, 1))
    is_long = shorter > _LONG * float(np.hypot(*np.ptp(ring, axis=0)))
    return np.asarray(turns > np.where(is_long, CLEAR_CORNER, SMOOTH))
