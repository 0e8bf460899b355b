"""Vertices along borders: corners, and as many between them as sizes ask for, closer where borders crowd."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cvtimg._shared.checks import check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.progress import first_few
from cvtimg._shared.types import Bools, Floats, Indices, Ints, Points
from cvtimg.halfedges import EdgeTable, unique_edges
from cvtimg.labels.contours import OUTSIDE
from cvtimg.meshes.fields import Field, lengths_of
from cvtimg.meshes.outlines import Outline, cross, divided, divided_steps, turns_of
from cvtimg.meshes.triangulation import Borders

#: An edge beside a corner cuts off a curve there if it makes the corner sharper by more, in radians.
_CUT = 0.02
#: Part of `Spacing.near` where only the outside is between lines, and no triangle: with more, edges there are shorter.
_BEYOND = 0.3
#: Part of what was wanted below which edges are short, and sizes around follow them: with more, all sizes are smaller.
_SHORT = 0.75
#: Degrees by which edges turn at most where vertices slide along a border: with more, these leave its bends.
_STRAIGHT = 20.0


@dataclass(frozen=True, slots=True)
class Spacing:
    """How close vertices on borders are."""

    share: float = 0.95  # part of the vertices that sizes ask for, for cells end at borders; metrics get all of them
    closed: int = 6  # edges that a closed smooth line has at least
    near: float = 0.4  # no vertex is nearer to the edge of another line than this part of that edge
    finest: float = 0.0  # but no size is lowered to less, in pixels: edges may shrink to nothing where areas are kept

    @classmethod
    def of(cls, outline: Outline) -> Spacing:
        """Return that of polygons, or of contours of pixels, which have many thin parts."""
        if outline.mask is None:
            return cls()
        return cls(share=1.0, closed=3, near=0.5, finest=0.125)


@dataclass(frozen=True, slots=True)
class Crowding:
    """How vertices on borders may crowd."""

    grade: float  # growth of sizes for each unit of length
    least: float  # size: edges on borders may have half of it
    on_curves: int = 2  # edges of curves of polygons at least: with two, they can enclose what they should
    most: float = np.inf  # vertices: where there are more, that is all that is found out
    nearness: float = 1.0  # part of the usual distance to edges of other lines


def place_on_borders(outline: Outline, field: Field, how: Crowding) -> tuple[Borders, Field]:
    """Place vertices on the lines of an outline; return them with the field that follows their edges.

    Raises
    ------
    ValueError
        If edges cross however short they are.
    """
    spacing = Spacing.of(outline)
    for round_ in first_few(range(12)):
        chains = _Chains.of(outline, field, how.on_curves)
        borders = chains.borders()
        if len(borders.points) > how.most:
            return borders, field
        lengths = np.linalg.norm(np.subtract(*borders.points[borders.edges.T]), axis=1)
        crossed, near = _crowded(borders, lengths, chains, how.nearness)
        if how.nearness == 1:
            near |= _narrowing(borders, outline)
        if round_ >= 7:  # the last rounds are for edges that cross
            near[:] = False
        halved = crossed | near & (lengths > 2 * how.least)
        few = 1e-3 if how.nearness == 1 else 1e-2  # where angles are given up anyway
        if not crossed.any() and halved.sum() <= few * len(halved) and round_ > 0:
            return borders, field
        middles = borders.points[borders.edges].mean(axis=1)
        wanted = lengths_of(field.metric(middles), np.subtract(*borders.points[borders.edges.T]))
        sizes = lengths / np.maximum(wanted, 1e-300)
        low = np.where(halved, 0.5 * np.minimum(lengths, sizes), lengths)
        # Edges inside are shorter than wanted by up to a third.
        low = np.maximum(low, max(spacing.finest, how.least / 2**0.5))
        changed = halved | (wanted < _SHORT)
        if changed.any():
            field = field.lowered(middles[changed], low[changed], how.grade)
    at = borders.points[borders.edges[crossed][:1]].mean(axis=(0, 1)).tolist()
    hint = "not cross or touch; a larger snap joins them, and simplify takes points away"
    check_that(f"borders at {at}", not crossed.any(), hint)
    return borders, field


@dataclass(frozen=True, slots=True, eq=False)
class _Chains:
    """Vertices at equal steps, in the metric, along all lines: from the first node of each to its last."""

    outline: Outline
    places: Points  # (P, 2): points of all lines, one after the other
    along: Floats  # (P,): the length in the metric until each
    of_line: Indices  # (C,): the line of each vertex
    at: Floats  # (C,): where it is along all lines
    vertices: Ints  # (C,): its number; lines share their nodes, which come first

    @classmethod
    def of(cls, outline: Outline, field: Field, on_curves: int) -> _Chains:
        places, line_of = sampled(outline.lines, field)
        starts = np.flatnonzero(np.diff(line_of, prepend=-1) > 0)
        stops = np.append(starts[1:], len(places)) - 1
        steps = np.diff(places, axis=0)
        lengths, far = lengths_of(field.metric((places[1:] + places[:-1]) / 2), steps), np.linalg.norm(steps, axis=1)
        lengths[stops[:-1]] = far[stops[:-1]] = 0
        along, until = (np.append(0, np.cumsum(each)) for each in (lengths, far))
        spacing, chords = Spacing.of(outline), np.linalg.norm(places[stops] - places[starts], axis=1)
        is_curved = (until[stops] - until[starts] > (1 + 1e-6) * chords) & (outline.mask is None)
        least = np.where(outline.is_closed, spacing.closed, np.where(is_curved, on_curves, 1))
        totals = along[stops] - along[starts]
        n_edges = np.maximum(np.rint((spacing.share if field.isotropic else 1.0) * totals).astype(np.intp), least)
        of_line, number = divided(n_edges + 1)
        is_inner = (number > 0) & (number < n_edges[of_line])
        vertices = outline.ends[of_line, (number > 0).astype(np.intp)].astype(np.int32)
        vertices[is_inner] = len(outline.nodes) + np.arange(is_inner.sum())
        at = along[starts][of_line] + number / n_edges[of_line] * totals[of_line]
        return cls(outline, places, along, of_line, at, vertices)

    @property
    def inner(self) -> Indices:
        """Where the vertices (I,) between nodes are in chains."""
        return np.flatnonzero(self.vertices >= len(self.outline.nodes))

    def points(self) -> Points:
        """Return vertices (B, 2)."""
        inner = [np.interp(self.at[self.inner], self.along, axis) for axis in self.places.T]
        return np.concatenate([self.outline.nodes, np.stack(inner, axis=1)])

    def borders(self) -> Borders:
        """Join the vertices; segments get their areas."""
        outline, points = self.outline, self.points()
        first = self.first_of_edges()
        edges, of_line = self.vertices[first[:, None] + [0, 1]], self.of_line[first]
        sides = outline.sides[of_line]
        if outline.mask is not None and outline.areas is not None:
            rim = edges[(sides == OUTSIDE).any(axis=1)].ravel()
            ends = np.unique(outline.ends[~outline.is_closed])
            points = outline.areas.kept(points, edges, of_line, ends, np.append(rim, outline.still).astype(np.intp))
        corners = np.append(outline.corners, np.zeros(len(points) - len(outline.nodes), bool))
        borders = Borders(points, edges, sides, corners, of_line)
        if outline.mask is not None:
            return borders
        # Vertices slide along lines where edges hardly turn.
        before, here, after = (self.vertices[self.inner + step] for step in (-1, 0, 1))
        return replace(borders, slides=here[turns_of(points[before], points[here], points[after]) < _STRAIGHT])

    def first_of_edges(self) -> Indices:
        """Where the first vertex (E,) of each edge is in chains."""
        return np.flatnonzero(self.of_line[1:] == self.of_line[:-1])


def sampled(lines: tuple[Points, ...], field: Field) -> tuple[Points, Indices]:
    """Sample lines so closely that the metric hardly changes from point to point; also return the line of each."""
    places = np.concatenate(lines)
    line_of = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    for _ in range(12):
        metric, steps = field.metric(places), np.diff(places, axis=0)
        longest = np.maximum(lengths_of(metric[:-1], steps), lengths_of(metric[1:], steps))
        longest[np.diff(line_of) > 0] = 0
        # Sizes may be tiny at one end of a step only.
        n_parts = np.clip(np.ceil(longest / 0.34), 1, 256).astype(np.intp)
        if n_parts.max(initial=1) == 1:
            break
        places, start = divided_steps(places, n_parts)
        line_of = line_of[start]
    return places, line_of


def _crowded(borders: Borders, lengths: Floats, chains: _Chains, nearness: float) -> tuple[Bools, Bools]:
    """Find edges (E,) that meet other than at their ends, and those with a vertex nearer than a part of them."""
    points, edges, spacing = borders.points, borders.edges, Spacing.of(chains.outline)
    segments = shapely.linestrings(points[edges])
    tree = shapely.STRtree(segments)
    crossed, near = np.zeros(len(edges), bool), np.zeros(len(edges), bool)
    # Boxes are compared by the tree, and the rest by NumPy: the tree's own predicates take 10 times as long.
    first, second = tree.query(segments)
    first, second = first[first < second], second[first < second]
    (a, b), (c, d) = edges[first].T, edges[second].T
    apart = (a != c) & (a != d) & (b != c) & (b != d)
    first, second = first[apart], second[apart]
    (a, b), (c, d) = points[edges[first]].transpose(1, 0, 2), points[edges[second]].transpose(1, 0, 2)
    crosses = (cross(b - a, c - a) * cross(b - a, d - a) < 0) & (cross(d - c, a - c) * cross(d - c, b - c) < 0)
    crossed[first[crosses]] = crossed[second[crosses]] = True
    _, which, counts = unique_edges(edges)
    crossed |= counts[which] > 1
    reach = np.zeros(len(points))
    for end in (0, 1):
        np.maximum.at(reach, edges[:, end], lengths)
    low, high = (points + sign * spacing.near * reach[:, None] for sign in (-1, 1))
    point, edge = tree.query(shapely.box(*low.T, *high.T))
    apart = (edges[edge, 0] != point) & (edges[edge, 1] != point)
    point, edge = point[apart], edge[apart]
    a, b = points[edges[edge]].transpose(1, 0, 2)
    along = np.clip(((points[point] - a) * (b - a)).sum(axis=1) / np.maximum(lengths[edge] ** 2, 1e-300), 0, 1)
    gaps = np.linalg.norm(a + along[:, None] * (b - a) - points[point], axis=1)
    crossed[edge[gaps < 1e-6 * lengths[edge]]] = True
    beyond = np.where(cross(b - a, points[point] - a) > 0, borders.sides[edge, 0], borders.sides[edge, 1]) <= 0
    close = gaps < np.where(beyond, _BEYOND, 1) * nearness * spacing.near * lengths[edge]
    point, edge, gaps = point[close], edge[close], gaps[close]
    table = EdgeTable(edges, len(points))
    fits = np.any([table.find(np.stack([point, edges[edge, end]], axis=1)) >= 0 for end in (0, 1)], axis=0)
    if chains.outline.mask is None:
        fits |= _meet_sharply(borders, chains, lengths, point, edge, gaps)
    near[edge[~fits]] = True
    return crossed, near


def _narrowing(borders: Borders, outline: Outline) -> Bools:
    """Tell which edges (E,) cut off enough beside a corner of a polygon to make it sharp, or sharper."""
    narrowing = np.zeros(len(borders.edges), bool)
    if outline.mask is not None:
        return narrowing
    assert borders.of_line is not None
    numbers, lines = np.arange(len(outline.lines)), outline.lines
    edge = np.append(*(np.searchsorted(borders.of_line, numbers, side) for side in ("left", "right")))
    edge[len(numbers) :] -= 1
    steps = np.array([line[1] - line[0] for line in lines] + [line[-2] - line[-1] for line in lines])
    chords = np.subtract(*borders.points[borders.edges[edge].T[::-1]])
    chords[len(numbers) :] *= -1
    way, chord = (each @ [1, 1j] for each in (steps, chords))
    inside, node = outline.sides.T.ravel() > 0, outline.ends.T.ravel()
    # The ends of lines around each node, counterclockwise, and that after each.
    order = np.lexsort((np.angle(way), node))
    number, around = np.arange(len(order)), node[order]
    is_last = np.searchsorted(around, around, "right") == number + 1
    after = order[np.where(is_last, np.searchsorted(around, around), np.minimum(number + 1, number[-1]))]
    angle, cut = (np.angle(each[after] / each[order]) for each in (way, chord))
    is_sharp = inside[order] & (cut < angle) & (np.abs(cut) < np.arcsin(Spacing.of(outline).near))
    both = np.append(order[is_sharp], after[is_sharp])
    narrowing[edge[both]] = np.abs(np.angle(chord[both] / way[both])) > _CUT
    return narrowing


def _meet_sharply(
    borders: Borders, chains: _Chains, lengths: Floats, point: Indices, edge: Indices, gaps: Floats
) -> Bools:
    """Tell which vertices (P,), at gaps from edges (P,), are near to a sharp corner where both their lines end."""
    points, ends, near = borders.points, chains.outline.ends, Spacing.of(chains.outline).near
    lines = np.full(len(points), -1)
    lines[chains.vertices[chains.inner]] = chains.of_line[chains.inner]
    joined = EdgeTable(ends, len(points))
    of_point, of_edge = lines[point], chains.of_line[chains.first_of_edges()][edge]
    sharp = np.zeros(len(point), bool)
    for k in (0, 1):
        corner = ends[of_edge, k]
        is_joined = joined.find(np.stack([point, corner], axis=1)) >= 0
        meets = np.where(of_point < 0, is_joined, (ends[of_point] == corner[:, None]).any(axis=1))
        way = np.linalg.norm(points[point] - points[corner], axis=1)
        # Seen along an edge, it is near; farther away, shorter edges do not move what is narrow nearer to the corner.
        sharp |= meets & (of_point != of_edge) & (gaps < near * way) & (way < 5 * lengths[edge])
    return sharp
