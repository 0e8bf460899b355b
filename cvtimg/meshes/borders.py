"""Vertices along borders: corners, and as many between them as sizes ask for, closer where borders crowd."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg._shared.extras import optional
from cvtimg._shared.progress import first_few
from cvtimg.halfedges import edge_keys, unique_edges
from cvtimg.labels.contours import OUTSIDE
from cvtimg.meshes.fields import Field, lengths_of
from cvtimg.meshes.outlines import Outline, cross, divided, divided_steps, turns_of
from cvtimg.meshes.sliding import Tracks, places_at
from cvtimg.meshes.triangulation import Borders

Points = NDArray[np.float64]

#: A closed smooth line of a polygon has at least so many edges; another is curved if it is longer than the way between
#: its ends by this factor.
_ROUND, _CURVED = 6, 1 + 1e-6
#: A line is sampled at steps of at most this part of an edge.
_STEP = 0.34
#: Steps that are too long are divided in so many parts at most at once, since sizes may be tiny at one end only.
_PARTS, _LEAST_PASSES, _PASSES = 256, 3, 12
#: A vertex must not be nearer to the edge of another line than this part of that edge; the second is for contours of
#: pixels, which have many thin parts.
_NEAR, _NEAR_PIXELS = 0.4, 0.5
#: It may be this much nearer where the outside is between them, as in a slit: no triangle is there.
_BEYOND = 0.3
#: Edges at a corner that meet at less than this angle, in degrees, where their lines do at one so much larger, are too
#: long; but on contours of pixels none are made shorter than this.
_NARROW, _WIDER, _PIXELS = 25.0, 1.5, 2.0
#: But where two lines meet at an angle with less than this sine, sizes that grow from the corner are as good as can be
#: within so many lengths of the edge: shorter edges there would only move what is narrow nearer to the corner.
_SHARP, _TIP = 0.42, 5.0
#: Rounds of making crowded edges shorter; in the last ones, only where they cross.
_ROUNDS, _LAST_ROUNDS = 12, 5
#: The sizes around follow edges that are shorter than this part of what was wanted.
_SHORT = 0.75
#: On contours of pixels, vertices are moved outwards by no more than this many pixels, to keep areas.
_MOST_OUTWARDS = 0.7
#: On contours of pixels, no sizes are lowered to less, in pixels: edges may shrink to nothing where areas are kept.
_FINEST = 0.125
#: Vertices slide along a border where edges turn by less than this, in degrees.
_SMOOTH = 20.0


def place_on_borders(
    outline: Outline,
    field: Field,
    grade: float,
    min_size: float,
    share: float = 1.0,
    most: float = np.inf,
    on_curves: int = 2,
) -> tuple[Borders, Field]:
    """Place vertices on the lines of an outline; return them with the field that follows their edges.

    There are as many as sizes ask for, times `share`. Where crowded borders come to more than `most`, that is all that
    is found out. Curves of polygons have `on_curves` edges at least: with two, they can enclose what they should.

    Raises
    ------
    ValueError
        If edges cross however short they are.
    """
    for round_ in first_few(range(_ROUNDS)):
        borders, lines = _spaced(outline, field, share, on_curves)
        if len(borders.points) > most:
            return borders, field
        lengths = np.linalg.norm(np.subtract(*borders.points[borders.edges.T]), axis=1)
        crossed, near = _crowded(borders, lengths, lines, is_picture=outline.mask is not None)
        if round_ >= _ROUNDS - _LAST_ROUNDS:
            near[:] = False
        halved = crossed | near & (lengths > 2 * min_size)
        if not halved.any() and round_ > 0:
            return borders, field
        middles = borders.points[borders.edges].mean(axis=1)
        wanted = lengths_of(field.metric(middles), np.subtract(*borders.points[borders.edges.T]))
        sizes = lengths / np.maximum(wanted, 1e-300)
        low = np.where(halved, 0.5 * np.minimum(lengths, sizes), lengths)
        if outline.mask is not None:
            low = np.maximum(low, _FINEST)
        changed = halved | (wanted < _SHORT)
        if changed.any():
            middles, low = middles[changed], low[changed]
            if outline.twins is not None:
                middles, low = outline.twins.both(lines.of_edge[changed], middles, low)
            field = field.lowered(middles, low, grade)
    at = borders.points[borders.edges[crossed][:1]].mean(axis=(0, 1)).tolist()
    check_that(f"borders at {at}", not crossed.any(), "not cross or touch")
    return borders, field


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """How edges and vertices lie on lines."""

    of_edge: NDArray[np.intp]  # (E,): the line of each edge
    of_point: NDArray[np.intp]  # (N,): the line of each vertex, -1 for the ends of lines
    ends: NDArray[np.intp]  # (M, 2): the ends of each line
    starts: Points  # (E, 2, 2): where the line of each edge is a quarter of the way from either end

    def meet_sharply(
        self, points: Points, lengths: NDArray[np.float64], point: NDArray[np.intp], edge: NDArray[np.intp],
        gaps: NDArray[np.float64],
    ) -> NDArray[np.bool_]:  # fmt: skip
        """Tell which vertices (P,), at gaps from edges (P,), are near to a sharp corner where both their lines end."""
        n, own, other = len(points), self.of_point[point], self.of_edge[edge]
        joined = edge_keys(self.ends, n)
        sharp = np.zeros(len(point), bool)
        for k in (0, 1):
            corner = self.ends[other, k]
            keys = edge_keys(np.stack([point, corner], axis=1), n)
            meets = np.where(own < 0, np.isin(keys, joined), (self.ends[own] == corner[:, None]).any(axis=1))
            way = np.linalg.norm(points[point] - points[corner], axis=1)
            sharp |= meets & (own != other) & (gaps < _SHARP * way) & (way < _TIP * lengths[edge])
        return sharp

    def are_wider(
        self, points: Points, edges: NDArray[np.int32], links: NDArray[np.intp], edge: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Tell where edges (P,) meet others, linked to their ends (2, P), far more narrowly than the lines do."""
        wider = np.zeros(len(edge), bool)
        for k in (0, 1):
            pairs = np.flatnonzero(links[k] >= 0)
            one, other = edge[pairs], links[k, pairs]
            end = (edges[other, 1] == edges[one, k]).astype(np.intp)
            at = points[edges[one, k]]
            angle = 180 - turns_of(points[edges[one, 1 - k]], at, points[edges[other, 1 - end]])
            of_lines = 180 - turns_of(self.starts[one, k], at, self.starts[other, end])
            wider[pairs] |= (angle < _NARROW) & (of_lines > _WIDER * angle)
        return wider


def _spaced(outline: Outline, field: Field, share: float, on_curves: int) -> tuple[Borders, _Lines]:
    """Place vertices at equal steps, in the metric, along each line."""
    places, line_of = sampled(outline.lines, field)
    starts = np.flatnonzero(np.append(True, np.diff(line_of) > 0))
    stops = np.append(starts[1:], len(places)) - 1
    steps = np.diff(places, axis=0)
    lengths = lengths_of(field.metric((places[1:] + places[:-1]) / 2), steps)
    lengths[stops[:-1]] = 0  # from a line to the next
    along = np.append(0, np.cumsum(lengths))
    totals = along[stops] - along[starts]
    is_closed = (places[starts] == places[stops]).all(axis=1)
    far = np.linalg.norm(steps, axis=1)
    far[stops[:-1]] = 1  # so that lines are apart
    until = np.append(0, np.cumsum(far))
    least = np.where(is_closed, 3, 1)
    if outline.mask is None:
        is_curved = until[stops] - until[starts] > _CURVED * np.linalg.norm(places[stops] - places[starts], axis=1)
        least = np.where(is_closed, _ROUND, np.where(is_curved, on_curves, 1))
    n_edges = np.maximum(np.rint(totals * share).astype(np.intp), least)
    if outline.twins is not None:
        n_edges = outline.twins.same_numbers(n_edges)
    # The points of each line in order: its first node, its inner points, its last node.
    of_chain, number = divided(n_edges + 1)
    is_inner = (number > 0) & (number < n_edges[of_chain])
    own = of_chain[is_inner]
    at_chain = along[starts][of_chain] + number / n_edges[of_chain] * totals[of_chain]
    inner = places_at(at_chain[is_inner], along, places)
    nodes, index = np.unique(np.concatenate([places[starts], places[stops]]), axis=0, return_inverse=True)
    first, last = index.reshape(2, -1)
    chain = np.where(number == 0, first[of_chain], last[of_chain]).astype(np.int32)
    chain[is_inner] = len(nodes) + np.arange(len(own))
    points = np.concatenate([nodes, inner])
    if outline.mask is not None and not outline.on_lines:
        sweeps = cross(places[:-1], places[1:])
        sweeps[stops[:-1]] = 0
        swept = np.interp(at_chain, along, np.append(0, np.cumsum(sweeps)))
        points[len(nodes) :] += _outwards(points[chain], swept)[is_inner]
    at_edge = np.flatnonzero(of_chain[1:] == of_chain[:-1])
    edges = np.stack([chain[at_edge], chain[at_edge + 1]], axis=1)
    of_line = of_chain[at_edge]
    if outline.areas is not None and not outline.on_lines:
        ends_of_open = np.unique(np.concatenate([first[~is_closed], last[~is_closed]]))
        rim = edges[(outline.sides[of_line] == OUTSIDE).any(axis=1)].ravel()
        points = outline.areas.kept(points, edges, of_line, ends_of_open, rim)
    pairs = None if outline.twins is None else outline.twins.pairs(chain, of_chain)
    if pairs is not None:
        pairs.align(points)
    borders = Borders(points, edges, outline.sides[of_line], pairs=pairs)
    quarters = at_chain[at_edge, None] + np.diff(at_chain)[at_edge, None] * np.array([0.25, 0.75])
    near_ends = places_at(quarters, along, places)
    lines = _Lines(of_line, np.append(np.full(len(nodes), -1), own), np.stack([first, last], axis=1), near_ends)
    if outline.mask is not None or not len(inner):
        return borders, lines
    at_inner = np.flatnonzero(is_inner)
    before, after = points[chain[at_inner - 1]], points[chain[at_inner + 1]]
    tracks = Tracks.of(
        (len(nodes) + np.arange(len(own))).astype(np.int32),
        np.interp(at_chain[is_inner], along, until),
        np.minimum(np.linalg.norm(inner - before, axis=1), np.linalg.norm(after - inner, axis=1)),
        (places, until),
        until[starts][own],
        np.where(is_closed, until[stops] - until[starts], 0)[own],
    )
    smooth = turns_of(before, inner, after) < _SMOOTH
    if pairs is not None:
        smooth &= ~np.isin(chain[at_inner], pairs.vertices)
    return replace(borders, tracks=tracks.kept(smooth)), lines


def _outwards(points: Points, swept: NDArray[np.float64]) -> Points:
    """Find steps (N, 2) of points to the outer side of their curve, so that chords enclose as much area as it does.

    `swept` is twice the area that the curve has swept over, around the origin, until each point.
    """
    missing = np.append((np.diff(swept) - cross(points[:-1], points[1:])) / 2, 0)
    chords = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    lengths = np.maximum(np.linalg.norm(chords, axis=1), 1e-300)
    shifts = np.clip((missing + np.roll(missing, 1)) / lengths, -_MOST_OUTWARDS, _MOST_OUTWARDS)
    return shifts[:, None] * np.stack([chords[:, 1], -chords[:, 0]], axis=1) / lengths[:, None]


def sampled(lines: tuple[Points, ...], field: Field) -> tuple[Points, NDArray[np.intp]]:
    """Sample lines so closely that the metric hardly changes from point to point; also return the line of each."""
    places = np.concatenate(lines)
    line_of = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    for pass_ in range(_PASSES):
        metric, steps = field.metric(places), np.diff(places, axis=0)
        longest = np.maximum(lengths_of(metric[:-1], steps), lengths_of(metric[1:], steps))
        longest[np.diff(line_of) > 0] = 0
        n_parts = np.clip(np.ceil(longest / _STEP), 1, _PARTS).astype(np.intp)
        if pass_ >= _LEAST_PASSES and n_parts.max(initial=1) < _PARTS:
            break
        places, own = divided_steps(places, n_parts)
        line_of = line_of[own]
    return places, line_of


def _crowded(
    borders: Borders, lengths: NDArray[np.float64], lines: _Lines, *, is_picture: bool
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find edges (E,) that meet other than at their ends, and those with a vertex nearer than a part of them."""
    shapely = optional("shapely", "mesh")

    points, edges, part = borders.points, borders.edges, _NEAR_PIXELS if is_picture else _NEAR
    segments = shapely.linestrings(points[edges])
    tree = shapely.STRtree(segments)
    crossed, near = np.zeros(len(edges), bool), np.zeros(len(edges), bool)
    crossed[_crossing(points, edges, *tree.query(segments))] = True
    _, which, counts = unique_edges(edges)
    crossed |= counts[which] > 1
    reach = np.zeros(len(points))
    for end in (0, 1):
        np.maximum.at(reach, edges[:, end], lengths)
    point, edge = tree.query(shapely.points(points), predicate="dwithin", distance=part * reach)
    apart = (edges[edge] != point[:, None]).all(axis=1)
    point, edge = point[apart], edge[apart]
    gaps = shapely.distance(shapely.points(points[point]), segments[edge])
    crossed[edge[gaps < 1e-6 * lengths[edge]]] = True
    a, b = points[edges[edge]].transpose(1, 0, 2)
    beyond = np.where(cross(b - a, points[point] - a) > 0, borders.sides[edge, 0], borders.sides[edge, 1]) <= 0
    close = gaps < np.where(beyond, _BEYOND * part, part) * lengths[edge]
    point, edge, gaps = point[close], edge[close], gaps[close]
    links = np.stack([_edge_between(edges, point, edges[edge, end], len(points)) for end in (0, 1)])
    may_split = lengths[edge] > _PIXELS * is_picture
    fits = (links >= 0).any(axis=0) & ~(may_split & lines.are_wider(points, edges, links, edge))
    if not is_picture:
        fits |= lines.meet_sharply(points, lengths, point, edge, gaps)
    near[edge[~fits]] = True
    return crossed, near


def _crossing(
    points: Points, edges: NDArray[np.int32], one: NDArray[np.intp], other: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return those of some edges that cross others, given as pairs (P,): each has an end on both sides of the other."""
    apart = (edges[one][:, :, None] != edges[other][:, None, :]).all(axis=(1, 2))
    one, other = one[apart], other[apart]
    (a, b), (c, d) = (points[edges[which]].transpose(1, 0, 2) for which in (one, other))
    divided = (cross(b - a, c - a) * cross(b - a, d - a) < 0) & (cross(d - c, a - c) * cross(d - c, b - c) < 0)
    return one[divided]


def _edge_between(
    edges: NDArray[np.int32], one: NDArray[np.intp], other: NDArray[np.int32], n: int
) -> NDArray[np.intp]:
    """Find the edge (P,) between each two points, of n; -1 where there is none."""
    keys, wanted = edge_keys(edges, n), edge_keys(np.stack([one, other], axis=1), n)
    order = np.argsort(keys)
    found = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
    return np.where(keys[found] == wanted, found, -1)
