"""Borders of segments as lines and polygons: neighbors share their border, without gaps or overlaps.

A line runs from junction to junction and belongs to the two regions beside it. Operations on borders, such as
simplification, act on each line once; polygons are then assembled from lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_labeled_image, check_labels, check_non_negative
from cvtimg._shared.records import ReadOnly
from cvtimg.labels.cracks import OUTSIDE, Pieces, Walk, cut_at_junctions, pixels_beside, walk_cracks
from cvtimg.labels.figures import region_means
from cvtimg.labels.simplification import simplify

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

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it.

    See Also
    --------
    find_edges : Edges as pixels.
    write_contours : Files of contours.

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
    >>> import numpy as np
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
    n_pieces = len(pieces.rings)
    is_last = np.append(pieces.rings[1:] != pieces.rings[:-1], True)
    firsts = np.flatnonzero(np.append(True, is_last[:-1]))
    following = np.where(is_last, firsts[pieces.rings], np.minimum(np.arange(n_pieces) + 1, n_pieces - 1))
    return pieces.starts[following]


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
