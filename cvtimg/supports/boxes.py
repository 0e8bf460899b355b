"""Radii by boxes: a ball that reaches the middle of a box by half its diagonal holds it.

Boxes that too few balls hold as a whole are halved along each axis, until the radii are as small as samples show, or
until there are too many boxes. So every place of the region is covered, however coarse the boxes are; the margin is
what the radii are too large by.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvtimg._shared.budgets import ENOUGH_SAMPLES, ROUNDING
from cvtimg._shared.types import Array, Bools, Floats, Indices
from cvtimg.placement import Region

#: Boxes at first, for each point: with more, radii come as near to the least with fewer halvings, of more boxes.
_BOXES_PER_POINT = 16
#: Neighbors beyond those that hold a box: by the distance of the last one boxes are small.
_AROUND = 3


class Tightening(NamedTuple):
    """How near radii come to the least."""

    margin: float = 0.02  # by this share they may be larger than samples show before boxes are halved,
    boxes: float = 100.0  # or if there are fewer for each point, by how far its neighbors are;
    halvings: int = 8  # halvings of a box at most
    few: int = 50  # points that each box sees where others than the nearest may hold it: with 40, 8 % more balls meet
    rounds: int = 12  # in which balls grow, draw back and take over: with 24, half of a percent fewer meet
    growth: float = 1.5  # to this times their first radius, so that others can shrink: with 1.3, 3 % more meet


_HOW = Tightening()


class Boxes(NamedTuple):
    """Middles of boxes (m, d), half their diagonals (m,), and the (m, k) nearest points with their distances."""

    middles: Floats
    halves: Floats
    points: Indices
    distances: Floats

    def only(self, chosen: Array) -> Boxes:
        """Leave some."""
        return Boxes(self.middles[chosen], self.halves[chosen], self.points[chosen], self.distances[chosen])


def lies_in(region: Region, places: Floats, tolerance: float) -> Bools:
    """Tell which places lie in a region, or no farther than a tolerance from it."""
    inside = region.contains(places)
    outside = np.flatnonzero(~inside)
    if len(outside):
        inside[outside] = np.linalg.norm(region.project(places[outside]) - places[outside], axis=1) <= tolerance
    return inside


def radii_by_boxes(points: Floats, region: Region, order: int, tightened: bool) -> Floats:
    """Find radii of balls around (n, d) points that cover a region `order` times."""
    tightened = tightened and order > 1
    n_near = min(len(points), order + (_HOW.few if tightened else _AROUND))
    n_first = min(_BOXES_PER_POINT * len(points), ENOUGH_SAMPLES)
    n_side = max(2, round(float(n_first ** (1 / points.shape[1]))))
    sides = (1 / n_side) * np.ptp(region.bounds, axis=0)
    axes = [low + (np.arange(n_side) + 0.5) * (1 / n_side) * (high - low) for low, high in region.bounds.T]
    middles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(sides))
    done = _looked_up(middles, sides, points, region, n_near)
    radii, finished = np.zeros(len(points)), list[Boxes]()
    finest, around = _HOW.boxes ** (-1 / len(sides)), min(_AROUND, len(points) - 1)
    for _ in range(_HOW.halvings):
        if len(done.middles):
            _reach(radii, done.only(region.contains(done.middles)), order, beyond=False)
        held = (_depths(done, (1 + _HOW.margin) * radii) >= order) & (sides.max() <= finest * done.distances[:, around])
        finished.append(done.only(held))
        left = done.only(~held)
        n_made = len(left.middles) * 2 ** points.shape[1]
        if not len(left.middles) or n_made + sum(len(each.middles) for each in finished) > 4 * ENOUGH_SAMPLES:
            break
        sides = sides / 2
        corners = np.array(list(np.ndindex(*(2,) * len(sides)))) - 0.5
        middles = (left.middles[:, None] + corners * sides).reshape(-1, len(sides))
        done = _looked_up(middles, sides, points, region, n_near)
    else:
        left = done
    radii = (1 + _HOW.margin) * radii
    boxes = Boxes(*(np.concatenate(parts) for parts in zip(*finished, left, strict=True)))
    _reach(radii, left.only(_depths(left, radii) < order), order, beyond=True)
    return _tightened(points, radii, boxes, order) if tightened else radii


def _looked_up(middles: Floats, sides: Floats, points: Floats, region: Region, n_near: int) -> Boxes:
    """Leave boxes that meet the region, and find the points nearest to each."""
    from scipy.spatial import cKDTree

    half = float(np.linalg.norm(sides)) / 2
    middles = middles[lies_in(region, middles, half * (1 + 1e-9))]
    distances, near = cKDTree(points).query(middles, n_near)
    distances, near = distances.reshape(len(middles), n_near), near.reshape(len(middles), n_near)
    return Boxes(middles, np.full(len(middles), half), near, distances)


def _reach(radii: Floats, boxes: Boxes, order: int, *, beyond: bool) -> None:
    """Let the nearest balls reach the middles of boxes, or beyond them, so that they hold them as a whole."""
    distances = boxes.distances[:, :order] + (boxes.halves[:, None] if beyond else 0)
    np.maximum.at(radii, boxes.points[:, :order].ravel(), distances.ravel())


def _depths(boxes: Boxes, radii: Floats) -> Indices:
    return (boxes.distances + boxes.halves[:, None] <= radii[boxes.points]).sum(axis=1)


def _tightened(points: Floats, radii: Floats, boxes: Boxes, order: int) -> Floats:
    """Let balls shrink as long as enough of them hold each box, so that fewer of them meet.

    They take turns: balls grow as far as they meet no others, which costs nothing, shrink by as much as parts them from
    one other, and take over what others hold.
    """
    cover, random = _Cover(points, radii, boxes, order), np.random.default_rng(0)
    for _ in range(_HOW.rounds):
        for change in (cover.grow, cover.draw_back, cover.exchange):
            for ball in random.permutation(len(points)):
                change(ball)
    for ball in np.argsort(-cover.radii):
        cover.set(ball, cover.least(ball))
    return cover.radii


class _Cover:
    """Balls that hold boxes, each box at least `order` of them, and no ball less than it holds as the nearest."""

    def __init__(self, points: Floats, radii: Floats, boxes: Boxes, order: int) -> None:
        from scipy.spatial import cKDTree

        self.radii = radii.copy()
        self._order, self._seen = order, boxes
        self._limits = _HOW.growth * radii
        self._floors = np.zeros(len(points))
        _reach(self._floors, boxes, 1, beyond=True)
        self._floors = np.minimum(self._floors, radii)
        needed = boxes.distances + boxes.halves[:, None]
        self._depths = (needed <= radii[boxes.points]).sum(axis=1)
        box, at = np.nonzero(needed <= self._limits[boxes.points])
        balls, reaches = boxes.points[box, at], needed[box, at]
        by_ball = np.lexsort((reaches, balls))
        ends = np.cumsum(np.bincount(balls, minlength=len(points)))[:-1]
        # Of each ball, the boxes that it may hold, the nearest first, and how far it must reach for them.
        self._boxes, self._reaches = np.split(box[by_ball], ends), np.split(reaches[by_ball], ends)
        pairs = cKDTree(points).query_pairs(2 * self._limits.max(), output_type="ndarray")
        gaps = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
        may_meet = gaps < self._limits[pairs].sum(axis=1)
        ball, other = np.concatenate([pairs[may_meet], pairs[may_meet, ::-1]]).T
        by_ball = np.argsort(ball, kind="stable")
        ends = np.cumsum(np.bincount(ball, minlength=len(points)))[:-1]
        # Of each ball, those that it may meet, and how far their centers are.
        self._others = np.split(other[by_ball], ends)
        self._gaps = np.split(np.tile(gaps[may_meet], 2)[by_ball], ends)

    def set(self, ball: int, radius: float) -> None:
        before, after = np.searchsorted(self._reaches[ball], (self.radii[ball], radius), side="right")
        self._depths[self._boxes[ball][after:before]] -= 1
        self._depths[self._boxes[ball][before:after]] += 1
        self.radii[ball] = radius

    def least(self, ball: int) -> float:
        """Return the radius that a ball needs while others stay."""
        n_held = np.searchsorted(self._reaches[ball], self.radii[ball], side="right")
        alone = np.flatnonzero(self._depths[self._boxes[ball][:n_held]] <= self._order)
        farthest = self._reaches[ball][alone[-1]] if len(alone) else 0.0
        return float(max(self._floors[ball], farthest))

    def grow(self, ball: int) -> None:
        """Let a ball grow as far as it meets no others than before."""
        room = self._room(ball)
        radius = min(float(room.min(where=room >= self.radii[ball], initial=np.inf)), self._limits[ball])
        self.set(ball, max(radius, self.radii[ball]))

    def draw_back(self, ball: int) -> None:
        """Let a ball shrink until it meets one ball less, if it can."""
        room, least = self._room(ball), self.least(ball)
        radius = float(room.max(where=(room >= least) & (room < self.radii[ball]), initial=0.0))
        if radius:
            self.set(ball, radius)

    def exchange(self, ball: int) -> None:
        """Let a ball shrink, and another take over what too few others hold then, if fewer meet in all."""
        held = slice(0, np.searchsorted(self._reaches[ball], self.radii[ball], side="right"))
        alone = self._depths[self._boxes[ball][held]] <= self._order
        boxes, reaches = self._seen.only(self._boxes[ball][held][alone]), self._reaches[ball][held][alone]
        others, rooms = self._others[ball], np.sort(self._room(ball))
        column = np.full(len(self.radii), len(others))
        column[others] = np.arange(len(others))
        # How far the others must reach for what it alone holds; those that do already are no help.
        ways = np.full((len(reaches), len(others) + 1), np.inf)
        ways[np.arange(len(ways))[:, None], column[boxes.points]] = boxes.distances + boxes.halves[:, None]
        ways = np.where(ways[:, :-1] > self.radii[others], ways[:, :-1], np.inf)
        rooms = rooms[(rooms >= self._floors[ball]) & (rooms < self.radii[ball])][::-1]
        best = (0, 0, 0.0, 0.0)
        for n_parted, radius in enumerate(rooms.tolist(), 1):
            grown = ways[reaches > radius].max(axis=0, initial=0)
            more = np.where((grown > 0) & (grown <= self._limits[others]), grown - self.radii[others], np.inf)
            if np.isfinite(more).any():
                other = more.argmin()
                room, now = self._room(others[other]), self.radii[others[other]]
                n_met = int(((room >= now) & (room < grown[other])).sum())
                best = min(best, (n_met - n_parted, int(others[other]), float(grown[other]), radius))
        if best[0] < 0:
            self.set(*best[1:3])
            self.set(ball, best[3])

    def _room(self, ball: int) -> Floats:
        """Return the radii up to which a ball does not meet others."""
        return (1 - ROUNDING) * (self._gaps[ball] - self.radii[self._others[ball]])
