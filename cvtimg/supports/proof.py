"""Whether disks cover a region so many times, by the arrangement of their circles: a proof, not a test of samples.

A part of the region that is covered too few times is bounded by circles, by the boundary, and, where sight is blocked,
by barriers and the edges of shadows. So it has a corner where two of these cross, or it is bounded by one circle. The
cover holds if at each such place enough disks hold a neighborhood of it, other than those whose circles or shadows
cross there. Each of these conditions is also necessary.

C.-F. Huang, Y.-C. Tseng, Mobile Networks and Applications 10 (2005) 519-528, doi 10.1007/s11036-005-1564-y, for disks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg.supports import _supports
from cvtimg.supports.sight import Rows, Sight, lies_in, overlaps

_Floats = NDArray[np.float64]
_Ints = NDArray[np.intp]

#: Share of the size of the region by which places beside a barrier are beside it.
_ASIDE = 1e-10
#: Sectors narrower than this, in radians, are not looked into.
_NARROW = 1e-9


class Places(NamedTuple):
    """Places to look at: (m, 2), a disk that holds each, and the (m, 2) disks that do not count there, or -1."""

    places: _Floats
    owners: _Ints
    without: _Ints


class Shadows(NamedTuple):
    """Edges of shadows: (k,) the points that do not see beyond, (k, 2) where they begin, and their directions."""

    own: _Ints
    tips: _Floats
    directions: _Floats


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """Places that are covered too few times."""

    places: _Floats  # (m, 2); none if the cover is proved
    missing: NDArray[np.int32]  # (m,) how many more disks each needs
    without: NDArray[np.int32]  # (m, 2) disks that cross there, or -1: if they grow, the gap only moves


def find_gaps(points: _Floats, radii: _Floats, sight: Sight, order: int) -> Gaps:
    """Find where disks cover a region fewer than `order` times: corners of all parts where they do."""
    meets = overlaps(points, radii)
    near = sight.near(points, radii)
    around = near if sight.blocking else sight.around(points, radii)
    shadows = _shadows(points, radii, sight)
    parts = [
        _circle_crossings(points, radii, meets),
        _barrier_crossings(points, radii, sight, around),
        _corners(points, radii, sight, shadows),
        _shadow_crossings(points, radii, sight, shadows, meets, around),
    ]
    looked_at = Places(*(np.concatenate([part[at] for part in parts]) for at in range(3)))
    places, without = np.ascontiguousarray(looked_at.places), np.ascontiguousarray(looked_at.without, np.int32)
    owners = looked_at.owners.astype(np.int32)
    given = places, owners, without, points, radii, *meets, sight.barriers, *near, sight.tolerance, 0.0, order
    depths = _supports.count_depths(*given)
    few = np.flatnonzero(depths < order)
    few = few[_inside(sight, places[few])]
    return Gaps(places[few], order - depths[few], without[few])


def _inside(sight: Sight, places: _Floats) -> NDArray[np.bool_]:
    """Tell which places lie in the region; where nothing blocks sight, those on its boundary do."""
    if not len(places):
        return np.zeros(0, bool)
    return sight.region.contains(places) if sight.blocking else lies_in(sight.region, places, sight.tolerance)


def _circle_crossings(points: _Floats, radii: _Floats, meets: Rows) -> Places:
    """Where two circles cross, and a place on each circle."""
    own, other = meets.spread(np.arange(len(points)))
    once = own < other
    own, other = own[once], other[once].astype(np.intp)
    steps = points[other] - points[own]
    apart = np.linalg.norm(steps, axis=1)
    cross = apart > np.abs(radii[own] - radii[other])
    own, other, steps, apart = own[cross], other[cross], steps[cross], apart[cross]
    along = (apart**2 + radii[own] ** 2 - radii[other] ** 2) / (2 * apart)
    across = np.sqrt(np.maximum(radii[own] ** 2 - along**2, 0))
    directions = steps / apart[:, None]
    middles = points[own] + along[:, None] * directions
    aside = across[:, None] * np.stack([-directions[:, 1], directions[:, 0]], axis=1)
    every = np.arange(len(points))
    right = points + np.stack([radii, np.zeros(len(points))], axis=1)
    return Places(
        np.concatenate([middles + aside, middles - aside, right]),
        np.concatenate([own, own, every]),
        np.concatenate([_pairs(own, other), _pairs(own, other), _pairs(every)]),
    )


def _barrier_crossings(points: _Floats, radii: _Floats, sight: Sight, around: Rows) -> Places:
    """Where circles cross barriers; on both sides of these where they block sight."""
    own, items = around.spread(np.arange(len(points)))
    segments = sight.barriers[items]
    starts, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    lengths = np.linalg.norm(along, axis=1)
    along = along / lengths[:, None]
    steps = starts - points[own]
    middles = (steps * along).sum(axis=1)
    under = middles**2 - (steps**2).sum(axis=1) + radii[own] ** 2
    found, owners, sides = [], [], []
    for sign in (-1, 1):
        at = -middles + sign * np.sqrt(np.maximum(under, 0))
        good = (under > 0) & (at >= -sight.tolerance) & (at <= lengths + sight.tolerance)
        found.append(starts[good] + at[good, None] * along[good])
        owners.append(own[good])
        sides.append(along[good])
    places, owner, side = np.concatenate(found), np.concatenate(owners), np.concatenate(sides)
    places, owner = _beside(places, owner, side, sight)
    return Places(places, owner, _pairs(owner))


def _beside(places: _Floats, own: _Ints, along: _Floats, sight: Sight) -> tuple[_Floats, _Ints]:
    """Move places on barriers that block sight a little to both sides."""
    if not sight.blocking:
        return places, own
    aside = _ASIDE * sight.size * np.stack([-along[:, 1], along[:, 0]], axis=1)
    return np.concatenate([places + aside, places - aside]), np.concatenate([own, own])


def _corners(points: _Floats, radii: _Floats, sight: Sight, shadows: Shadows) -> Places:
    """Take ends of barriers and where slits cross barriers; each sector around them where they block sight."""
    ends = np.unique(np.concatenate([sight.barriers.reshape(-1, 2), _crossings(sight)]), axis=0)
    if sight.blocking:
        ends = np.concatenate([_sectors(end, sight, shadows) for end in ends])
    owners = np.empty(len(ends), np.intp)
    step = max(1, (1 << 22) // len(points))
    for start in range(0, len(ends), step):
        part = ends[start : start + step]
        over = np.linalg.norm(part[:, None] - points, axis=2) - radii
        owners[start : start + step] = over.argmin(axis=1)
    return Places(ends, owners, np.full((len(ends), 2), -1))


def _crossings(sight: Sight) -> _Floats:
    """(c, 2) places where slits cross other barriers."""
    slits = sight.barriers[sight.n_boundary :]
    found = [np.empty((0, 2))]
    for number, slit in enumerate(slits):
        others = np.delete(sight.barriers, sight.n_boundary + number, axis=0)
        along, across = slit[2:] - slit[:2], others[:, 2:] - others[:, :2]
        turn = along[0] * across[:, 1] - along[1] * across[:, 0]
        others, across, turn = others[turn != 0], across[turn != 0], turn[turn != 0]
        steps = others[:, :2] - slit[:2]
        at = (steps[:, 0] * across[:, 1] - steps[:, 1] * across[:, 0]) / turn
        there = (steps[:, 0] * along[1] - steps[:, 1] * along[0]) / turn
        good = (at > 0) & (at < 1) & (there >= 0) & (there <= 1)
        found.append(slit[:2] + at[good, None] * along)
    return np.concatenate(found)


def _sectors(end: _Floats, sight: Sight, shadows: Shadows) -> _Floats:
    """(s, 2) places around the end of a barrier: between barriers and edges of shadows that meet there."""
    size = sight.size
    starts, ends = sight.barriers[:, :2], sight.barriers[:, 2:]
    along = ends - starts
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    steps = end - starts
    at = (steps * along).sum(axis=1)
    on = np.linalg.norm(steps - at[:, None] * along, axis=1) <= 1e-12 * size
    forward = on & (at >= -1e-12 * size) & (at < np.linalg.norm(ends - starts, axis=1) - 1e-12 * size)
    backward = on & (at > 1e-12 * size) & (at <= np.linalg.norm(ends - starts, axis=1) + 1e-12 * size)
    cast = (shadows.tips == end).all(axis=1)
    directions = np.concatenate([along[forward], -along[backward], shadows.directions[cast]])
    angles = np.sort(np.arctan2(directions[:, 1], directions[:, 0]))
    widths = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    middles = (angles + widths / 2)[widths > _NARROW]
    return end + _ASIDE * size * np.stack([np.cos(middles), np.sin(middles)], axis=1)


def _shadows(points: _Floats, radii: _Floats, sight: Sight) -> Shadows:
    """Edges of shadows from the tips in each disk that its point sees."""
    apart = np.linalg.norm(points[:, None] - sight.tips, axis=2)
    own, tips = np.nonzero((apart < radii[:, None]) & (apart > sight.tolerance))
    seen = sight.sees(points, own, sight.tips[tips], slack=-sight.slack)
    own, tips = own[seen], tips[seen]
    directions = sight.tips[tips] - points[own]
    return Shadows(own, sight.tips[tips], directions / np.linalg.norm(directions, axis=1, keepdims=True))


def _shadow_crossings(
    points: _Floats, radii: _Floats, sight: Sight, shadows: Shadows, meets: Rows, around: Rows
) -> Places:
    """Where edges of shadows cross circles, barriers and each other."""
    if not len(shadows.own):
        return Places(np.empty((0, 2)), np.empty(0, np.intp), np.empty((0, 2), np.intp))
    parts = []
    at, disks = meets.spread(shadows.own)
    steps = shadows.tips[at] - points[disks]
    middles = (steps * shadows.directions[at]).sum(axis=1)
    under = middles**2 - (steps**2).sum(axis=1) + radii[disks] ** 2
    for sign in (-1, 1):
        along = -middles + sign * np.sqrt(np.maximum(under, 0))
        good = (under > 0) & (along > 0)
        places = shadows.tips[at[good]] + along[good, None] * shadows.directions[at[good]]
        parts.append(Places(places, shadows.own[at[good]], _pairs(shadows.own[at[good]], disks[good])))
    at, items = around.spread(shadows.own)
    segments = sight.barriers[items]
    sides = segments[:, 2:] - segments[:, :2]
    along, share = _meet(shadows.tips[at], shadows.directions[at], segments[:, :2], sides)
    good = (along > sight.slack) & (share >= 0) & (share <= 1)
    places = shadows.tips[at[good]] + along[good, None] * shadows.directions[at[good]]
    sides = sides[good] / np.linalg.norm(sides[good], axis=1, keepdims=True)
    places, own = _beside(places, shadows.own[at[good]], sides, sight)
    parts.append(Places(places, own, _pairs(own)))
    one, other = _shadow_pairs(shadows, meets, len(points))
    along, share = _meet(shadows.tips[one], shadows.directions[one], shadows.tips[other], shadows.directions[other])
    good = (along > 0) & (share > 0)
    places = shadows.tips[one[good]] + along[good, None] * shadows.directions[one[good]]
    parts.append(Places(places, shadows.own[one[good]], _pairs(shadows.own[one[good]], shadows.own[other[good]])))
    found = Places(*(np.concatenate([part[at] for part in parts]) for at in range(3)))
    held = np.linalg.norm(found.places - points[found.owners], axis=1) <= radii[found.owners] * (1 + 1e-9)
    return Places(found.places[held], found.owners[held], found.without[held])


def _shadow_pairs(shadows: Shadows, meets: Rows, n_points: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of shadows with different beginnings, of disks that meet."""
    at, disks = meets.spread(shadows.own)
    firsts = np.searchsorted(shadows.own, np.arange(n_points + 1))
    of_disk = Rows(firsts.astype(np.int32), np.arange(len(shadows.own), dtype=np.int32))
    again, other = of_disk.spread(disks.astype(np.intp))
    one = at[again]
    good = (one < other) & (shadows.tips[one] != shadows.tips[other]).any(axis=1)
    return one[good], other[good].astype(np.intp)


def _meet(starts: _Floats, along: _Floats, others: _Floats, across: _Floats) -> tuple[_Floats, _Floats]:
    """How far along two lines each they cross; -1 where they are parallel."""
    turn = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    steps = others - starts
    safe = np.where(np.abs(turn) > 1e-14, turn, 1.0)
    first = (steps[:, 0] * across[:, 1] - steps[:, 1] * across[:, 0]) / safe
    second = (steps[:, 0] * along[:, 1] - steps[:, 1] * along[:, 0]) / safe
    return np.where(np.abs(turn) > 1e-14, first, -1), np.where(np.abs(turn) > 1e-14, second, -1)


def _pairs(own: _Ints, other: _Ints | None = None) -> _Ints:
    return np.stack([own, np.full(len(own), -1) if other is None else other], axis=1)
