"""Latin points, one in every slice of every axis; and swaps of coordinates, by which they stay Latin.

Neighbors swap to even out a tessellation, and any two points to serve a criterion, a sum over pairs of points that is
the less the better:

- "discrepancy": the L2 discrepancy, centered or wrapped around the torus (F. Hickernell, Math. Comp. 67 (1998) 299-322,
  doi 10.1090/S0025-5718-98-00894-1, and Lecture Notes in Statistics 138 (1998) 109-166,
  doi 10.1007/978-1-4612-1702-2_3);
- "maximin": inverse 16th powers of distances (M. Morris, T. Mitchell, J. Statistical Planning and Inference 43 (1995)
  381-402, doi 10.1016/0378-3758(94)00035-T), for a large smallest distance;
- "projection": inverse products of squared distances along the axes, for distances in all projections (V. Joseph,
  E. Gul, S. Ba, Biometrika 102 (2015) 371-380, doi 10.1093/biomet/asv002: maximum projection).

Any two points swap by threshold accepting (G. Dueck, T. Scheuer, J. Computational Physics 90 (1990) 161-175,
doi 10.1016/0021-9991(90)90201-B): swaps that lose at most a threshold are taken, which falls to 0.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import zip_longest

import numpy as np
from numpy.typing import ArrayLike

import cvtimg.designs._designs as _designs
from cvtimg._shared.budgets import ROUNDING
from cvtimg._shared.types import Bools, Floats, Floats32, Ints64
from cvtimg.designs.cells import check_unit_points, nearest_distances


def latinize(points: ArrayLike) -> Floats:
    """Move points to the middles of slices, one in each of n slices of each axis, where their order is kept.

    Parameters
    ----------
    points : (n, d) array
        In the unit cube. Of equal coordinates those of earlier points come first.

    Returns
    -------
    (n, d) float64 array

    References
    ----------
    Y. Saka, M. Gunzburger, J. Burkardt, Int. J. Numerical Analysis and Modeling 4 (2007) 729-743 (Latinized CVT).

    Examples
    --------
    >>> from cvtimg import latinize
    >>> latinize([[0.9, 0.2], [0.8, 0.1]]).tolist()
    [[0.75, 0.75], [0.25, 0.25]]
    """
    array = check_unit_points("points", points)
    order = np.argsort(array, axis=0, kind="stable")
    return (np.argsort(order, axis=0, kind="stable") + 0.5) / len(array)


class Slices:
    """Slices of each axis (d, n), by their middles and, in turns, the edges between them, (d, 2 n - 1) in all."""

    def __init__(self, levels: Floats) -> None:
        self._edges, self._middles = levels[:, 1::2], levels[:, ::2]

    @classmethod
    def even(cls, n_dims: int, n_slices: int) -> Slices:
        """Make slices of equal width."""
        return cls(np.tile(np.arange(1, 2 * n_slices) / (2 * n_slices), (n_dims, 1)))

    @classmethod
    def of_region(cls, samples: Floats32, n_slices: int) -> Slices:
        """Make slices that have equal shares of the samples of a region."""
        # They are at the quantiles k / 2 n.
        return cls(np.quantile(samples, np.arange(1, 2 * n_slices) / (2 * n_slices), axis=0).T.astype(float))

    def free(self, axis: int, points: Floats) -> Floats:
        """Return the middles of the slices of an axis in which none of (n, d) points is."""
        taken = np.searchsorted(self._edges[axis], points[:, axis], "right")
        return np.delete(self._middles[axis], taken)

    def n_empty(self, points: Floats) -> int:
        """Count the slices of all axes in which no point is."""
        return sum(len(self.free(axis, points)) for axis in range(points.shape[1]))

    def latinize(self, points: Floats, existing: Floats, allowed: Callable[[Floats], Bools]) -> Floats:
        """Move points along each axis in turn into slices that have none, as long as that leads to allowed places.

        The sum of squared moves is least; the order may change where it must.
        """
        from scipy.optimize import linear_sum_assignment

        moved, (n_points, n_dims) = points.copy(), points.shape
        for axis in range(n_dims):
            middles = self.free(axis, existing)
            there = np.repeat(moved[:, None], len(middles), axis=1)
            there[..., axis] = middles
            fits = allowed(there.reshape(-1, n_dims)).reshape(n_points, -1)
            # A move to where no point may be costs more than all others together.
            squares = np.where(fits, (moved[:, axis, None] - middles) ** 2, n_points + 1)
            rows, columns = linear_sum_assignment(squares)
            fit = fits[rows, columns]
            moved[rows[fit], axis] = middles[columns[fit]]
        return moved


#: The registry of criteria for which any two points swap.
CRITERIA = {"discrepancy": _designs.DISCREPANCY, "maximin": _designs.MAXIMIN, "projection": _designs.PROJECTION}
#: Multiple of the least distance that swaps of neighbors leave between points: with less, cells are less round.
_APART = 1.15
#: Rounds of swaps of any two points, in the last tenth of which only gains count: with more, each has fewer tries.
_ROUNDS = 60


def even_out(points: Floats, existing: Floats, periodic: bool, work: int, rng: np.random.Generator) -> Floats:
    """Swap neighbors along an axis among (n, d) Latin points in the unit cube, beside (L, d) that exist and stay.

    Points move by a slice at a time and keep apart, so that cells stay nearly what they were; the discrepancy falls.
    Swaps of points that are farther apart would halve it once more, at the cost of uneven cells. At most `work` pairs
    of points are compared along an axis.
    """
    n_points, n_dims = points.shape
    if n_points == 1:
        return points
    n_tries = min(10 * points.size, work // ((n_points + len(existing)) * n_dims))
    axes, first = rng.integers(n_dims, size=n_tries), rng.integers(n_points - 1, size=n_tries)
    swaps = _Swaps(points, existing, points[:0], "discrepancy", periodic)
    swaps.run(np.stack([axes, first, first + 1], axis=1), -ROUNDING, least=_APART * swaps.least_distance)
    return swaps.points


def anneal(
    points: Floats, existing: Floats, criterion: str, periodic: bool, work: int, rng: np.random.Generator
) -> Floats:
    """Swap any two of (n, d) Latin points along an axis for a criterion, beside (L, d) that exist and stay.

    Points also move to slices of an axis that are free, as some are where two of those that exist share one.
    """
    n_points, n_dims = points.shape
    free = _free_places(points, existing)
    n_movable = n_points + np.isfinite(free).sum(axis=0)
    if n_movable.max() == 1:
        return points
    swaps = _Swaps(points, existing, free, criterion, periodic)
    threshold = 0.0
    # More than 10,000 tries for each coordinate gain nothing, and with fewer than 10 only gains count.
    n_tries = min(10_000 * points.size, work // ((n_points + len(existing)) * n_dims))
    for left in np.linspace(1, -0.1, _ROUNDS):
        axes = rng.choice(np.flatnonzero(n_movable > 1), size=n_tries // _ROUNDS)
        first, by = rng.integers(n_movable[axes]), rng.integers(1, n_movable[axes])
        changes = swaps.run(np.stack([axes, first, (first + by) % n_movable[axes]], axis=1), threshold)
        losses = changes[changes > 0]
        # The threshold is a quantile of the losses of the round before, which falls as the square of the rounds left.
        taken = 0.03 * max(left, 0) ** 2 if n_tries > 10 * points.size else 0.0
        threshold = float(np.quantile(losses, taken)) if len(losses) and taken else 0.0
    return swaps.points


class _Swaps:
    """Latin points that swap coordinates with each other and with free places, beside those that stay."""

    def __init__(self, points: Floats, existing: Floats, free: Floats, criterion: str, periodic: bool) -> None:
        self._n, self._n_all = len(points), len(points) + len(existing)
        self._places = np.concatenate([points, existing, free]) - 0.5
        movable = np.append(np.arange(self._n), np.arange(self._n_all, len(self._places)))
        # Axes with fewer free places than others have NaN, which comes last.
        self._order = np.ascontiguousarray(movable[np.argsort(self._places[movable], axis=0)].T, np.int32)
        self._criterion, self._periodic = CRITERIA[criterion], periodic
        several = np.concatenate([points, existing])
        self.least_distance = float(nearest_distances(several, periodic).min()) if len(several) > 1 else 1.0
        # Powers of distances stay in range if the least one is 1, and products if squares are 1 on average.
        scales = {"maximin": max(self.least_distance, 1e-9) ** -2, "projection": 6.0}
        self._scale = scales.get(criterion, 1.0)

    def run(self, tries: Ints64, threshold: float, least: float = 0.0) -> Floats:
        """Try swaps (T, 3), an axis and two ranks each, and take those below a threshold; return what each changes.

        None is taken that brings two points nearer than `least`.
        """
        changes, points = np.empty(len(tries)), (self._places, self._n_all, self._order)
        how = (self._criterion, self._scale, least**2, self._periodic)
        _designs.swap_coordinates(*points, tries.astype(np.int32), threshold, changes, *how)
        return changes

    @property
    def points(self) -> Floats:
        return self._places[: self._n] + 0.5


def _free_places(points: Floats, existing: Floats) -> Floats:
    """Return the centers (S, d) of slices that have no point; axes with fewer than S end in NaN."""
    every = np.concatenate([points, existing])
    free = [Slices.even(1, len(every)).free(0, axis[:, None]) for axis in every.T]
    return np.array([*zip_longest(*free, fillvalue=np.nan)]).reshape(-1, len(free))
