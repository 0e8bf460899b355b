"""Optimal1d: the global minimum of the energy for points of one dimension, such as gray levels.

Cells of sorted levels are intervals, and the lowest energy E(k) of k intervals is convex in k. So there is a price per
cell at which the cheapest cut has k cells, or at which two cuts cost the same, one with fewer and one with more cells;
these two can be joined into one with k. One pass over the levels finds the cheapest cut at a given price, and 1 to 15
prices lead to the right one. Memory is proportional to the number of levels, whatever k.

Energies of intervals are differences of sums in twice the digits of float64, from the middle level outwards, so that no
level that is far away takes digits from the others.

A. Aggarwal, B. Schieber, T. Tokuyama, Discrete & Computational Geometry 12 (1994) 263-280, doi 10.1007/BF02574380
(prices, and how to join cuts); A. Gronlund and others, arXiv:1701.07204 (k-means by prices).
"""

from typing import NamedTuple

import numpy as np

import cvtimg.engine._kernels as _kernels
from cvtimg._shared.types import Floats, Ints
from cvtimg.engine.methods._iteration import Conditions, Iteration
from cvtimg.engine.points import Points, cell_energies
from cvtimg.engine.seeding import TooFewSamplesError


def optimal1d(points: Points, generators: Floats, conditions: Conditions) -> Iteration:
    """Find the global optimum. Only the number of initial generators matters; nothing is drawn."""
    levels = _levels(points)
    n_cells = len(generators)
    if n_cells > len(levels.values):
        raise TooFewSamplesError(n_cells, len(levels.values))
    means = levels.means(_cheapest(levels, n_cells))
    # Colors come in float32, which cannot separate many generators.
    middles = (means[1:, 0] + means[:-1, 0]) / 2
    labels = np.searchsorted(middles, points.coordinate(0)).astype(np.int32)
    end = float(cell_energies(points, means, labels).sum())
    conditions.watch(end)
    return Iteration(means, [end], converged=True, labels=labels)


class _Levels(NamedTuple):
    """Sorted distinct values (M,), their density > 0, and moments (M + 1, 6)."""

    # The moments are those of `sum_levels`, where y is the level minus the middle one. A cut into k cells is given by
    # its bounds, (k + 1,): where each cell begins, then the number of levels.

    values: Floats
    density: Floats
    moments: Floats

    def cut(self, price: float) -> Ints:
        """Cut where the energy plus the price of all cells is lowest."""
        n_bounds = len(self.moments)
        firsts, queue, since, bounds = np.empty((4, n_bounds), np.int32)
        n_cells = _kernels.cut_levels(self.moments, price, np.empty(n_bounds), firsts, queue, since, bounds)
        return bounds[n_cells::-1].copy()

    def means(self, bounds: Ints) -> Floats:
        """Return the (k, 1) means of the cells, summed cell by cell: differences of `moments` would lose digits."""
        masses, sums = (np.add.reduceat(terms, bounds[:-1]) for terms in (self.density, self.density * self.values))
        return (sums / masses)[:, None]

    def energy(self, bounds: Ints) -> float:
        """Return the energy of all cells about their means."""
        steps = self.values - self.means(bounds)[:, 0].repeat(np.diff(bounds))
        return float((self.density * steps * steps).sum())


def _levels(points: Points) -> _Levels:
    if points.n_dims != 1:
        raise ValueError(f"method='optimal1d' needs samples of one dimension, not D={points.n_dims}")
    weighted = points.density > 0
    given = points.coordinate(0)[weighted]
    distinct = np.unique(given)
    density = np.bincount(np.searchsorted(distinct, given), points.density[weighted]).astype(np.float64)
    density /= 2.0 ** np.rint(np.log2(density.max()))  # in the middle of the range of float64, as products are split
    values = distinct.astype(np.float64)
    moments = np.empty((len(values) + 1, 6))
    _kernels.sum_levels(values - values[len(values) // 2], density, moments)
    return _Levels(values, density, moments)


def _cheapest(levels: _Levels, n_cells: int) -> Ints:
    """Cut into `n_cells` cells of lowest energy, by narrowing down the price per cell."""
    n_levels = len(levels.values)
    few, many = np.array([0, n_levels], np.int32), np.arange(n_levels + 1, dtype=np.int32)
    for end in (few, many):
        if len(end) == n_cells + 1:
            return end
    # The price at which two cuts cost the same shows whether there is a cut between them. Guesses, that E(k) goes on
    # like k^-2, lead near to it in fewer steps.
    price, guessed = 2 * levels.energy(few) / n_cells**3, True
    while True:
        cut = levels.cut(price)
        if len(cut) == n_cells + 1:
            return cut
        if len(few) < len(cut) < len(many):
            few, many = (cut, many) if len(cut) <= n_cells else (few, cut)
            price, guessed = price * ((len(cut) - 1) / n_cells) ** 3, True
        elif guessed:
            price, guessed = (levels.energy(few) - levels.energy(many)) / (len(many) - len(few)), False
        else:
            break
    # Follow `many` up to a cell inside one of `few`, then `few`, for `n_cells` in total. Both cuts are cheapest, so the
    # two other halves together cost no less: the joined cut is cheapest too.
    n_more = n_cells - (len(few) - 1)
    cell = int(np.argmax(many[n_more + 1 : n_more + len(few)] <= few[1:]))
    return np.concatenate([many[: n_more + cell + 1], few[cell + 1 :]])
