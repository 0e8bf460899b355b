"""MacQueen's method: draw a point and move the nearest generator, so that it is the mean of all points it has met.

J. MacQueen, Proc. 5th Berkeley Symposium on Mathematical Statistics and Probability 1 (1967) 281-297.

It is `Probabilistic(draws=1, a1=1, a2=0, b1=0, b2=1)` in a compiled loop. It gains most in the first pass, then less
and less, and needs no memory beyond the generators. It returns the best generators so far.
"""

from __future__ import annotations

import numpy as np

from cvtimg._shared.types import Floats, Ints64
from cvtimg.engine import _kernels
from cvtimg.engine.methods._iteration import Conditions, Iteration
from cvtimg.engine.methods.probabilistic import follow_draws
from cvtimg.engine.points import Points


def macqueen(points: Points, generators: Floats, conditions: Conditions) -> Iteration:
    """Iterate until the best energy converges; the generator z nearest to the point y becomes (j z + y) / (j + 1)."""

    def move(moving: Floats, counts: Floats, drawn: Ints64) -> None:
        meet(points, drawn, np.ones(len(drawn)), moving, counts, conditions.n_locked)

    return follow_draws(points, generators, conditions, 1, move)


def meet(points: Points, members: Ints64, weights: Floats, moving: Floats, masses: Floats, n_locked: int = 0) -> None:
    """Let generators meet points one by one: the generator z of mass j nearest to y of weight w moves, in place."""
    # It becomes (j z + w y) / (j + w), and its mass j + w.
    columns = np.ascontiguousarray(moving.T)
    _kernels.draw_means(points.tiles, members, weights, columns, masses, np.empty(len(masses)), n_locked)
    moving[:] = columns.T
