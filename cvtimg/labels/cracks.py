"""Walks along the cracks between pixels of different segments, and the lines and rings that they make.

A crack is one side of a pixel. Pixel corners where any number of cracks but two meet are junctions, and so are the
four corners of the image. Each crack is walked twice, once around each of its regions; a region is a connected piece
of a segment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg.labels import _labels

#: Stands for a label beyond the image.
OUTSIDE = -1

_Index = NDArray[np.int64]

#: For the directions east, south, west and north: the step (down, right) from corner to corner, and the pixel to its
#: right, relative to the corner in an image with a rim of one pixel.
_STEPS = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])
_RIGHT_HAND = np.array([(1, 1), (1, 0), (0, 0), (0, 1)])
#: Bits of a corner, in addition to one bit for each crack that leaves it.
_SADDLE_EAST_WEST, _SADDLE_SOUTH_NORTH, _JUNCTION = 16, 32, 64


class Walk(NamedTuple):
    """All steps along cracks, ring after ring, each with the region to the right (on a screen, with y down)."""

    corners: _Index  # (n, 2): row and column of the corner that each step leaves
    directions: _Index  # (n,): 0 east, 1 south, 2 west, 3 north
    at_junction: NDArray[np.bool_]  # (n,): whether the corner is a junction
    sides: NDArray[np.int32]  # (n, 2): labels to the right and to the left; OUTSIDE beyond the image
    regions: NDArray[np.int32]  # (n,): number of the region to the right; 0 beyond the image
    ring_starts: _Index  # (r,): where the rings begin: at a junction, otherwise at their first corner by row and column


class Pieces(NamedTuple):
    """Stretches of a walk from junction to junction, or around a ring without one."""

    # Each line is walked as two pieces, once in each direction.

    starts: _Index  # (p,): the steps of each piece
    stops: _Index
    #: (p,): whether the line runs in the direction of this piece; exactly one of its two pieces does
    is_line: NDArray[np.bool_]
    lines: _Index  # (p,): number of the line along which a piece runs, among those with `is_line`
    rings: _Index  # (p,): number of the ring that a piece is part of


def walk_cracks(labels: NDArray[np.int32]) -> Walk:
    """Walk around every region of (H, W) labels >= 0, and around the image itself."""
    from skimage.measure import label

    rimmed = np.pad(labels, 1, constant_values=OUTSIDE)
    # scikit-image leaves out one label: the one for the outside of the image.
    inside = label(labels, background=OUTSIDE, connectivity=1)  # type: ignore[no-untyped-call]
    regions = np.pad(inside.astype(np.int32), 1)
    marks = _mark_corners(rimmed, regions)
    flat = marks.ravel()
    steps_left = flat & np.uint8(15)
    path = np.empty(int(np.bitwise_count(steps_left).sum()), np.int64)
    starts = np.empty(len(path) // 4, np.int64)
    n_rings = _labels.follow_rings(flat, marks.shape[1], steps_left, path, starts)
    corner, directions = path >> 2, path & 3
    corners = np.stack(np.divmod(corner, marks.shape[1]), axis=1)
    right, left = pixels_beside(corners, directions)
    sides = np.stack([rimmed[right], rimmed[left]], axis=1)
    return Walk(corners, directions, flat[corner] & _JUNCTION > 0, sides, regions[right], starts[:n_rings])


def pixels_beside(corners: _Index, directions: _Index) -> tuple[tuple[_Index, _Index], tuple[_Index, _Index]]:
    """Index the pixels to the right and to the left of steps, (rows, columns) each, in an image with a rim of one."""
    right = corners + _RIGHT_HAND[directions]
    left = corners + _RIGHT_HAND[directions - 1]
    return (right[:, 0], right[:, 1]), (left[:, 0], left[:, 1])


def _mark_corners(rimmed: NDArray[np.int32], regions: NDArray[np.int32]) -> NDArray[np.uint8]:
    """(H + 1, W + 1) bits of each corner, as `_labels.follow_rings` reads them."""
    height, width = rimmed.shape
    marks = np.zeros((height - 1, width - 1), np.uint8)
    flat = (rimmed[:-1, 1:-1] != rimmed[1:, 1:-1]).view(np.uint8)
    upright = (rimmed[1:-1, :-1] != rimmed[1:-1, 1:]).view(np.uint8)
    marks[:, :-1] |= flat
    marks[:-1] |= upright << 1
    marks[:, 1:] |= flat << 2
    marks[1:] |= upright << 3
    crossed = marks == 15
    marks[np.bitwise_count(marks) > 2] |= _JUNCTION
    marks[:: height - 2, :: width - 2] |= _JUNCTION
    marks[crossed & (regions[:-1, 1:] == regions[1:, :-1])] |= _SADDLE_EAST_WEST
    marks[crossed & (regions[:-1, :-1] == regions[1:, 1:])] |= _SADDLE_SOUTH_NORTH
    return marks


def cut_at_junctions(walk: Walk) -> Pieces:
    """Cut the rings of a walk into pieces, and pair the two pieces of each line."""
    is_start = walk.at_junction.copy()
    is_start[walk.ring_starts] = True
    starts = np.flatnonzero(is_start)
    stops = np.append(starts[1:], len(is_start))
    begins = _numbers(walk.corners[starts], walk.directions[starts], walk)
    last = stops - 1
    ends = walk.corners[last] + _STEPS[walk.directions[last]]
    turned = _numbers(ends, walk.directions[last] ^ 2, walk)
    order = np.argsort(begins)
    twins = order[np.searchsorted(begins[order], turned)]
    is_line = begins < turned
    numbers = np.cumsum(is_line) - 1
    lines = np.where(is_line, numbers, numbers[twins])
    return Pieces(starts, stops, is_line, lines, np.searchsorted(walk.ring_starts, starts, side="right") - 1)


def _numbers(corners: _Index, directions: _Index, walk: Walk) -> _Index:
    """Give each step a number of its own."""
    return (corners[:, 0] * (walk.corners[:, 1].max() + 1) + corners[:, 1]) * 4 + directions
