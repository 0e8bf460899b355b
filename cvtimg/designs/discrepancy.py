"""Star discrepancy: how far the share of points in a box from the origin is from the box's volume, at worst.

Exact by counting in one to three dimensions. In more dimensions that is NP-hard, and threshold accepting finds a lower
bound, which is often the value itself: P. Winker, K.-T. Fang, SIAM J. Numerical Analysis 34 (1997) 2028-2042,
doi 10.1137/S0036142995286076.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg.designs import _discrepancy
from cvtimg.designs._unit import check_unit_points
from cvtimg.designs.exact_cells import MOST_EXACT_DIMS

_Floats = NDArray[np.float64]

#: Walks, and point comparisons of each.
_WALKS = 10
_WORK = 20_000_000
_MAX_STEPS = 50_000


def star_discrepancy(points: ArrayLike, *, rng: int | np.random.Generator = 0) -> tuple[float, bool]:
    """Compute the star discrepancy of points in the unit cube.

    Parameters
    ----------
    points : (n, d) array
        In the unit cube. For d = 3 the cost grows as n^3: 1,000 points take about a second.
    rng : int or numpy.random.Generator
        Seed of the walks in four and more dimensions.

    Returns
    -------
    float, bool
        The discrepancy, and whether it is exact; if not it is a lower bound.

    Raises
    ------
    TypeError, ValueError
        If `points` is not what is said here.

    Examples
    --------
    >>> from cvtimg.designs import star_discrepancy
    >>> star_discrepancy([[0.25, 0.75], [0.75, 0.25]])
    (0.5625, True)
    """
    array = check_unit_points("points", points)
    if array.shape[1] <= MOST_EXACT_DIMS:
        return _exact(array), True
    return _lower_bound(array, np.random.default_rng(rng)), False


def _exact(points: _Floats) -> float:
    """Visit all corners that coordinates of points span: boxes with and without their upper sides."""
    n_points, n_dims = points.shape
    sides = [np.unique(np.append(axis, 1.0)) for axis in points.T]
    if n_dims == 1:
        levels = np.sort(points[:, 0])
        closed, within = (np.searchsorted(levels, sides[0], side) / n_points for side in ("right", "left"))
        return float(max((closed - sides[0]).max(), (sides[0] - within).max()))
    at = [np.searchsorted(own, axis) for own, axis in zip(sides, points.T, strict=True)]
    # An open box has the points up to the corner before its own: the first row and column stay 0.
    counts = np.zeros((len(sides[0]) + 1, len(sides[1]) + 1), np.int32)
    closed_counts, open_counts = counts[1:, 1:], counts[:-1, :-1]

    def gap(of: NDArray[np.int32], depth: float, sign: int) -> float:
        return _discrepancy.greatest_gap(np.ascontiguousarray(of), sides[0], sides[1], depth, 1 / n_points, sign)

    def add(members: NDArray[np.intp]) -> None:
        for point in members:
            closed_counts[at[0][point] :, at[1][point] :] += 1

    if n_dims == 2:
        add(np.arange(n_points))
        return max(gap(closed_counts, 1.0, 1), gap(open_counts, 1.0, -1))
    greatest = 0.0
    for layer, depth in enumerate(sides[2]):
        greatest = max(greatest, gap(open_counts, depth, -1))
        add(np.flatnonzero(at[2] == layer))
        greatest = max(greatest, gap(closed_counts, depth, 1))
    return greatest


def _lower_bound(points: _Floats, rng: np.random.Generator) -> float:
    n_points, n_dims = points.shape
    sides = np.concatenate([np.sort(points, axis=0), np.ones((1, n_dims))]).T.copy()
    n_steps = min(_MAX_STEPS, max(1000, _WORK // (n_points * n_dims)))
    left = np.linspace(1, 0, n_steps)
    greatest = 0.0
    for _ in range(_WALKS):
        # Large boxes matter most: start with sides whose product is spread evenly.
        corner = np.floor(rng.random(n_dims) ** (1 / n_dims) * n_points).astype(np.int32)
        reach = (1 + left * n_points / 8).astype(np.int64)[:, None]
        moves = rng.integers(-reach, reach + 1, (n_steps, n_dims))
        moves[rng.random((n_steps, n_dims)) > 2 / n_dims] = 0
        thresholds = left**2 / (2 * np.sqrt(n_points))
        scratch = np.empty(n_dims, np.int32), np.empty(n_dims)
        gap = _discrepancy.walk_boxes(points, sides, corner, *scratch, moves.astype(np.int32), thresholds)
        greatest = max(greatest, gap)
    return greatest
