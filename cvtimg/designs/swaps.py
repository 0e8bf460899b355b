"""Swaps of coordinates of Latin points, which stay Latin: of neighbors, to even out a tessellation, or of any two.

A criterion is a sum over pairs of points that is the less the better:

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

import numpy as np

from cvtimg._shared.types import Floats, Ints64
from cvtimg.designs import _designs
from cvtimg.designs.cells import nearest_distances
from cvtimg.designs.latin import Slices

#: The registry of criteria for which any two points swap.
CRITERIA = {"discrepancy": _designs.DISCREPANCY, "maximin": _designs.MAXIMIN, "projection": _designs.PROJECTION}
#: Swaps are taken that gain more than this: less is rounding.
_GAIN = 1e-12


#: No swap of neighbors brings two points nearer than this times the least distance, so that cells stay round; and the
#: tries of each pair.
_APART, _TRIES = 1.15, 10
#: Rounds of swaps of any two points, whose threshold is a quantile of the losses of the round before: the share that is
#: taken at first, which falls as the square of the rounds left; and the last part, in which only gains count.
_ROUNDS, _SHARE, _LAST_PART = 60, 0.03, 0.1
#: Tries for each coordinate: with fewer only gains count, and more gain nothing.
_FEWEST_TRIES, _MOST_TRIES = 10, 10_000


def even_out(points: Floats, existing: Floats, periodic: bool, work: int, rng: np.random.Generator) -> Floats:
    """Swap neighbors along an axis among (n, d) Latin points in the unit cube, beside (L, d) that exist and stay.

    Points move by a slice at a time and keep apart, so that cells stay nearly what they were; the discrepancy falls.
    Swaps of points that are farther apart would halve it once more, at the cost of uneven cells. At most `work` pairs
    of points are compared along an axis.
    """
    n_points, n_dims = points.shape
    if n_points == 1:
        return points
    n_tries = min(_TRIES * points.size, work // ((n_points + len(existing)) * n_dims))
    axes, first = rng.integers(n_dims, size=n_tries), rng.integers(n_points - 1, size=n_tries)
    swaps = _Swaps(points, existing, points[:0], "discrepancy", periodic)
    swaps.run(np.stack([axes, first, first + 1], axis=1), -_GAIN, least=_APART * swaps.least_distance)
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
    n_tries = min(_MOST_TRIES * points.size, work // ((n_points + len(existing)) * n_dims))
    for left in np.linspace(1, -_LAST_PART, _ROUNDS):
        axes = rng.choice(np.flatnonzero(n_movable > 1), size=n_tries // _ROUNDS)
        first, by = rng.integers(n_movable[axes]), rng.integers(1, n_movable[axes])
        changes = swaps.run(np.stack([axes, first, (first + by) % n_movable[axes]], axis=1), threshold)
        losses = changes[changes > 0]
        taken = _SHARE * max(left, 0) ** 2 if n_tries > _FEWEST_TRIES * points.size else 0.0
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
        changes = np.empty(len(tries))
        tries = tries.astype(np.int32)
        points = (self._places, self._n_all, self._order)
        how = (self._criterion, self._scale, least**2, self._periodic)
        _designs.swap_coordinates(*points, tries, threshold, changes, *how)
        return changes

    @property
    def points(self) -> Floats:
        return self._places[: self._n] + 0.5


def _free_places(points: Floats, existing: Floats) -> Floats:
    """Return the centers (S, d) of slices that have no point; axes with fewer than S end in NaN."""
    every = np.concatenate([points, existing])
    free = [Slices.even(1, len(every)).free(0, axis[:, None]) for axis in every.T]
    table = np.full((max(map(len, free)), len(free)), np.nan)
    for axis, places in enumerate(free):
        table[: len(places), axis] = places
    return table
