"""How long to look for a low energy: searches over fewer points that breathe, before the descent on all points.

The energy has many local minima. Fewer points show where the low ones are at a fraction of the cost, so most of the
looking happens there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.methods import Conditions, Iteration, Method, Stopping
from cvtimg.engine.methods.breathing import breathe
from cvtimg.engine.points import Points, coarsen, thin
from cvtimg.engine.seeding import SEEDINGS, TooFewSamplesError


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to look for a low energy.

    Attributes
    ----------
    n_starts : int
        Searches on coarsened samples at most, each from seeds of its own; the one that ends lowest is followed. From
        43 generators on they become fewer, down to a third: each costs more, and the ends differ less.
    breaths : tuple of float
        When such a search breathes, the largest and the least share of the generators that come and go; 0 for none.
    stopping : Stopping
        When the descent on all samples, which follows, has come to rest.
    """

    n_starts: int
    breaths: tuple[float, float]
    stopping: Stopping


#: The registry: names for `effort` and ``--effort``; `tessellate` says what each costs.
EFFORTS: dict[str, Effort] = {
    "fast": Effort(1, (0, 0), Stopping(tolerance=1e-2, max_iterations=4)),
    "balanced": Effort(1, (1 / 6, 1 / 16), Stopping(tolerance=1e-4, max_iterations=300)),
    "best": Effort(12, (1 / 4, 0), Stopping(tolerance=1e-6, max_iterations=1000)),
}

#: No search follows once so many ended within this share of the lowest energy: with few generators nearly all do.
_AGREEING, _ABOUT = 3, 5e-4
_SEARCHING = Stopping(tolerance=1e-4, max_iterations=100)
_COARSER = (32, 16, 8, 4, 2)
#: A search goes over so many points at least for each generator and in all.
_POINTS_PER_GENERATOR = 50
_ENOUGH_POINTS = 1 << 14
_STARTS_TIMES_GENERATORS = 512


def search(
    points: Points,
    fixed: NDArray[np.float64],
    n_generators: int,
    init: str,
    method: Method,
    effort: Effort,
    conditions: Conditions,
) -> NDArray[np.float64]:
    """Return generators for all points, the fixed ones first, at the best end of some searches over fewer points."""
    n_starts = max(1, effort.n_starts // 3, min(effort.n_starts, _STARTS_TIMES_GENERATORS // n_generators))

    def search_over(some: Points) -> NDArray[np.float64]:
        ends: list[Iteration] = []
        while len(ends) < n_starts and not _agree(ends) and not conditions.watch.stopped:
            # Seeds that draw nothing serve once.
            seeding = SEEDINGS["random" if ends else init]
            initial = np.concatenate([fixed, seeding(some, n_generators - len(fixed), conditions.rng)])
            ends.append(_breathe(some, initial, method, conditions.until(_SEARCHING), effort.breaths))
        return min(ends, key=lambda end: end.energies[-1]).generators

    n_enough = max(_POINTS_PER_GENERATOR * n_generators, _ENOUGH_POINTS)
    fewer = fewer_points(points, n_enough, conditions.rng)
    try:
        return search_over(fewer)
    except TooFewSamplesError:
        if fewer is points:
            raise
        return search_over(points)  # among fewer points rare samples can be lost


def _agree(ends: list[Iteration]) -> bool:
    """Whether so many searches ended at about the lowest energy that another would hardly end below."""
    energies = [end.energies[-1] for end in ends]
    return sum(energy <= min(energies) * (1 + _ABOUT) for energy in energies) >= _AGREEING


def fewer_points(points: Points, n_enough: int, rng: np.random.Generator) -> Points:
    """Return as many times fewer points as leave enough, or the points themselves."""
    for factor in _COARSER:
        if points.n_points >= factor * n_enough:
            return coarsen(points, factor) if points.in_order else thin(points, factor, rng)
    return points


def _breathe(
    points: Points,
    generators: NDArray[np.float64],
    method: Method,
    conditions: Conditions,
    breaths: tuple[float, float],
) -> Iteration:
    """Follow a method to its end, breathing if `breaths`, shares of the generators, are not 0."""
    if not any(breaths):
        return method(points, generators, conditions)
    largest, least = (max(1, int(share * len(generators))) for share in breaths)
    return breathe(points, generators, method, conditions, largest, least)
