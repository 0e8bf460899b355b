"""Borders of segments as lines and polygons: neighbors share their border, without gaps or overlaps.

A crack is one side of a pixel, between two regions: connected pieces of segments. Pixel corners where any number of
cracks but two meet are junctions, and so are the four corners of the image. A line runs along cracks from junction to
junction, or around a ring without one, and belongs to the two regions beside it. Operations on borders, such as
simplification, act on each line once; polygons are then assembled from lines.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import cvtimg.labels._labels as _labels
from cvtimg._shared.checks import check_choice, check_labeled_image, check_labels, check_non_negative
from cvtimg._shared.extras import shapely
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.types import Array, Bools, Floats, ImageLike, Ints, Ints64, Points
from cvtimg.labels.figures import region_means

#: Stands for a label beyond the image.
OUTSIDE = -1
#: How close a border may come to the center of a pixel, in pixels: at 0, a region of one pixel could lose its area.
CLEARANCE = 1 / 256
#: Below this tolerance, in pixels, a line stays as it is.
_LEAST_TOLERANCE = 1 / 16
#: A region of less area than this, in squared pixels, may have none but for rounding.
_NO_AREA = 1e-3

_Index = Ints64


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
    rings: tuple[Points, ...]

    @property
    def area(self) -> float:
        """Area in squared pixels, without the holes."""
        return sum(float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) / 2 for x, y in (ring.T for ring in self.rings))

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

    lines: tuple[Points, ...]
    sides: Ints
    polygons: tuple[Polygon, ...]

    def _claims(self) -> Claims:
        yield "lines have two sides", self.sides.shape == (len(self.lines), 2)
        rings = [ring for polygon in self.polygons for ring in polygon.rings]
        yield "rings are closed", [np.array_equal(ring[0], ring[-1]) for ring in rings]
        yield "pieces have areas", [polygon.area > 0 for polygon in self.polygons]

    def __repr__(self) -> str:
        n_points = sum(map(len, self.lines))
        return f"Contours({len(self.polygons)} polygons, {len(self.lines)} lines of {n_points} points)"


def find_contours(labels: ArrayLike, image: ImageLike | None = None, *, tolerance: float = 0) -> Contours:
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
    from skimage.measure import label

    segments = check_labels("labels", labels)
    check_non_negative("tolerance", tolerance)
    rimmed = np.pad(segments, 1, constant_values=OUTSIDE)
    # scikit-image leaves out one label: the one for the outside of the image.
    regions = label(rimmed, background=OUTSIDE, connectivity=1)  # type: ignore[no-untyped-call]
    cracks = _walk(rimmed)
    pixels = tuple(np.stack([side[cracks.starts] for side in (cracks.right, cracks.left)], axis=1).T)
    sides, beside = rimmed[pixels].T, regions[pixels].T
    if image is None:
        turns = np.append(True, (cracks.steps[1:] != cracks.steps[:-1]).any(axis=1))
        turns[cracks.starts] = False
        places = cracks.corners[:, ::-1].astype(np.float64)
        last = places[cracks.lasts] + cracks.steps[cracks.lasts, ::-1]
        lines = _drawn(cracks, places, turns, places[cracks.starts], last)
    else:
        lines = _between_centers(cracks, rimmed, check_labeled_image("image", image, segments))
    if tolerance:
        lines = simplify(lines, tolerance, beside)
    return Contours(tuple(lines), sides, _polygons(lines, sides, beside))


def simplify(lines: Sequence[Points], tolerance: float, regions: NDArray[np.integer] | None = None) -> list[Points]:
    """Leave out points within a tolerance of the lines that remain, which keep their ends and cross no other.

    A line sweeps over the area between it and what remains of it. If no point of any other line lies there, it has
    crossed none, and nothing has moved to its other side. Lines that do sweep over one, or that leave one of their
    `regions`, (L, 2), without area, are simplified again with half the tolerance until they do not.
    """
    strings = strings_of(lines)
    places, of_place = shapely.get_coordinates(strings, return_index=True)
    tree = shapely.STRtree(shapely.points(places))
    simple, tolerances, suspects = strings.copy(), np.full(len(lines), float(tolerance)), np.arange(len(lines))
    while len(suspects):
        some, off = strings[suspects], tolerances[suspects]
        shorter = shapely.simplify(some, off, preserve_topology=False)
        simple[suspects] = np.where(off < _LEAST_TOLERANCE, some, shorter)
        n_places = shapely.get_num_coordinates(simple)
        spoiled = shapely.is_closed(simple) & (n_places < 4)
        swept, touched = tree.query(_swept(strings[suspects], simple[suspects]), predicate="intersects")
        swept = suspects[swept]
        ends = np.stack([shapely.get_coordinates(shapely.get_point(strings, end)) for end in (0, -1)])[:, swept]
        is_other = (of_place[touched] != swept) & (ends != places[touched]).any(axis=2).all(axis=0)
        spoiled[swept[is_other]] = True
        if regions is not None:
            spoiled |= (_areas(simple, regions) < _NO_AREA)[regions].any(axis=1)
        suspects = np.flatnonzero(spoiled & (n_places < shapely.get_num_coordinates(strings)))
        tolerances[suspects] /= 2
    return [shapely.get_coordinates(line) for line in simple]


def _swept(lines: Array, simple: Array) -> Array:
    """Return the areas between lines and what remains of them, as polygons that may touch themselves."""
    there_and_back = np.concatenate([lines, shapely.reverse(simple)])
    places, part = shapely.get_coordinates(there_and_back, return_index=True)
    order = np.argsort(part % len(lines), kind="stable")
    swept: Array = shapely.polygons(shapely.linearrings(places[order], indices=part[order] % len(lines)))
    return swept


def _areas(lines: Array, regions: NDArray[np.integer]) -> Floats:
    """Return the area of each region, by number, from the lines with the regions to their right and left."""
    places, of_line = shapely.get_coordinates(lines, return_index=True)
    x, y = places.T
    moments = np.bincount(of_line[1:], (x[:-1] * y[1:] - x[1:] * y[:-1]) * (of_line[1:] == of_line[:-1])) / 2
    right, left = (np.bincount(side, moments, regions.max() + 1) for side in regions.T)
    return np.asarray(right - left)


class _Cracks(NamedTuple):
    """Cracks, line after line. Pixels are those of an image with a rim of one."""

    corners: _Index  # (n, 2): row and column of the corner that each leaves
    steps: _Index  # (n, 2): to the corner where it ends
    right: _Index  # (n, 2): row and column of the pixel to the right (on a screen, with y down)
    left: _Index  # (n, 2)
    starts: _Index  # (l,): where lines begin
    lasts: _Index  # (l,): their last cracks
    at_junction: Bools  # (l,): whether a line begins at a junction, and is no ring without one


def _walk(rimmed: Ints) -> _Cracks:
    """Walk along all cracks between labels of an image with a rim."""
    height, width = rimmed.shape
    marks = np.zeros((height - 1, width - 1), np.uint8)
    flat = (rimmed[:-1, 1:-1] != rimmed[1:, 1:-1]).view(np.uint8)
    upright = (rimmed[1:-1, :-1] != rimmed[1:-1, 1:]).view(np.uint8)
    marks[:, :-1] |= flat
    marks[:-1] |= upright << 1
    marks[:, 1:] |= flat << 2
    marks[1:] |= upright << 3
    marks[np.bitwise_count(marks) > 2] |= _labels.JUNCTION
    marks[:: height - 2, :: width - 2] |= _labels.JUNCTION
    path = np.empty(int(flat.sum()) + int(upright.sum()), np.int64)
    starts = np.empty(len(path), np.int64)
    starts = starts[: _labels.follow_lines(marks.ravel().copy(), width - 1, path, starts)]
    corners = np.stack(np.divmod(path >> 2, width - 1), axis=1)
    steps = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])[path & 3]
    across = steps[:, ::-1] * (1, -1)
    right, left = ((2 * corners + steps + side) // 2 + 1 for side in (across, -across))
    at_junction = marks[tuple(corners[starts].T)] & _labels.JUNCTION > 0
    return _Cracks(corners, steps, right, left, starts, np.append(starts[1:], len(path)) - 1, at_junction)


def _between_centers(cracks: _Cracks, rimmed: Ints, picture: Array) -> list[Points]:
    """Draw the lines where those from pixel to pixel cross them; junctions lie in the middle of what is around them."""
    means = region_means(rimmed[1:-1, 1:-1], picture)
    labels = np.stack([rimmed[tuple(side.T)] for side in (cracks.right, cracks.left)], axis=1)
    is_inner = (labels > 0).all(axis=1)
    mean_right, mean_left = means[labels[is_inner]].swapaxes(0, 1)
    across, middle = mean_left - mean_right, (mean_left + mean_right) / 2
    pixels = (picture[tuple(side[is_inner].T - 1)] for side in (cracks.right, cracks.left))
    at_right, at_left = (((pixel - middle) * across).sum(axis=1) for pixel in pixels)
    crosses = (at_right < 0) & (at_left > 0)
    part = np.full(len(labels), 0.5)
    shares = -at_right / np.where(crosses, at_left - at_right, 1)
    part[is_inner] = np.where(crosses, np.clip(shares, CLEARANCE, 1 - CLEARANCE), 0.5)
    crossings = (cracks.right - 0.5 + (cracks.left - cracks.right) * part[:, None])[:, ::-1]
    # Of a line that ends at junctions, all crossings lie between, but along the rim of the image, which is straight.
    within = (labels != OUTSIDE).all(axis=1)
    outer = np.concatenate([cracks.starts, cracks.lasts])
    is_last = np.arange(len(outer)) >= len(cracks.starts)
    corners = cracks.corners[outer] + is_last[:, None] * cracks.steps[outer]
    _, first, corner = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    at, n_crossings = corners[first, ::-1].astype(np.float64), np.bincount(corner, within[outer])
    sums = np.stack([np.bincount(corner, within[outer] * axis) for axis in crossings[outer].T], axis=1)
    stays = (n_crossings == 0)[:, None] | (at == 0) | (at == picture.shape[1::-1])
    junctions = np.where(stays, at, sums / np.maximum(n_crossings, 1)[:, None])[corner].reshape(2, -1, 2)
    is_ring = ~cracks.at_junction
    within[cracks.starts[is_ring]] = False
    junctions[:, is_ring] = crossings[cracks.starts[is_ring]]
    return _drawn(cracks, crossings, within, *junctions)


def _drawn(cracks: _Cracks, places: Points, inner: Bools, first: Points, last: Points) -> list[Points]:
    """Return each line: its first point, the places of those of its cracks that are `inner`, and its last point."""
    before = np.append(0, np.cumsum(inner))
    parts = zip(before[cracks.starts], before[cracks.lasts + 1], strict=True)
    drawn = places[inner]
    return [np.concatenate([first[n : n + 1], drawn[i:j], last[n : n + 1]]) for n, (i, j) in enumerate(parts)]


def strings_of(lines: Sequence[Points]) -> Array:
    """Return lines as those of shapely."""
    of_line = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    strings: Array = shapely.linestrings(np.concatenate(lines), indices=of_line)
    return strings


def _polygons(lines: Sequence[Points], sides: Ints, regions: NDArray[np.integer]) -> tuple[Polygon, ...]:
    """Return the polygons of regions, of which (L, 2) are beside lines and have labels; those of label 0 have none."""
    labels, numbers = sides.T.ravel(), regions.T.ravel()
    order = np.lexsort((numbers, labels))
    order = order[labels[order] > 0]
    if not len(order):
        return ()
    _, first, around = np.unique(numbers[order], return_index=True, return_inverse=True)
    ranks = np.argsort(np.argsort(first))[around]
    borders = shapely.multilinestrings(np.tile(strings_of(lines), 2)[order], indices=ranks)
    areas = shapely.orient_polygons(shapely.normalize(shapely.build_area(borders)))
    rings, of_area = shapely.get_rings(areas, return_index=True)
    polygons: list[list[Points]] = [[] for _ in areas]
    for ring, area in zip(rings, of_area.tolist(), strict=True):
        places = shapely.get_coordinates(ring)
        places.flags.writeable = False
        polygons[area].append(places)
    names = labels[order][np.sort(first)].tolist()
    return tuple(Polygon(name, tuple(drawn)) for name, drawn in zip(names, polygons, strict=True))


#: How the label of an edge point compares with that of its neighbor, by mode.
EDGE_MODES = {"inner": np.greater, "outer": np.less, "thick": np.not_equal}


def find_edges(labels: ArrayLike, *, mode: str = "inner", ignore: int | None = None) -> Bools:
    """Find the pixels where one segment borders another.

    Parameters
    ----------
    labels : (H, W) integer array
        Segment of each pixel, >= 0.
    mode : {"inner", "outer", "thick"}
        Which of two neighbors with different labels is an edge point: "inner" takes the one with the higher label,
        "outer" the one with the lower label, "thick" both. Inner and outer edges are one pixel wide. Where labels
        run from dark to bright, as in a `Segmentation`, inner edges lie within the brighter segment. The inner edges
        of an object on label 0 are its rim.
    ignore : int, optional
        Label whose borders are not edges: 0 for the masked pixels of a `Segmentation`.

    Returns
    -------
    (H, W) bool array

    Notes
    -----
    For objects on label 0 that do not touch, the modes are those of ``skimage.segmentation.find_boundaries``. Where
    objects touch, scikit-image marks the rims of both in mode "inner"; here the edge stays one pixel wide.

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, X. Wang, Centroidal Voronoi tessellation algorithms for image compression,
    segmentation, and multichannel restoration, J. Math. Imaging Vision 24 (2006) 177-194,
    doi 10.1007/s10851-005-3620-4.

    Examples
    --------
    >>> from cvtimg import find_edges
    >>> labels = np.array([[1, 1, 2, 2, 3]])
    >>> find_edges(labels).astype(int).tolist(), find_edges(labels, mode="outer").astype(int).tolist()
    ([[0, 0, 1, 0, 1]], [[0, 1, 0, 1, 0]])
    """
    segments = check_labels("labels", labels)
    check_choice("mode", mode, EDGE_MODES)
    edges = np.zeros(segments.shape, np.bool_)
    for before, after in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        for side, other in ((before, after), (after, before)):
            met = EDGE_MODES[mode](segments[side], segments[other])
            counts = True if ignore is None else (segments[side] != ignore) & (segments[other] != ignore)
            edges[side] |= met & counts
    return edges
