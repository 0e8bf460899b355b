"""MacQueen: move the generator nearest to a point that is drawn, so that it is the mean of all that it has met.

J. MacQueen, Proc. 5th Berkeley Symposium on Mathematical Statistics and Probability 1 (1967) 281-297.

The first of the probabilistic methods, `Probabilistic(draws=1, a1=1, a2=0, b1=0, b2=1)`, in a compiled loop. It gains
most of what it can in the first pass, for no more memory than the generators, and then ever less: use it for a quick
descent or to compare. The best generators so far are what is returned.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine import _kernels
from cvtimg.engine.methods._iteration import Conditions, Iteration
from cvtimg.engine.methods.probabilistic import follow_draws
from cvtimg.engine.points import Points


def macqueen(points: Points, generators: NDArray[np.float64], conditions: Conditions) -> Iteration:
    """Iterate until the best energy rests; z becomes (j z + y) / (j + 1) where it is nearest to the point y drawn."""

    def move(moving: NDArray[np.float64], counts: NDArray[np.float64], drawn: NDArray[np.int64]) -> None:
        columns = np.ascontiguousarray(moving.T)
        _kernels.draw_means(points.tiles, drawn, columns, counts, np.empty(len(counts)), conditions.n_locked)
        moving[:] = columns.T

    return follow_draws(points, generators, conditions, 1, move)
