"""Probabilistic methods: move generators by points drawn a few at a time; a family with two parameters.

L. Ju, Q. Du, M. Gunzburger, Parallel Computing 28 (2002) 1477-1500, doi 10.1016/S0167-8191(02)00151-5.

They lie between MacQueen's method (one point per move, shrinking steps) and Lloyd's (all points, whole steps). Use them
when a few points should do the work of very many, or as a reference; otherwise Lloyd's method is faster and ends
nearer to a centroidal Voronoi tessellation. Chance raises the energy now and then: the energies and generators
returned are the best so far.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import cvtimg.engine._kernels as _kernels
from cvtimg._shared.checks import check_at_least
from cvtimg._shared.iteration import iterate
from cvtimg._shared.types import Floats, Ints, Ints64
from cvtimg.engine.methods._iteration import Conditions, Iteration
from cvtimg.engine.points import Points, assign, cell_moments, energy
from cvtimg.engine.seeding import refill

#: Consecutive steps that must bring next to nothing before it has converged: a single one may fail by chance.
_PATIENCE = 4
#: With fewer draws per generator the means of groups are too noisy; with more there are too few moves. For photographs
#: in 32 and 256 colors, 16 to 64 do equally well.
_DRAWS_PER_GENERATOR = 32

#: Moves generators (K, D) in place by the drawn points, and counts the moves of each (K,) in place.
Move = Callable[[Floats, Floats, Ints64], None]


@dataclass(frozen=True, slots=True)
class Probabilistic:
    """A method of the family: pass it to `tessellate` as ``method``.

    A move draws points by density. A generator z that is nearest to some of them, with mean u, becomes
    ((a1 j + b1) z + (a2 j + b2) u) / (j + 1), where j is 1 at first and grows by 1 with each of its moves.

    Attributes
    ----------
    draws : int or None
        Points drawn per move. None draws 32 per generator.
    a1, a2 : float
        Weights of z and u in late moves: >= 0, with sum 1. With ``a2 > 0`` generators never quite settle: the energy
        stays higher by about ``a2 / (2 - a2)`` times the number of generators per draw, 0.5 % with the defaults. With
        ``a2 = 0`` they converge, but forget a bad start slowly. A small `a2` balances the two.
    b1, b2 : float
        The same for the first moves: ``b2 = 1`` leaves the start behind at once.
    """

    draws: int | None = None
    a1: float = 0.75
    a2: float = 0.25
    b1: float = 0.0
    b2: float = 1.0

    def __post_init__(self) -> None:
        if self.draws is not None:
            check_at_least("draws", self.draws, 1, "or None")
        for first, second in (("a1", "a2"), ("b1", "b2")):
            first_weight, second_weight = float(getattr(self, first)), float(getattr(self, second))
            if not (first_weight >= 0 and second_weight >= 0 and abs(first_weight + second_weight - 1) <= 1e-12):
                raise ValueError(f"{first}={first_weight} and {second}={second_weight} must be >= 0, with sum 1")

    def __call__(self, points: Points, generators: Floats, conditions: Conditions) -> Iteration:
        """Iterate until the best energy converges."""
        draws = self.draws or _DRAWS_PER_GENERATOR * len(generators)

        def move(moving: Floats, counts: Floats, drawn: Ints64) -> None:
            for start in range(0, len(drawn), draws):
                some = np.sort(drawn[start : start + draws])  # near points stay near, which makes `assign` faster
                group = points.take(some, np.ones(len(some)))
                masses, sums = cell_moments(group, assign(group, moving), len(moving))
                masses[: conditions.n_locked] = 0
                met = masses > 0
                j, means = counts[met, None], sums[met] / masses[met, None]
                old, new = self.a1 * j + self.b1, self.a2 * j + self.b2
                moving[met] = (old * moving[met] + new * means) / (j + 1)
                counts[met] += 1

        return follow_draws(points, generators, conditions, draws, move)


def follow_draws(points: Points, generators: Floats, conditions: Conditions, draws: int, move: Move) -> Iteration:
    """Follow moves of `draws` points each, and keep the best generators seen."""
    # A step draws each point once on average, so that measuring the energy costs no more than moving.
    n_drawn = -(-points.n_points // draws) * draws
    moving, counts = generators.copy(), np.ones(len(generators))
    best, lowest = generators, np.inf
    labels: Ints
    masses: Floats

    def measure() -> float:
        nonlocal labels, masses, best, lowest
        labels = assign(points, moving)
        masses, sums = cell_moments(points, labels, len(moving))
        now = energy(points, moving, labels, masses, sums)
        if now < lowest:
            best, lowest = moving.copy(), now
        return lowest

    def step() -> float:
        nonlocal moving
        refilled = refill(points, moving, labels, masses, conditions.n_locked)
        counts[(refilled != moving).any(axis=1)] = 1
        moving = refilled
        move(moving, counts, draw(points, n_drawn, conditions.rng))
        return measure()

    history = iterate(measure(), step, replace(conditions.stopping, patience=_PATIENCE), conditions.watch)
    return Iteration(best, *history)


def draw(points: Points, n_drawn: int, rng: np.random.Generator) -> Ints64:
    """Draw points by density, with repetition, in random order."""
    cumulative = np.cumsum(points.density)
    # Sorted heights are found three times faster.
    heights = np.sort(rng.random(n_drawn)) * cumulative[-1]
    drawn = np.searchsorted(cumulative, heights, side="right")
    last = np.flatnonzero(points.density)[-1]  # as a height may be rounded up to the sum of all
    return rng.permutation(np.minimum(drawn, last))


def macqueen(points: Points, generators: Floats, conditions: Conditions) -> Iteration:
    """Draw a point and move the nearest generator, so that it is the mean of all points it has met.

    It is `Probabilistic(draws=1, a1=1, a2=0, b1=0, b2=1)` in a compiled loop, and gains most in the first pass.

    J. MacQueen, Proc. 5th Berkeley Symposium on Mathematical Statistics and Probability 1 (1967) 281-297.
    """

    def move(moving: Floats, counts: Floats, drawn: Ints64) -> None:
        meet(points, drawn, np.ones(len(drawn)), moving, counts, conditions.n_locked)

    return follow_draws(points, generators, conditions, 1, move)


def meet(points: Points, members: Ints64, weights: Floats, moving: Floats, masses: Floats, n_locked: int = 0) -> None:
    """Let generators meet points one by one: the generator z of mass j nearest to y of weight w moves, in place."""
    # It becomes (j z + w y) / (j + w), and its mass j + w.
    columns = np.ascontiguousarray(moving.T)
    _kernels.draw_means(points.tiles, members, weights, columns, masses, np.empty(len(masses)), n_locked)
    moving[:] = columns.T
