"""The outline of polygons: of one region, or of several parts that share borders. They may touch at points."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cvtimg._shared.checks import check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Bools, Indices, Points
from cvtimg.halfedges import unique_edges
from cvtimg.meshes.areas import Areas
from cvtimg.meshes.outlines import CLEAR_CORNER, TOLERANCE, Outline, label_outline, split_line, turns_of
from cvtimg.meshes.welding import Cleaning, clean
from cvtimg.placement import Box, PictureRegion, PolygonRegion, Region
from cvtimg.placement.polygons import SMOOTH

#: Where the boundary of a polygon turns by more than `SMOOTH`, it has a corner that stays; `CLEAR_CORNER` is enough
#: between two sides longer than this part of the diameter, for these are no samples of a curve.
_LONG = 0.1


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
