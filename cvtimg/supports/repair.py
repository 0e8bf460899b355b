"""Disks that grow until their cover is proved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg.supports.proof import Gaps, find_gaps
from cvtimg.supports.sight import Outline

_Floats = NDArray[np.float64]

_ROUNDS = 60
#: By how much disks grow beyond a gap, as a share of their radius.
_BEYOND = 1e-7
#: Distances that are computed at a time.
_AT_ONCE = 1 << 22


def close_gaps(points: _Floats, radii: _Floats, outline: Outline, order: int) -> tuple[_Floats, bool]:
    """Let disks grow, each time those that grow least, until a cover is proved; tell whether it is."""
    radii = radii.copy()
    for turn in range(_ROUNDS):
        gaps = find_gaps(points, radii, outline, order)
        if not len(gaps.places):
            return radii, True
        # Little by little more, so that what is left of a gap does not take a round each.
        fill(points, radii, outline, gaps, _BEYOND * 2.0 ** min(turn, 16))
    return radii, False


def fill(points: _Floats, radii: _Floats, outline: Outline, gaps: Gaps, beyond: float) -> None:
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
        if outline.blocking:
            rows, columns = np.indices(distances.shape)
            seen = outline.sees(points, columns.ravel(), places[rows.ravel()], slack=outline.slack)
            distances[~seen.reshape(distances.shape)] = np.inf
        for at, row in zip(part, distances, strict=True):
            own = gaps.without[at]
            row[own[own >= 0]] = np.inf
            place = gaps.places[at].tolist()
            n_more = int(gaps.missing[at]) - np.count_nonzero((row > before) & (row < radii))
            growth = np.where(row < radii, np.inf, row - radii)
            for disk in np.argsort(growth, kind="stable")[: max(n_more, 0)]:
                seen = growth[disk] < np.inf
                check_that(
                    "cover", seen, f"be at most the number of points that see each place; {place} is seen by fewer"
                )
                radii[disk] = row[disk] + beyond * radii[disk]
