"""Borders of segments as lines and polygons: neighbors share their border, without gaps or overlaps.

A line runs from junction to junction and belongs to the two regions beside it. Operations on borders, such as
simplification, act on each line once; polygons are then assembled from lines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_labeled_image, check_labels, check_non_negative
from cvtimg._shared.records import ReadOnly
from cvtimg.labels import _labels
from cvtimg.labels.figures import region_means

# --- walks along the cracks between pixels of different segments, and the lines and rings that they make
# A crack is one side of a pixel. Pixel corners where any number of cracks but two meet are junctions, and so are the
# four corners of the image. Each crack is walked twice, once around each of its regions; a region is a connected piece
# of a segment.

#: Stands for a label beyond the image.
OUTSIDE = -1

_Index = NDArray[np.int64]

#: For the directions east, south, west and north: the step (down, right) from corner to corner, and the pixel to its
#: right, relative to the corner in an image with a rim of one pixel.
_STEPS = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])
_RIGHT_HAND = np.array([(1, 1), (1, 0), (0, 0), (0, 1)])


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
    return Walk(corners, directions, flat[corner] & _labels.JUNCTION > 0, sides, regions[right], starts[:n_rings])


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
    marks[np.bitwise_count(marks) > 2] |= _labels.JUNCTION
    marks[:: height - 2, :: width - 2] |= _labels.JUNCTION
    marks[crossed & (regions[:-1, 1:] == regions[1:, :-1])] |= _labels.SADDLE_EAST_WEST
    marks[crossed & (regions[:-1, :-1] == regions[1:, 1:])] |= _labels.SADDLE_SOUTH_NORTH
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


# --- simplification of lines that keeps them from crossing each other
# A simplified line sweeps over the area between it and the original. If no point of any line lies in that area, the
# line has crossed no other, and nothing has moved to its other side.
# A. Saalfeld, Topologically consistent line simplification with the Douglas-Peucker algorithm, Cartography and
# Geographic Information Science 26 (1999) 7-18, doi 10.1559/152304099782424901.

#: Below this tolerance, in pixels, a line stays as it is.
_LEAST_TOLERANCE = 1 / 16
#: A point within this distance of a line is on it, in pixels: more than rounding in files moves a point.
_ON_LINE = 1e-3


def simplify(
    lines: Sequence[_Points], tolerance: float, spoiled: Callable[[Sequence[_Points]], NDArray[np.intp]]
) -> list[_Points]:
    """Leave out points within `tolerance` of the line that remains, by the method of Douglas and Peucker."""
    # Lines that sweep over a point of another line, or are `spoiled`, are simplified again with half the tolerance
    # until they are neither. First and last points stay.
    tolerances = np.full(len(lines), float(tolerance))
    simple = [_shorter(line, tolerance) for line in lines]
    suspects = list(range(len(lines)))
    while True:
        again = {*_sweeping(lines, simple, suspects), *spoiled(simple).tolist()}
        suspects = sorted(number for number in again if len(simple[number]) < len(lines[number]))
        if not suspects:
            return simple
        for number in suspects:
            tolerances[number] /= 2
            simple[number] = _shorter(lines[number], tolerances[number])


def _shorter(line: _Points, tolerance: float) -> _Points:
    from skimage.measure import approximate_polygon

    if len(line) == 2 or tolerance < _LEAST_TOLERANCE:
        return line
    return approximate_polygon(line, tolerance)  # type: ignore[no-untyped-call]


def _sweeping(lines: Sequence[_Points], simple: Sequence[_Points], suspects: Sequence[int]) -> Iterator[int]:
    """Find the lines among `suspects` that sweep over a point of any line."""
    from scipy.spatial import cKDTree

    swept = [(number, chain) for number in suspects for chain in _left_out(lines[number], simple[number])]
    if not swept:
        return
    places = np.concatenate(lines)
    low, high = (np.array([end(chain, axis=0) for _, chain in swept]) for end in (np.min, np.max))
    radii = np.hypot(*(high - low).T) / 2 + _ON_LINE
    near = cKDTree(places).query_ball_point((low + high) / 2, radii)
    for (number, chain), candidates in zip(swept, near, strict=True):
        if len(candidates) > len(chain) and _is_over(chain, places[candidates]):
            yield number


def _left_out(line: _Points, simple: _Points) -> Iterator[_Points]:
    """Return the stretches of a line between points that remain, where points between them were left out."""
    numbers = line.view(np.complex128)[:, 0]
    kept = np.flatnonzero(np.isin(numbers, simple.view(np.complex128)[:, 0]))
    return (line[start : end + 1] for start, end in pairwise(kept.tolist()) if end > start + 1)


def _is_over(chain: _Points, places: _Points) -> bool:
    """Tell whether a point of another line lies between a chain and the step from its first point to its last."""
    from skimage.measure import points_in_poly

    others = places[~np.isin(places.view(np.complex128)[:, 0], chain.view(np.complex128)[:, 0])]
    if not len(others):
        return False
    if points_in_poly(others, chain).any():  # type: ignore[no-untyped-call]
        return True
    first, step = chain[0], chain[-1] - chain[0]
    length = np.hypot(*step)
    if not length:
        return False
    along, across = (others - first) @ step / length, (others - first) @ (step[1], -step[0]) / length
    return bool(((abs(across) < _ON_LINE) & (along > 0) & (along < length)).any())


# --- contours

#: How close a border may come to the center of a pixel, in pixels: at 0, a region of one pixel could lose its area.
CLEARANCE = 1 / 256

#: A ring of less area than this, in squared pixels, may have none but for rounding; such rings keep all their points.
_NO_AREA = 1e-3

_Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Polygon:
    """One connected piece of a segment.

    Attributes
    ----------
    label : int
        Label of the segment.
    rings : tuple of (N, 2) float64 arrays
        Closed rings of points (x, y), the last equal to the first: the outer ring, then one per hole. By the shoelace
        formula, the outer ring has positive area and holes have negative area. No ring passes a point twice, and rings
        meet at single points at most.
    """

    label: int
    rings: tuple[_Points, ...]

    @property
    def area(self) -> float:
        """Area in squared pixels, without the holes."""
        return sum(map(_moment, self.rings))

    def __repr__(self) -> str:
        n_points = sum(map(len, self.rings))
        return f"Polygon(label={self.label}, rings={len(self.rings)}, {n_points} points, area={self.area:.6g})"


@dataclass(frozen=True, slots=True, eq=False)
class Contours(ReadOnly):
    """The borders of all segments of an image.

    Points are (x, y) in pixels, x to the right and y down; the first pixel spans 0..1 by 0..1.

    Attributes
    ----------
    lines : tuple of (N, 2) float64 arrays
        The borders, each once: from junction to junction, or closed if they meet no other.
    sides : (L, 2) int32 array
        Labels to the right and to the left of each line in its direction (on a screen, with y down); -1 beyond the
        image.
    polygons : tuple of Polygon
        The connected pieces of all segments but label 0, by label; pixels that share a side are connected.
    """

    lines: tuple[_Points, ...]
    sides: NDArray[np.int32]
    polygons: tuple[Polygon, ...]

    def __repr__(self) -> str:
        n_points = sum(map(len, self.lines))
        return f"Contours({len(self.polygons)} polygons, {len(self.lines)} lines of {n_points} points)"


def find_contours(labels: ArrayLike, image: Any = None, *, tolerance: float = 0) -> Contours:
    """Find the borders of segments as lines, and the segments as polygons with holes.

    Parameters
    ----------
    labels : (H, W) integer array
        Segment of each pixel; 0 for masked pixels.
    image : (H, W) or (H, W, C) array, optional
        The segmented image, for sub-pixel borders. They run between the centers of pixels, where the interpolated
        image is equally far from the means of the two segments. Where the image does not cross that level, as under
        noise, and beside masked pixels, the border is half way. Without an image, borders run along the sides of
        pixels, and the areas of polygons are exact.
    tolerance : float
        Leave out points that are within this distance of the simplified line, in pixels. Junctions stay, no polygon
        vanishes, and no line crosses another: where it would, it keeps more of its points.

    Returns
    -------
    Contours

    Notes
    -----
    For two segments of a gray image the lines are those of ``skimage.measure.find_contours`` at the level half way
    between their means, but for pixels that touch across a corner.

    References
    ----------
    D. H. Douglas, T. K. Peucker, Algorithms for the reduction of the number of points required to represent a
    digitized line or its caricature, Cartographica 10 (1973) 112-122, doi 10.3138/FM57-6770-U75U-7727.
    A. Saalfeld, Topologically consistent line simplification with the Douglas-Peucker algorithm, Cartography and
    Geographic Information Science 26 (1999) 7-18, doi 10.1559/152304099782424901.

    Examples
    --------
    >>> from cvtimg import find_contours
    >>> contours = find_contours(np.array([[1, 1, 2], [1, 2, 2]]))
    >>> [(polygon.label, polygon.area) for polygon in contours.polygons]
    [(1, 3.0), (2, 3.0)]
    >>> contours.polygons[0].rings[0].tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 0.0]]
    """
    segments = check_labels("labels", labels)
    check_non_negative("tolerance", tolerance)
    picture = None if image is None else check_labeled_image("image", image, segments)
    walk = walk_cracks(segments)
    pieces = cut_at_junctions(walk)
    if picture is None:
        lines = _along_sides(walk, pieces)
    else:
        lines = _between_centers(walk, pieces, _crossings(walk, segments, picture))
    if tolerance:
        areas = _ring_areas(lines, pieces)

        def spoiled(simple: Sequence[_Points]) -> NDArray[np.intp]:
            """Find the lines of rings that have vanished or flipped."""
            lost = np.sign(areas) * _ring_areas(simple, pieces) < _NO_AREA
            return np.unique(pieces.lines[lost[pieces.rings]])

        lines = simplify(lines, tolerance, spoiled)
    sides = walk.sides[pieces.starts[pieces.is_line]]
    return Contours(tuple(lines), sides, _polygons(lines, walk, pieces))


def _along_sides(walk: Walk, pieces: Pieces) -> list[_Points]:
    """Draw the lines along the sides of pixels, with points where they turn."""
    turns = np.append(True, walk.directions[1:] != walk.directions[:-1])
    turns[pieces.starts] = False
    corners = walk.corners[:, ::-1].astype(np.float64)
    ends = corners[pieces.starts], corners[_next_starts(pieces)]
    return _draw(corners, turns, ends, pieces)


def _between_centers(walk: Walk, pieces: Pieces, crossings: _Points) -> list[_Points]:
    """Draw the lines through the crossings of their steps; junctions lie in the middle of the crossings around them."""
    corners = walk.corners[:, ::-1].astype(np.float64)
    junctions = _junctions(walk, corners, crossings)
    ends = junctions[pieces.starts], junctions[_next_starts(pieces)]
    inner = (walk.sides != OUTSIDE).all(axis=1)  # the rim of the picture is straight between junctions
    inner[pieces.starts[~walk.at_junction[pieces.starts]]] = False  # drawn as the end of a closed line
    return _draw(crossings, inner, ends, pieces)


def _crossings(walk: Walk, labels: NDArray[np.int32], picture: NDArray[Any]) -> _Points:
    """(n, 2) points (x, y) where the line from pixel to pixel across each step meets the border."""
    means = region_means(labels, picture)
    right, left = (np.stack(place, axis=1) - 1 for place in pixels_beside(walk.corners, walk.directions))
    part = np.full(len(right), 0.5)
    told = (walk.sides > 0).all(axis=1)
    mean_right, mean_left = (means[walk.sides[told, side]] for side in (0, 1))
    across, middle = mean_left - mean_right, (mean_left + mean_right) / 2
    at_right, at_left = (((picture[tuple(pixel[told].T)] - middle) * across).sum(axis=1) for pixel in (right, left))
    crosses = (at_right < 0) & (at_left > 0)
    gap = np.where(crosses, at_left - at_right, 1)
    part[told] = np.where(crosses, np.clip(-at_right / gap, CLEARANCE, 1 - CLEARANCE), 0.5)
    return (right + 0.5 + (left - right) * part[:, None])[:, ::-1]


def _junctions(walk: Walk, corners: _Points, crossings: _Points) -> _Points:
    """(n, 2) positions of the corners that steps leave, moved at junctions and at the starts of rings without one."""
    places = crossings.copy()
    frame = corners.max(axis=0)
    counted = walk.at_junction & (walk.sides != OUTSIDE).all(axis=1)
    number = (corners[:, 1] * (frame[0] + 1) + corners[:, 0]).astype(np.int64)
    _, place_of, inverse = np.unique(number[walk.at_junction], return_index=True, return_inverse=True)
    weight = counted[walk.at_junction]
    n_crossings = np.bincount(inverse, weight)
    at = corners[walk.at_junction][place_of]
    for axis in (0, 1):
        mean = np.bincount(inverse, weight * crossings[walk.at_junction, axis]) / np.maximum(n_crossings, 1)
        on_frame = (at[:, axis] == 0) | (at[:, axis] == frame[axis])
        moved = np.where(on_frame | (n_crossings == 0), at[:, axis], mean)
        places[walk.at_junction, axis] = moved[inverse]
    return places


def _next_starts(pieces: Pieces) -> NDArray[np.int64]:
    """Return where each piece ends: the start of the next piece of its ring."""
    firsts = np.searchsorted(pieces.rings, pieces.rings)
    is_last = np.append(np.diff(pieces.rings) > 0, True)
    return np.where(is_last, pieces.starts[firsts], np.roll(pieces.starts, -1))


def _draw(places: _Points, inner: NDArray[np.bool_], ends: tuple[_Points, _Points], pieces: Pieces) -> list[_Points]:
    """Assemble each line from its first point, those of its steps that are `inner`, and its last point."""
    before = np.append(0, np.cumsum(inner))
    drawn = places[inner]
    chosen = np.flatnonzero(pieces.is_line)
    begin, end = before[pieces.starts[chosen]], before[pieces.stops[chosen]]
    return [
        np.concatenate([ends[0][piece : piece + 1], drawn[i:j], ends[1][piece : piece + 1]])
        for piece, i, j in zip(chosen, begin, end, strict=True)
    ]


def _moment(line: _Points) -> float:
    """Return the contribution of a line to the area of a ring."""
    x, y = line.T
    return float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) / 2


def _ring_areas(lines: Sequence[_Points], pieces: Pieces) -> NDArray[np.float64]:
    """Signed area of each ring; a line counts once in each direction."""
    moments = np.array([_moment(line) for line in lines])
    signed: NDArray[np.float64] = np.where(pieces.is_line, moments[pieces.lines], -moments[pieces.lines])
    return np.bincount(pieces.rings, signed).astype(np.float64, copy=False)


def _polygons(lines: Sequence[_Points], walk: Walk, pieces: Pieces) -> tuple[Polygon, ...]:
    """Assemble rings from lines, and polygons from the rings of each region; the outer ring encloses the most."""
    bounds = np.append(np.flatnonzero(np.append(True, np.diff(pieces.rings) > 0)), len(pieces.rings))
    labels, regions = walk.sides[walk.ring_starts, 0], walk.regions[walk.ring_starts]
    order = np.lexsort((-_ring_areas(lines, pieces), regions, labels))
    order = order[labels[order] > 0]
    polygons = []
    for rings in np.split(order, np.flatnonzero(np.diff(regions[order])) + 1) if len(order) else []:
        drawn = tuple(_ring(lines, pieces, range(bounds[ring], bounds[ring + 1])) for ring in rings)
        polygons.append(Polygon(int(labels[rings[0]]), drawn))
    return tuple(polygons)


def _ring(lines: Sequence[_Points], pieces: Pieces, numbers: range) -> _Points:
    """Join the lines of a ring, each in the direction in which it is walked there."""
    walked = [
        lines[pieces.lines[number]] if pieces.is_line[number] else lines[pieces.lines[number]][::-1]
        for number in numbers
    ]
    ring = np.concatenate([walked[0][:1], *(line[1:] for line in walked)])
    ring.flags.writeable = False
    return ring
