"""Searches for a low energy before the last descent on all points.

The energy has many local minima. Fewer points show where the low ones are at a fraction of the cost, so most of the
search happens there. Tables of few rows are searched as they are, by evolution: it finds lower minima, for a time that
only few rows are worth.
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from cvtimg._shared.progress import part
from cvtimg._shared.types import Floats
from cvtimg.engine.evolution import ENDS_ALIKE, Evolution, evolve
from cvtimg.engine.methods import Conditions, Iteration, Method, Stopping
from cvtimg.engine.methods.breathing import breathe
from cvtimg.engine.points import Points, coarsen, thin
from cvtimg.engine.seeding import SEEDINGS, TooFewSamplesError


@dataclass(frozen=True, slots=True)
class SearchEffort:
    """How much work to spend on finding a low energy."""

    # Maximum number of searches over fewer points, each from its own seeds; the lowest end is continued on all points.
    # From 43 generators on there are fewer, down to a third: each costs more, and the ends differ less.
    n_starts: int
    breaths: tuple[float, float]  # largest and smallest in such a search, as fractions of the generators; 0 for none
    stopping: Stopping  # of the descent on all samples
    evolution: Evolution | None = None  # where the rows of a table are few


#: Evolutions of tables of few rows, by effort.
_BALANCED = Evolution(12, 8, 8, 8, 1, 2.0**31.5, 1 / 2, 1 << 20)
_BEST = Evolution(20, 16, 32, 20, 1024, 2.0**30, 1, 1 << 24)
#: The registry of efforts: the values of `effort` and ``--effort``; `tessellate` documents what each costs.
EFFORTS: dict[str, SearchEffort] = {
    "fast": SearchEffort(1, (0, 0), Stopping(tolerance=1e-2, max_iterations=4)),
    "balanced": SearchEffort(1, (1 / 6, 1 / 16), Stopping(tolerance=1e-4, max_iterations=300), _BALANCED),
    "best": SearchEffort(12, (1 / 4, 0), Stopping(tolerance=1e-6, max_iterations=1000), _BEST),
}

#: Rows for each that is searched, from which a pass over all takes longer than the best search.
_FAR_MORE = 8
#: Share of the lowest energy within which ends are alike: with more, searches end sooner and sometimes higher.
_ABOUT = 5e-4
#: When ends of searches rest: with less, they take longer and are in the same order.
_SEARCHING = Stopping(tolerance=1e-4, max_iterations=100)
#: Searches times generators at most: with more, many generators take longer, though their ends hardly differ.
_STARTS_TIMES_GENERATORS = 512
#: Points that a search needs for each generator, and in total: with more it takes longer and ends a little lower, by
#: 0.3 % in twice the time.
ROWS_PER_GENERATOR, _LEAST_ROWS = 50, 1 << 14
#: Part of the time that the search over fewer points takes.
SEARCHED = 0.7


def effort_beyond(effort: SearchEffort, n_rows: int, n_searched: int) -> SearchEffort:
    """Return how much to search on a sample of many more rows: as much as the best effort, unless it is to be fast."""
    worthwhile = n_rows >= _FAR_MORE * n_searched and any(effort.breaths)
    return EFFORTS["best"] if worthwhile else effort


def search(
    points: Points,
    fixed: Floats,
    n_generators: int,
    init: str,
    method: Method,
    conditions: Conditions,
    effort: SearchEffort,
) -> Floats:
    """Return generators, the fixed ones first, from the best of some searches over fewer points."""
    some = fewer_points(points, n_generators, _LEAST_ROWS, conditions.rng)
    if effort.evolution and n_generators > len(fixed) and (some is points or not points.in_order):
        with suppress(TooFewSamplesError):
            if some is not points:
                return evolve(some, fixed, n_generators, init, conditions, effort.evolution.of_sample)
        return evolve(points, fixed, n_generators, init, conditions, effort.evolution)
    n_starts = max(1, effort.n_starts // 3, min(effort.n_starts, _STARTS_TIMES_GENERATORS // n_generators))
    ends: list[Iteration] = []
    while len(ends) < n_starts and not _agree(ends) and not conditions.watch.stopped:
        # A deterministic seeding is of use only once.
        seeding = SEEDINGS["random" if ends else init]
        try:
            initial = np.concatenate([fixed, seeding(some, n_generators - len(fixed), conditions.rng)])
            with part(len(ends) / n_starts, (len(ends) + 1) / n_starts):
                ends.append(breathe(some, initial, method.iterate, conditions.until(_SEARCHING), effort.breaths))
        except TooFewSamplesError:
            if some is points:
                raise
            some, ends = points, []  # fewer points may lack rare samples
    return min(ends, key=lambda end: end.energies[-1]).generators


def _agree(ends: list[Iteration]) -> bool:
    """Whether enough searches ended near the lowest energy that another would hardly end below it."""
    energies = [end.energies[-1] for end in ends]
    return sum(energy <= min(energies) * (1 + _ABOUT) for energy in energies) >= ENDS_ALIKE


def fewer_points(points: Points, n_generators: int, least: int, rng: np.random.Generator) -> Points:
    """Return one of 2, 4, .. 32 points, the fewest that are enough and at least that many, or the points themselves."""
    spare = points.n_points // max(ROWS_PER_GENERATOR * n_generators, least)
    factor = 1 << min(max(spare, 1).bit_length() - 1, 5)
    if factor == 1:
        return points
    return coarsen(points, factor) if points.in_order else thin(points, factor, rng)
