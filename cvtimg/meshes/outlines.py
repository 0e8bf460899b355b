"""Outlines of what is meshed: lines that run from corner to corner, with the labels on both of their sides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Array, Bools, Floats, ImageLike, Indices, Ints, Points
from cvtimg.labels.components import connected_pieces
from cvtimg.labels.contours import find_contours
from cvtimg.meshes.areas import Areas

#: Degrees by which contours turn at corners, since they are jagged by their pixels: with more, corners become round.
_JAGGED = 55.0
#: Pixels that points of contours move at most when they are smoothed: with more, contours lose their shape.
TOLERANCE = 0.7
#: Where a line turns by more, in degrees, at the start of a ring or between long sides, that is a corner.
CLEAR_CORNER = 10.0
#: A fixed point this near to a line, by the diameter of all, is on it; points as near to each other are one.
ON_LINE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Borders of what is meshed."""

    # From corner to corner, or closed, if the last point is the first; lines meet at their ends only.
    lines: tuple[Points, ...]
    sides: Ints  # (M, 2): labels of both sides of each line, as in `Borders`
    nodes: Points  # (V, 2): where lines start and stop
    ends: Indices  # (M, 2): the nodes where each does
    bounds: Points  # (2, 2): least and greatest coordinates
    mask: Bools | None  # (H, W): the pixels inside, if coordinates are in pixels of an image
    contains: Callable[[Points], Bools]  # Tells which of (N, 2) points are inside
    areas: Areas | None = None  # That segments keep although their borders are smoothed
    polygons: Any = None  # What it is the outline of, if that is polygons of shapely
    changes: Any = None  # What these lost when they were cleaned: `OutlineChanges`
    still: tuple[int, ...] = ()  # Nodes that were asked for, and stay even where areas are kept

    @classmethod
    def of(cls, lines: Sequence[Points], *about: Any, **more: Any) -> Outline:
        """Make an outline of lines, whose ends at the same place are one node, and what else there is."""
        sides, *others = about
        nodes, ends = np.unique([line[at] for at in (0, -1) for line in lines], axis=0, return_inverse=True)
        return cls(tuple(lines), sides, nodes, ends.reshape(2, -1).T, *others, **more)

    @property
    def is_closed(self) -> Bools:
        """Tell which lines (M,) end where they start."""
        return np.asarray(self.ends[:, 0] == self.ends[:, 1])

    @property
    def corners(self) -> Bools:
        """Tell which nodes (V,) are corners: the ends of lines that are open, or turn where they start."""
        is_corner = np.zeros(len(self.nodes), bool)
        is_corner[list(self.still)] = True
        is_corner[self.ends[~self.is_closed]] = True
        is_corner |= np.bincount(self.ends.ravel(), minlength=len(is_corner)) > 2
        rings = [line[[-2, 0, 1]] for line, closed in zip(self.lines, self.is_closed, strict=True) if closed]
        turns = turns_of(*np.array(rings).reshape(-1, 3, 2).transpose(1, 0, 2))
        is_corner[self.ends[self.is_closed, 0][turns > CLEAR_CORNER]] = True
        return is_corner

    @property
    def diameter(self) -> float:
        """Length of the diagonal of the bounds."""
        return float(np.hypot(*(self.bounds[1] - self.bounds[0])))

    def cut(self, lines: Sequence[Points], source: Indices | list[int], still: Points) -> Outline:
        """Return the outline with lines that are parts of those of `source`, and nodes at places (P, 2) still."""
        from scipy.spatial import cKDTree

        areas = None if self.areas is None else self.areas.of_parts(np.array(source))
        about = self.bounds, self.mask, self.contains, areas, self.polygons, self.changes
        cut = Outline.of(lines, self.sides[source], *about)
        gaps = cKDTree(np.concatenate([still, self.nodes[list(self.still)]])).query(cut.nodes)[0]
        return replace(cut, still=tuple(np.flatnonzero(gaps <= ON_LINE * self.diameter).tolist()))

    def check_inside(self, name: str, points: Points, values: Floats, right: Bools, allowed: str) -> None:
        """Refuse values (N, ...) that are not right (N,) at points (N, 2) inside."""
        wrong = np.flatnonzero(~right)
        inside = wrong[self.contains(points[wrong])] if len(wrong) else wrong
        if len(inside):
            value = f"{values[inside[0]]:g}" if values.ndim == 1 else values[inside[0]].tolist()
            check_that(f"{name} is {value} at {points[inside[0]].tolist()} and", False, allowed)

    def detail_for(self, n: int) -> float:
        """Return a `min_size` by which polygons have no more than about `n` points; 0 if there is none."""
        detail, size = 0.0, self.diameter / 8
        while self.polygons is not None and size > 1e-6 * self.diameter:
            simpler = shapely.simplify(self.polygons, size / 2)
            if simpler.area > 0 and shapely.get_num_coordinates(simpler) > n:
                break
            detail, size = size if simpler.area > 0 else detail, size / 2**0.5
        return detail


@dataclass(frozen=True, slots=True, eq=False)
class StraightParts:
    """The straight parts of lines, to find the nearest one."""

    places: Points  # (P, 2): the points of all lines, one after the other
    of_line: Indices  # (P,): the line of each
    first: Indices  # (S,): the points where parts start
    tree: Any  # Of shapely, with the parts

    @classmethod
    def of(cls, lines: Sequence[Points]) -> StraightParts:
        """Divide lines into their straight parts."""
        places, of_line = np.concatenate(lines), np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        first = np.flatnonzero(np.diff(of_line) == 0)
        return cls(places, of_line, first, shapely.STRtree(shapely.linestrings(places[first[:, None] + [0, 1]])))

    def nearest(self, points: Points) -> tuple[Indices, Floats]:
        """Return where the parts nearest to points (N, 2) start, and how far along them these are, from 0 to 1."""
        # Points are near to lines mostly, and small boxes around them are compared ten times as fast as distances.
        steps = self.places[self.first + 1] - self.places[self.first]
        reach = 0.1 * float(np.median(np.hypot(*steps.T)))
        point, part = self.tree.query(shapely.box(*(points - reach).T, *(points + reach).T))
        gaps = self._along(points[point], self.first[part])[1]
        order = np.lexsort((part, gaps, point))
        best = order[np.unique(point[order], return_index=True)[1]]
        nearest = np.full(len(points), -1)
        nearest[point[best]] = np.where(gaps[best] <= reach, part[best], -1)
        far = nearest < 0
        nearest[far] = self.tree.nearest(shapely.points(points[far]))
        first = self.first[nearest]
        return first, self._along(points, first)[0]

    def _along(self, points: Points, first: Indices) -> tuple[Floats, Floats]:
        """Return how far along parts (N,) the places nearest to points (N, 2) are, from 0 to 1, and the gaps."""
        start, step = self.places[first], self.places[first + 1] - self.places[first]
        share = np.clip(((points - start) * step).sum(axis=1) / (step**2).sum(axis=1), 0, 1)
        return share, np.hypot(*(start + share[:, None] * step - points).T)

    def feet(self, points: Points) -> Points:
        """Return the places (N, 2) on lines that are nearest to points."""
        first, share = self.nearest(points)
        return self.places[first] + share[:, None] * (self.places[first + 1] - self.places[first])


def label_outline(labels: Ints, image: ImageLike | None, tolerance: float) -> Outline:
    """Return the borders of segments; pixels of label 0 are outside."""
    mask = labels > 0
    check_that("labels", mask.any(), "not be 0 everywhere")
    cracks = find_contours(labels)
    contours = cracks if image is None else find_contours(labels, image)
    areas = Areas.of(list(contours.lines), _pieces_beside(cracks.lines, connected_pieces(labels)))
    lines: list[Points] = []
    source: list[int] = []
    for number, (line, both) in enumerate(zip(contours.lines, contours.sides, strict=True)):
        if both.max() > 0:
            parts = [_smoothed(part, tolerance) for part in _cut_contour(line, tolerance)]
            lines += parts
            source += [number] * len(parts)

    def contains(points: Points) -> Bools:
        at = np.clip(points.astype(np.intp), 0, np.array(mask.shape[::-1]) - 1)
        return mask[at[:, 1], at[:, 0]]

    bounds = np.array([[0.0, 0.0], [mask.shape[1], mask.shape[0]]])
    kept = areas.of_parts(np.array(source)) if tolerance else None
    return Outline.of(lines, contours.sides[source], bounds, mask, contains, kept)


def _pieces_beside(lines: Sequence[Points], pieces: Ints) -> Indices:
    """Numbers (M, 2) of the pieces on both sides of lines along the sides of pixels; 0 beyond the image."""
    padded = np.pad(pieces, 1)
    first = np.array([line[0] for line in lines])
    along = np.sign([line[1] - line[0] for line in lines])
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    sides = [np.floor(first + (along + side * across) / 2).astype(np.intp) + 1 for side in (1, -1)]
    return np.stack([padded[at[:, 1], at[:, 0]] for at in sides], axis=1).astype(np.intp)


def _cut_contour(line: Points, tolerance: float) -> list[Points]:
    """Cut a contour at its corners, or, if it must stay where it is, at all turns."""
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    dense = divided_steps(line, np.maximum(np.rint(lengths), 1).astype(np.intp))[0]  # points about a pixel apart
    is_closed = bool((line[0] == line[-1]).all())
    n = len(dense) - 1
    reach = min(4, max(n // 3, 1)) if tolerance else 1  # pixels before and after a corner
    at = np.arange(n) if is_closed else np.arange(1, n)
    before, after = at - reach, at + reach
    before, after = (before % n, after % n) if is_closed else (np.maximum(before, 0), np.minimum(after, n))
    turns = turns_of(dense[before], dense[at], dense[after])
    corners: list[int] = []
    for index in np.argsort(-turns, kind="stable"):
        if turns[index] <= (_JAGGED if tolerance else 1e-6):
            break
        gaps = np.abs(np.array(corners, np.intp) - at[index])
        if not len(gaps) or np.minimum(gaps, n - gaps if is_closed else gaps).min() >= reach:
            corners.append(int(at[index]))
    return split_line(dense, np.sort(np.array(corners, np.intp)))


def turns_of(before: Points, at: Points, after: Points) -> Floats:
    """Angles (N,), in degrees, by which the way over three points turns."""
    come, go = at - before, after - at
    turns = np.arctan2(cross(come, go), (come * go).sum(axis=1))
    return np.abs(np.degrees(turns))


def cross(a: Points, b: Points) -> Floats:
    """Cross products (N,) of vectors (N, 2)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def divided(n_parts: Indices) -> tuple[Indices, Indices]:
    """Return the step of each part of all steps, and its number there, from 0."""
    step = np.repeat(np.arange(len(n_parts)), n_parts)
    return step, np.arange(len(step)) - (np.cumsum(n_parts) - n_parts)[step]


def divided_steps(places: Points, n_parts: Indices) -> tuple[Points, Indices]:
    """Divide the steps between (P, 2) places into (P - 1,) parts; also return the place before each new one."""
    start, number = divided(n_parts)
    made = places[start] + (number / n_parts[start])[:, None] * np.diff(places, axis=0)[start]
    return np.concatenate([made, places[-1:]]), np.append(start, len(places) - 1)


def _smoothed(line: Points, tolerance: float) -> Points:
    """Smooth a line, its ends kept; no point moves farther than `tolerance`.

    What one pass makes shorter the next makes longer: G. Taubin, SIGGRAPH 1995, doi 10.1145/218380.218473.
    """
    if not tolerance or len(line) < 3:
        return line
    is_closed = bool((line[0] == line[-1]).all())
    smooth = line.copy()
    # Points move as far as the root of the number of passes.
    for turn in range(2 * round(6 * max(tolerance / TOLERANCE, 1) ** 2)):
        part = -0.53 if turn % 2 else 0.5  # of the way to the middle of its neighbors, back and forth
        if is_closed:
            ring = smooth[:-1]
            ring = ring + part * ((np.roll(ring, 1, axis=0) + np.roll(ring, -1, axis=0)) / 2 - ring)
            smooth = np.concatenate([ring, ring[:1]])
        else:
            smooth[1:-1] += part * ((smooth[:-2] + smooth[2:]) / 2 - smooth[1:-1])
    moved = smooth - line
    lengths = np.linalg.norm(moved, axis=1, keepdims=True)
    return line + moved * np.minimum(1, tolerance / np.maximum(lengths, 1e-300))


def split_line(line: Array, cuts: Indices) -> list[Array]:
    """Cut a line at some of its points; a closed one that is cut nowhere stays closed."""
    if (line[0] != line[-1]).any():
        ends = [0, *cuts[cuts > 0].tolist(), len(line) - 1]
        return [line[start : stop + 1] for start, stop in pairwise(ends)]
    if not len(cuts):
        return [line]
    ring = np.concatenate([line[cuts[0] : -1], line[: cuts[0] + 1]])
    ends = [*(cuts - cuts[0]).tolist(), len(ring) - 1]
    return [ring[start : stop + 1] for start, stop in pairwise(ends)]


def with_points(outline: Outline, points: Points) -> tuple[Outline, Points]:
    """Cut lines at those of (F, 2) points that lie on them; also return the other points, which must be inside."""
    if not len(points):
        return outline, points
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(ON_LINE * outline.diameter, output_type="ndarray")
    for a, b in pairs[(points[pairs[:, 0]] != points[pairs[:, 1]]).any(axis=1)].tolist():
        raise ValueError(f"fixed has points {a} and {b}, nearer to each other than 1e-9 of the region's diameter")
    points, parts = np.unique(points, axis=0), StraightParts.of(outline.lines)
    first, share = parts.nearest(points)
    is_on = np.linalg.norm(parts.feet(points) - points, axis=1) <= ON_LINE * outline.diameter
    alone = points[~is_on]
    for point in alone:
        check_that(f"fixed has {point.tolist()} and", outline.contains(point[None])[0], "be in the region")
    lines: list[Points] = []
    source: list[int] = []
    for number, line in enumerate(outline.lines):
        here = np.flatnonzero(is_on & (parts.of_line[first] == number))
        here = here[np.argsort(first[here] + share[here])]
        segment = first[here] - np.searchsorted(parts.of_line, number)
        is_old = (points[here, None] == line[segment[:, None] + [0, 1]]).all(axis=2).any(axis=1)
        new = np.insert(line, segment[~is_old] + 1, points[here[~is_old]], axis=0)
        cuts = np.flatnonzero((new[:-1, None] == points[here]).all(axis=2).any(axis=1))
        lines += split_line(new, cuts)
        source += [number] * (len(lines) - len(source))
    return outline.cut(lines, source, points), alone
