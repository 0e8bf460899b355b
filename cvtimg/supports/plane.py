"""Radii in the plane: the exact reaches of points, disks that grow until their cover is proved, and smaller disks.

Disks shrink to what no others can spare, and take over places from each other where that lets fewer of them meet.
What is not covered is looked for at the corners of the arrangement, as in the proof, so that a cover stays one. No disk
becomes smaller than its own Voronoi cell: else some would vanish, and others grow instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg.supports import _supports
from cvtimg.supports.proof import Gaps, find_gaps
from cvtimg.supports.sight import Rows, Sight, as_rows, overlaps

_Floats = NDArray[np.float64]
#: Neighbors that are looked at first: so many, and so many for each unit of the order.
_FEW, _FEW_PER_ORDER = 16, 8
#: By how much more than twice the reach neighbors are looked for.
_FARTHER = 1.05
#: Rounds in which disks grow, at most.
_CLOSING = 60
#: By how much disks grow beyond a gap, as a share of their radius.
_BEYOND = 1e-7
#: Distances that are computed at a time.
_AT_ONCE = 1 << 22
#: Disks may grow to this times their first radius.
_GROWTH = 1.5
#: Parts of what they can spare that disks give up in turn, so that the first do not take all.
_PARTS = (0.3, 0.3, 0.5, 0.5, 1.0, 1.0, 1.0)
#: Rounds of exchanges at most, and the steps of all together, which grow as the 4th power of how many disks meet one.
_ROUNDS, _STEPS = 6, 4e8
_TRIALS, _HELPERS = 3, 12
#: Share of the size of the region by which places beside a barrier are beside it.
_ASIDE = 1e-10
#: Exact radii grow by so much, lest three circles meet in one place.
_INFLATION = 1e-6


def find_reaches(points: _Floats, sight: Sight, order: int) -> _Floats:
    """Find the greatest distance at which each of (n, 2) points is among the `order` nearest that see a place.

    Points are compared with their neighbors in a window. If a point is still among the nearest at its sides, the
    window was too small, and is enlarged.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    n_first = min(len(points), 1 + _FEW + _FEW_PER_ORDER * order)
    extents = tree.query(points, n_first)[0].reshape(len(points), n_first)[:, -1]
    widest = 2.1 * sight.size  # sees the whole region from anywhere
    if n_first == len(points):
        extents[:] = widest
    reaches = np.zeros(len(points))
    left = np.arange(len(points))
    while len(left):
        reaches[left] = _in_windows(points, sight, order, left, extents[left] / 2, tree)
        again = (reaches[left] >= extents[left] / 2 * (1 - 1e-9)) & (extents[left] < widest)
        left = left[again]
        extents[left] = np.minimum(np.maximum(2 * extents[left], 2 * _FARTHER * reaches[left]), widest)
    return reaches


def _in_windows(
    points: _Floats, sight: Sight, order: int, who: NDArray[np.intp], halves: _Floats, tree: object
) -> _Floats:
    """Find the reaches of some points, each in a square around it with sides of two times `halves`."""
    low, high = sight.region.bounds
    centers = points[who]
    windows = np.concatenate(
        [np.maximum(centers - halves[:, None], low), np.minimum(centers + halves[:, None], high)], axis=1
    )
    others = _neighbors(points, who, 2 * halves, tree)
    diagonals = halves * 2**0.5
    near = sight.around(centers, diagonals)
    tips = _within(sight.tips, centers, 2 * halves)
    n_lines = 4 + int((near.lengths() + (others.lengths() + 1) * (1 + tips.lengths())).max())
    bounds = np.ascontiguousarray(sight.region.bounds).reshape(4)
    return _supports.find_reaches(
        points, who.astype(np.int32), order, windows, bounds, *others, sight.barriers, sight.n_boundary, *near,
        sight.tips, *tips, sight.blocking, sight.tolerance, sight.slack, n_lines,
    )  # fmt: skip


def _neighbors(points: _Floats, who: NDArray[np.intp], extents: _Floats, tree: object) -> Rows:
    """Other points within some distance of each, the nearest first."""
    found = tree.query_ball_point(points[who], extents)  # type: ignore[attr-defined]
    own = np.repeat(np.arange(len(who)), [len(row) for row in found])
    other = np.concatenate([np.asarray(row, np.intp) for row in found])
    own, other = own[other != who[own]], other[other != who[own]]
    order = np.lexsort((np.linalg.norm(points[who[own]] - points[other], axis=1), own))
    return as_rows(own[order], other[order], len(who))


def _within(tips: _Floats, centers: _Floats, extents: _Floats) -> Rows:
    apart = np.linalg.norm(centers[:, None] - tips, axis=2) <= extents[:, None]
    own, items = np.nonzero(apart)
    return as_rows(own, items, len(centers))


def close_gaps(points: _Floats, radii: _Floats, sight: Sight, order: int) -> tuple[_Floats, bool]:
    """Let disks grow, each time those that grow least, until a cover is proved; tell whether it is."""
    radii = radii.copy()
    for turn in range(_CLOSING):
        gaps = find_gaps(points, radii, sight, order)
        if not len(gaps.places):
            return radii, True
        # Little by little more, so that what is left of a gap does not take a round each.
        fill(points, radii, sight, gaps, _BEYOND * 2.0 ** min(turn, 16))
    return radii, False


def fill(points: _Floats, radii: _Floats, sight: Sight, gaps: Gaps, beyond: float) -> None:
    """Let the disks that must grow least reach each gap, `radii` in place.

    A gap between disks lies in the convex hull of its corners, so that one more disk that reaches all of these fills
    it: the disk that grew for one corner counts at the others.
    """
    before = radii.copy()
    step = max(1, _AT_ONCE // len(points))
    order = np.argsort(-gaps.missing, kind="stable")
    for part in np.array_split(order, -(-len(order) // step)):
        places = gaps.places[part]
        distances = np.linalg.norm(places[:, None] - points, axis=2)
        if sight.blocking:
            rows, columns = np.indices(distances.shape)
            seen = sight.sees(points, columns.ravel(), places[rows.ravel()], slack=sight.slack)
            distances[~seen.reshape(distances.shape)] = np.inf
        for at, row in zip(part, distances, strict=True):
            own = gaps.without[at]
            row[own[own >= 0]] = np.inf
            fewer = f"be at most the number of points that see each place; {gaps.places[at].tolist()} is seen by fewer"
            n_more = int(gaps.missing[at]) - np.count_nonzero((row > before) & (row < radii))
            growth = np.where(row < radii, np.inf, row - radii)
            for disk in np.argsort(growth, kind="stable")[: max(n_more, 0)]:
                check_that("cover", growth[disk] < np.inf, fewer)
                radii[disk] = row[disk] + beyond * radii[disk]


def tighten(points: _Floats, radii: _Floats, floors: _Floats, sight: Sight, order: int) -> _Floats:
    """Find smaller radii, not below floors, that cover a region `order` times, as `radii` do."""
    n_points = len(points)
    limits = _GROWTH * radii
    meets = overlaps(points, limits)
    own, other = meets.spread(np.arange(n_points))
    own, other = own[own != other], other[own != other]
    pairs = as_rows(own, other, n_points)
    gaps = np.linalg.norm(points[own] - points[other], axis=1)
    near = sight.around(points, limits)
    # Edges of shadows are not looked at: what may meet one stays as it is.
    frozen = _meet_shadows(points, limits, sight)
    frozen[own[frozen[other]]] = True
    limits[frozen] = 0
    free = np.flatnonzero(~frozen).astype(np.int32)
    radii = radii.copy()
    cover = _supports.DiskCover(
        points, *pairs, gaps, sight.barriers, sight.n_boundary, *near, limits,
        order, sight.blocking, sight.tolerance, _ASIDE * sight.size, radii,
    )  # fmt: skip
    for part in _PARTS:
        cover.shrink(free[np.argsort(-radii[free])], part, _BEYOND, floors)
    n_meet = len(overlaps(points, radii).items) / n_points
    n_rounds = int(min(_ROUNDS, _STEPS // (n_points * n_meet**4) + 1))
    random = np.random.default_rng(0)
    for _ in range(n_rounds):
        if not cover.exchange(random.permutation(free), _TRIALS, _HELPERS, float(radii.mean()), _BEYOND, floors):
            break
    cover.shrink(free[np.argsort(-radii[free])], 1.0, _BEYOND, floors)
    return radii


def _meet_shadows(points: _Floats, radii: _Floats, sight: Sight) -> NDArray[np.bool_]:
    """Tell which disks hold an end of a barrier that casts a shadow."""
    found = np.zeros(len(points), bool)
    for tip in sight.tips:
        found |= np.linalg.norm(points - tip, axis=1) <= radii
    return found


def radii_in_plane(points: _Floats, sight: Sight, order: int, tightened: bool) -> tuple[_Floats, bool]:
    """Find the radii of disks around (n, 2) points that cover a region; tell whether that is proved."""
    full = find_reaches(points, sight, order) * (1 + _INFLATION)
    full, proved = close_gaps(points, full, sight, order)
    if order == 1 or not tightened or not proved:
        return full, proved
    floors = np.minimum(find_reaches(points, sight, 1) * (1 + _INFLATION), full)
    smaller = tighten(points, full, floors, sight, order)
    smaller, proved = close_gaps(points, smaller, sight, order)
    fewer = len(overlaps(points, smaller).items) < len(overlaps(points, full).items)
    return (smaller, True) if proved and fewer else (full, not len(find_gaps(points, full, sight, order).places))
