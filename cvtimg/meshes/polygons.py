"""The outline of polygons: of one region, or of several parts that share borders. They may touch at points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_in_range, check_that
from cvtimg._shared.extras import shapely
from cvtimg.halfedges import unique_edges
from cvtimg.meshes.outlines import ON_LINE, SMOOTHING, Outline, label_outline, split_line, turns_of
from cvtimg.placement import Box, PictureRegion, PolygonRegion, Region

Points = NDArray[np.float64]

#: Where the boundary of a polygon turns by more, in degrees, it has a corner that stays; the second angle is enough
#: between two sides longer than a part of the diameter, for these are no samples of a curve.
_CORNER, _LONG_CORNER, _LONG = 30.0, 10.0, 0.1


def outline_of(region: Region, min_size: float, keep_points: bool) -> Outline:
    """Return the outline of a region: contours of masks are smoothed, polygons lose details.

    All points that polygons have then are corners, if they are to be kept.
    """
    check_that(repr(region), region.n_dims == 2, "be in the plane")
    if isinstance(region, PictureRegion):
        check_that("keep_points", not keep_points, "be False: contours of masks have no points to keep")
        return label_outline(region.mask.astype(np.int32), None, SMOOTHING.tolerance)
    if isinstance(region, Box) and any(region.periodic):
        raise ValueError(f"{region!r} must not be periodic: a mesh needs a boundary")
    return outline_of_parts([region], 0 if isinstance(region, Box) else min_size, keep_points)


def outline_of_parts(regions: Sequence[Region], min_size: float, keep_points: bool) -> Outline:
    """Return the borders of regions, which have the labels 1, 2, ..., and share those between them."""
    given = [PolygonRegion(region.outline()) for region in regions]
    parts = np.array([region.geometry for region in given])
    whole = parts[0] if len(parts) == 1 else shapely.union_all(parts)
    overlap = float(shapely.area(parts).sum()) - whole.area
    check_that("parts of the region", overlap <= ON_LINE * whole.area, "not overlap")
    if min_size > 0:
        simplified = shapely.coverage_simplify if len(parts) > 1 else shapely.simplify
        parts = simplified(parts, min_size / 2)
        whole = parts[0] if len(parts) == 1 else shapely.union_all(parts)
        check_in_range("min_size", min_size, whole.area > 0, "less: nothing of the region is left")
    bounds = np.array(whole.bounds).reshape(2, 2)
    rings, labels = _rings(parts, ON_LINE * float(np.hypot(*(bounds[1] - bounds[0]))))
    lines, sides = _lines(rings, labels, keep_points)
    contains = given[0].contains if len(given) == 1 else PolygonRegion(whole).contains
    return Outline.of(lines, sides, bounds, None, contains, polygons=whole)


def _rings(parts: Any, apart: float) -> tuple[list[Points], list[int]]:
    """Return the rings around parts, which are on their left, and the label of each; all share points that touch."""
    polygons, part = shapely.get_parts(parts, return_index=True)
    rings, polygon = shapely.get_rings(shapely.orient_polygons(polygons), return_index=True)
    places, own = shapely.get_coordinates(rings, return_index=True)
    lines = shapely.remove_repeated_points(shapely.linestrings(places, indices=own), apart)
    found = [shapely.get_coordinates(line) for line in lines]
    found = [ring if np.linalg.norm(ring[-2] - ring[0]) > apart else np.delete(ring, -2, axis=0) for ring in found]
    labels = [label for ring, label in zip(found, (part[polygon] + 1).tolist(), strict=True) if len(ring) > 3]
    found = [ring for ring in found if len(ring) > 3]
    check_that("region", len(found) > 0, "be wider than 1e-9 of its diameter")
    return _with_touching(found, apart), labels


def _with_touching(rings: list[Points], apart: float) -> list[Points]:
    """Add the points where other rings touch a side, so that they are points of both."""
    sides = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    places = np.unique(sides[:, 0], axis=0)
    tree = shapely.STRtree(shapely.linestrings(sides))
    point, side = tree.query(shapely.points(places), predicate="dwithin", distance=apart)
    far = np.linalg.norm(sides[side] - places[point, None], axis=2)
    inner = (far > apart).all(axis=1)
    order = np.flatnonzero(inner)[np.lexsort((far[inner, 0], side[inner]))]
    point, side = point[order], side[order]
    found, start = [], 0
    for ring in rings:
        own = (side >= start) & (side < start + len(ring) - 1)
        found.append(np.insert(ring, side[own] - start + 1, places[point[own]], axis=0))
        start += len(ring) - 1
    return found


def _lines(rings: list[Points], labels: list[int], keep_points: bool) -> tuple[list[Points], NDArray[np.int32]]:
    """Cut rings at corners, and where others leave or join them; return each line once, and the labels beside it."""
    places, number = np.unique(np.concatenate([ring[:-1] for ring in rings]), axis=0, return_inverse=True)
    numbers = np.split(number.ravel(), np.cumsum([len(ring) - 1 for ring in rings])[:-1])
    steps = np.concatenate([np.stack([ring, np.roll(ring, -1)], axis=1) for ring in numbers])
    edges, which, _ = unique_edges(steps)
    beside = np.zeros((len(edges), 2), np.int32)
    forth = steps[:, 0] < steps[:, 1]
    beside[which, np.where(forth, 0, 1)] = np.repeat(labels, [len(ring) for ring in numbers])
    is_end = (np.bincount(edges.ravel(), minlength=len(places)) != 2) | keep_points
    for ring, own in zip(rings, numbers, strict=True):
        is_end[own[_turns(ring)]] = True
    lines, sides, known = [], [], np.zeros(len(edges), bool)
    first = 0
    for ring, own in zip(rings, numbers, strict=True):
        of_ring = which[first : first + len(own)]
        for line in split_line(np.append(np.arange(len(own)), 0), np.flatnonzero(is_end[own])):
            edge = of_ring[line[0]]
            if not known[of_ring[line[:-1]]].any():
                known[of_ring[line[:-1]]] = True
                lines.append(ring[line])
                sides.append(beside[edge] if forth[first + line[0]] else beside[edge, ::-1])
        first += len(own)
    return lines, np.array(sides, np.int32)


def _turns(ring: Points) -> NDArray[np.bool_]:
    """Tell at which points a ring has a corner."""
    turns = turns_of(np.roll(ring[:-1], 1, axis=0), ring[:-1], np.roll(ring[:-1], -1, axis=0))
    sides = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    shorter = np.minimum(sides, np.roll(sides, 1))
    is_long = shorter > _LONG * float(np.hypot(*np.ptp(ring, axis=0)))
    return np.asarray(turns > np.where(is_long, _LONG_CORNER, _CORNER))
