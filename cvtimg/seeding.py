"""Initial generators, by name.

`split` is the default: deterministic, fast, and nearer to the optimum after Lloyd's iteration than the others on
photographs. The registry `SEEDINGS` is where the names for `init` and ``--init`` come from.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg import _kernels
from cvtimg.points import Points, cell_energies

#: From points, the number of generators and a random generator to (K, D) initial generators, centered as the points.
Seeding = Callable[[Points, int, np.random.Generator], NDArray[np.float64]]


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """Members of a cell, and the sum of density times (1, point)^T (1, point) over them."""

    members: NDArray[np.int32]
    moments: NDArray[np.float64]

    @property
    def mean(self) -> NDArray[np.float64]:
        """(D,) center of mass."""
        return self.moments[0, 1:] / self.moments[0, 0]  # type: ignore[no-any-return]

    @property
    def energy(self) -> float:
        """Sum of density times squared distance to the mean."""
        return float(self.moments[1:, 1:].trace() - self.moments[0, 1:] @ self.mean)

    @property
    def scatter(self) -> NDArray[np.float64]:
        """(D, D) sum of density times the outer product of the deviation from the mean."""
        about_mean: NDArray[np.float64] = self.moments[1:, 1:] - self.moments[0, 0] * np.outer(self.mean, self.mean)
        return about_mean


def split(points: Points, n_generators: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Divide the cell of greatest energy at its mean, across its main axis, until there are enough.

    Nothing is drawn from `rng`. The plane is that of M. Orchard and C. Bouman, IEEE Trans. Signal Processing 39
    (1991), doi 10.1109/78.107417.
    """
    weighted = np.flatnonzero(points.density > 0).astype(np.int32)
    cells = divide(points, [weighted], n_generators - 1)
    if len(cells) < n_generators:
        raise TooFewSamplesError(n_generators, len(cells))
    return np.array([cell.mean for cell in cells])


def divide(points: Points, members: list[NDArray[np.int32]], n_divisions: int) -> list[Cell]:
    """Divide the cell of greatest energy, `n_divisions` times or as often as can be; return all cells."""
    numbers = itertools.count()  # they break ties, so that the heap never compares cells
    cells = [(-cell.energy, next(numbers), cell) for cell in (_cell(points, group) for group in members)]
    heapq.heapify(cells)
    whole: list[Cell] = []
    while n_divisions and cells:
        worst = heapq.heappop(cells)[2]
        below, above = _halves(points, worst)
        if not (len(below.members) and len(above.members)):
            whole.append(worst)  # one point, or points that float32 cannot tell apart
            continue
        n_divisions -= 1
        for half in (below, above):
            heapq.heappush(cells, (-half.energy, next(numbers), half))
    return whole + [cell for _, _, cell in sorted(cells)]


def refill(
    points: Points,
    generators: NDArray[np.float64],
    labels: NDArray[np.int32],
    free: NDArray[np.bool_],
    empty: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Give empty cells half of the free cells of greatest energy, where a generator lowers the energy most."""
    weighted = points.density > 0
    energies = cell_energies(points, generators, labels)
    n_divided = min(np.count_nonzero(empty), np.count_nonzero(free))
    worst = np.argsort(np.where(free, -energies, np.inf), kind="stable")[:n_divided]
    members = [np.flatnonzero((labels == cell) & weighted).astype(np.int32) for cell in worst]
    halves = divide(points, members, int(np.count_nonzero(empty)))
    refilled = generators.copy()
    places = np.concatenate([worst, np.flatnonzero(empty)])[: len(halves)]
    refilled[places] = np.reshape([half.mean for half in halves], (-1, points.n_dims))
    return refilled


def kmeans_plus_plus(points: Points, n_generators: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw points in proportion to their energy; of several draws keep the one that leaves least energy.

    D. Arthur and S. Vassilvitskii, SODA 2007, pp. 1027-1035; greedy, with 2 + log K draws each time.
    """
    n_draws = 2 + int(np.log(n_generators))
    chosen = [rng.choice(len(points.density), p=points.density / points.density.sum())]
    nearest = _distances(points, chosen[0], np.full(len(points.density), np.inf, np.float32))
    while len(chosen) < n_generators:
        cumulative = np.cumsum(points.density * nearest)
        if cumulative[-1] == 0:
            raise TooFewSamplesError(n_generators, len(chosen))
        draws = np.searchsorted(cumulative, cumulative[-1] * rng.random(n_draws), side="right")
        candidates = [_distances(points, draw, nearest) for draw in draws]
        best = int(np.argmin([points.density @ distances for distances in candidates]))
        nearest = candidates[best]
        chosen.append(draws[best])
    return points.rows(np.array(chosen))


def maximin(points: Points, n_generators: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Take the point nearest to the mean, then always the point farthest from those taken.

    Nothing is drawn from `rng`. T. Gonzalez, Theoretical Computer Science 38 (1985),
    doi 10.1016/0304-3975(85)90224-5.
    """
    weighted = points.density > 0
    from_mean = _distances_to(points, np.zeros(points.n_dims, np.float32), np.full(len(weighted), np.inf, np.float32))
    chosen = [int(np.argmin(np.where(weighted, from_mean, np.inf)))]
    nearest = np.where(weighted, np.inf, 0).astype(np.float32)
    while len(chosen) < n_generators:
        nearest = _distances(points, chosen[-1], nearest)
        chosen.append(int(np.argmax(nearest)))
        if nearest[chosen[-1]] == 0:
            raise TooFewSamplesError(n_generators, len(chosen) - 1)
    return points.rows(np.array(chosen))


def random(points: Points, n_generators: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw points by density, without repetition."""
    n_weighted = int(np.count_nonzero(points.density))
    if n_weighted < n_generators:
        raise TooFewSamplesError(n_generators, n_weighted)
    share = points.density / points.density.sum()
    return points.rows(rng.choice(len(share), n_generators, replace=False, p=share))


SEEDINGS: dict[str, Seeding] = {
    "split": split,
    "k-means++": kmeans_plus_plus,
    "maximin": maximin,
    "random": random,
}


class TooFewSamplesError(ValueError):
    """More generators were asked for than there are distinct samples of positive density."""

    def __init__(self, n_generators: int, n_distinct: int) -> None:
        super().__init__(f"n_generators={n_generators} must be in 1..{n_distinct}, the number of distinct samples")


def _cell(points: Points, members: NDArray[np.int32]) -> Cell:
    moments = np.empty((points.n_dims + 1, points.n_dims + 1))
    _cut(points, members, np.zeros(points.n_dims), np.inf, moments)
    return Cell(members, moments)


def _halves(points: Points, cell: Cell) -> tuple[Cell, Cell]:
    axis = np.linalg.eigh(cell.scatter)[1][:, -1]
    below = np.empty_like(cell.moments)
    n_below = _cut(points, cell.members, axis, float(axis @ cell.mean), below)
    return Cell(cell.members[:n_below], below), Cell(cell.members[n_below:], cell.moments - below)


def _cut(
    points: Points, members: NDArray[np.int32], axis: NDArray[np.float64], offset: float, moments: NDArray[np.float64]
) -> int:
    """Bring the members below the plane ``axis . y = offset`` to the front, sum their moments, return their number."""
    scratch = np.empty_like(members)
    return _kernels.partition(
        points.tiles, points.density, members, scratch, np.ascontiguousarray(axis), offset, moments
    )


def _distances(points: Points, member: int, bound: NDArray[np.float32]) -> NDArray[np.float32]:
    """Squared distances to a point, or `bound` where that is less."""
    return _distances_to(points, points.tiles[member // _kernels.TILE, :, member % _kernels.TILE].copy(), bound)


def _distances_to(points: Points, place: NDArray[np.float32], bound: NDArray[np.float32]) -> NDArray[np.float32]:
    distances = np.empty_like(bound)
    _kernels.squared_distances(points.tiles, place, bound, distances)
    return distances
