"""Initial generators.

`split` is the default: deterministic and fast, and on photographs Lloyd's method ends lower from it than from the
others.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

import cvtimg.engine._kernels as _kernels
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Array, Floats, Indices, Ints, Ints64
from cvtimg.engine.points import Points, cell_energies

#: Takes points, the number of generators and a random generator; returns (K, D) initial generators in the frame.
Seeding: TypeAlias = "Callable[[Points, int, np.random.Generator], Floats]"

#: Cells are divided by their covariances up to this number of dimensions: each takes its square of moments.
_MOST_DIMS = 64
#: Products with the rows that find an axis: halves have then at most a percent more energy than across the main one.
_POWERS = 8


class _Cells(NamedTuple):
    """Counts of the points of positive density in K cells, and the moments of `_kernels.divide_cells`."""

    counts: Ints64
    moments: Floats

    @classmethod
    def empty(cls, n_cells: int, n_dims: int) -> _Cells:
        return cls(np.zeros(n_cells, np.int64), np.zeros((n_cells, n_dims + 1, n_dims + 1)))

    @property
    def means(self) -> Floats:
        """(K, D) centers of mass; 0 for empty cells."""
        masses, sums = self.moments[:, :1, 0], self.moments[:, 1:, 0]
        return np.divide(sums, masses, out=np.zeros_like(sums), where=masses > 0)

    @property
    def energies(self) -> Floats:
        """(K,) sums of density times squared distance to the mean; 0 for fewer than two points."""
        about_origin = np.einsum("kdd->k", self.moments[:, 1:, 1:])
        energies = about_origin - np.einsum("kd,kd->k", self.moments[:, 1:, 0], self.means)
        return np.where(self.counts > 1, np.maximum(energies, 0), 0)

    def main_axes(self, cells: Indices) -> tuple[Floats, Floats]:
        """Return the (n, D) directions of greatest variance in some cells, and the (n,) variances."""
        moments = self.moments[cells]
        masses, means = moments[:, 0, 0, None, None], moments[:, 1:, 0] / moments[:, :1, 0]
        # The moments hold only the lower triangle, and only that is read.
        covariances = moments[:, 1:, 1:] / masses - means[:, :, None] * means[:, None, :]
        variances, axes = np.linalg.eigh(covariances, UPLO="L")
        # Without the last bits of LAPACK and its sense of direction, which differ by processor: no point may change
        # sides with them.
        main = np.rint(axes[:, :, -1] * 2.0**24) / 2.0**24
        longest = np.take_along_axis(main, np.abs(main).argmax(axis=1, keepdims=True), axis=1)
        return np.copysign(1, longest) * main, np.maximum(variances[:, -1], 0)


def split(points: Points, n_generators: int, rng: np.random.Generator) -> Floats:
    """Divide the cells of highest energy at their mean, across their main axis, until there are enough."""
    # Nothing is drawn from `rng`, but for exact points and many columns. The planes are those of M. Orchard and
    # C. Bouman, IEEE Trans. Signal Processing 39 (1991), doi 10.1109/78.107417. One pass divides all cells of more than
    # half the highest energy.
    # In a wide range covariances, which are differences of large sums, lose their digits.
    if points.exact or points.n_dims > _MOST_DIMS:
        return kmeans_plus_plus(points, n_generators, rng)
    cells = _Cells.empty(n_generators, points.n_dims)
    labels = np.zeros(len(points.density), np.int32)
    _divide(points, labels, first := np.zeros(1, np.intp), first, cells)
    divisible = np.ones(n_generators, bool)
    while (vacant := np.flatnonzero(cells.counts == 0)).size:
        energies = np.where(divisible, cells.energies, 0)
        large = np.argsort(-energies, kind="stable")[: vacant.size]
        large = large[energies[large] > energies[large[0]] / 2]
        if not large.size:
            raise TooFewSamplesError(n_generators, n_generators - vacant.size)
        children = vacant[: large.size]
        _divide(points, labels, large, children, cells)
        # Points that differ only by rounding may all end on one side.
        divided = (cells.counts[large] > 0) & (cells.counts[children] > 0)
        divisible[large] = divisible[children] = divided
    return cells.means


def halves(points: Points, labels: Ints, chosen: Indices, n_cells: int) -> tuple[Floats, Floats]:
    """Return the approximate (n, D) means of the two halves of some cells; equal where a cell is a single point."""
    if points.n_dims > _MOST_DIMS:
        is_weighted = points.density > 0
        pairs = [_halves_of_one(points, np.flatnonzero(is_weighted & (labels == cell))) for cell in chosen]
        lower, upper = np.reshape(pairs, (-1, 2, points.n_dims)).swapaxes(0, 1)  # of no cell, too
        return lower, upper
    cells = _Cells.empty(n_cells, points.n_dims)
    _divide(points, labels, chosen, chosen, cells)
    means = cells.means[chosen]
    full = np.flatnonzero(cells.counts[chosen])
    axes, variances = cells.main_axes(chosen[full])
    steps = np.zeros_like(means)
    # The mean of half a normal distribution is this far from the middle.
    steps[full] = axes * np.sqrt(2 / np.pi * variances)[:, None]
    return means - steps, means + steps


def _halves_of_one(points: Points, members: Indices) -> Floats:
    """Return the approximate means (2, D) of the halves of some points, across an axis found by powers."""
    rows, weights = points.rows(members), points.density[members]
    mass = weights.sum() or 1.0
    mean = np.einsum("n,nd->d", weights, rows) / mass
    apart = rows - mean
    axis = apart[(weights * np.einsum("nd,nd->n", apart, apart)).argmax()]
    for _ in range(_POWERS):
        axis = axis / (np.linalg.norm(axis) or 1.0)
        along = np.einsum("nd,d->n", apart, axis)
        step = np.sqrt(2 / np.pi * (weights * along**2).sum() / mass) * axis
        axis = np.einsum("n,nd->d", weights * along, apart)
    return np.stack([mean - step, mean + step])


def refill(points: Points, generators: Floats, labels: Ints, masses: Floats, n_locked: int) -> Floats:
    """Give each empty cell half of a cell of high energy, where a generator lowers the energy most; the first stay."""
    free = np.arange(len(generators)) >= n_locked
    empty = free & (masses == 0)
    if not empty.any():
        return generators
    energies = np.where(free, cell_energies(points, generators, labels), 0)
    n_divided = min(np.count_nonzero(empty), np.count_nonzero(energies))
    worst = np.argsort(-energies, kind="stable")[:n_divided]
    refilled = generators.copy()
    refilled[worst], refilled[np.flatnonzero(empty)[:n_divided]] = halves(points, labels, worst, len(generators))
    return refilled


def kmeans_plus_plus(points: Points, n_generators: int, rng: np.random.Generator) -> Floats:
    """Draw points in proportion to their energy, and keep the draw that leaves the lowest energy."""
    # D. Arthur and S. Vassilvitskii, SODA 2007, pp. 1027-1035; greedy, with 2 + log K draws per generator.
    return seed_sets(points, np.empty((1, 0, points.n_dims)), n_generators, 0, rng)[0]


def seed_sets(
    points: Points,
    given: Floats,
    n_generators: int,
    n_swaps: int,
    rng: np.random.Generator,
    *,
    n_locked: int | None = None,
    n_draws: int | None = None,
    worthwhile: float = 1.0,
) -> Floats:
    """Complete (n, G, D) given generators by greedy k-means++, and try that many swaps: (n, K, D)."""
    # A swap puts a generator where much energy is in place of the one missed least, and must leave less than a part of
    # the energy. About K / 4 of them bring the seeds within a constant factor of the lowest energy: D. Choo et al.,
    # ICML 2020, PMLR 119, 1909-1917. Locked generators are never replaced.
    (n_sets, n_given), (n_tiles, n_dims, width) = given.shape[:2], points.tiles.shape
    n_draws = n_draws or 2 + int(np.log(n_generators))
    sets, n_seeded = np.empty((n_sets, n_generators, n_dims)), np.empty(n_sets, np.int64)
    sets[:, :n_given] = given
    heights = rng.random((n_sets, n_generators - n_given + n_swaps, n_draws))
    n_locked = n_given if n_locked is None else n_locked

    def seed(start: int, stop: int) -> None:
        kind, more = points.tiles.dtype, (n_tiles + 1) * width
        scratch: tuple[Array, ...]
        scratch = np.empty((2, more), np.int32), np.empty((2, more), kind), np.empty((n_tiles, n_draws, width), kind)
        scratch += np.empty(n_tiles), np.empty((n_generators + n_draws, n_dims), kind), np.empty(n_generators, kind)
        scratch += np.empty((n_dims, width), kind), np.empty((n_draws, n_generators + 1))
        of_sets = heights[start:stop], worthwhile, sets[start:stop], n_seeded[start:stop]
        _kernels.seed_sets(points.tiles, points.density, n_given, n_locked, *of_sets, *scratch)

    in_parts(seed, n_sets, work=heights.size * points.tiles.size)
    if n_seeded.min() < n_generators:
        raise TooFewSamplesError(n_generators, int(n_seeded.max()))
    sets[:, :n_locked] = given[:, :n_locked]  # not rounded to float32, so that locked ones are the same in all sets
    return sets


def random(points: Points, n_generators: int, rng: np.random.Generator) -> Floats:
    """Draw distinct points by density."""
    n_weighted = int(np.count_nonzero(points.density))
    if n_weighted < n_generators:
        raise TooFewSamplesError(n_generators, n_weighted)
    share = points.density / points.density.sum()
    return points.rows(rng.choice(len(share), n_generators, replace=False, p=share))


#: The registry of seedings: the values of `init` and ``--init``.
SEEDINGS: dict[str, Seeding] = {"split": split, "k-means++": kmeans_plus_plus, "random": random}


class TooFewSamplesError(ValueError):
    """There are fewer distinct samples of positive density than generators."""

    def __init__(self, n_generators: int, n_distinct: int) -> None:
        super().__init__(f"n_generators={n_generators} must be in 1..{n_distinct}, the number of distinct samples")
        self.n_distinct = n_distinct


def _divide(points: Points, labels: Ints, chosen: Indices, children: Indices, cells: _Cells) -> None:
    """Move the points above the middle of some cells to their children; all of those that are their own children."""
    axes, child_of = np.zeros((len(cells.counts), points.n_dims)), np.full(len(cells.counts), -1, np.int32)
    child_of[chosen] = children
    if children is not chosen:
        axes[chosen], _ = cells.main_axes(chosen)
    offsets = np.einsum("kd,kd->k", axes, cells.means)
    _kernels.divide_cells(points.tiles, points.density, labels, child_of, axes, offsets, cells.counts, cells.moments)
    if children is not chosen:
        cells.counts[chosen] -= cells.counts[children]
        cells.moments[chosen] -= cells.moments[children]
