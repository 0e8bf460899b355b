"""Breathing: leave a local minimum by adding generators where they are missed and taking away those least missed.

B. Fritzke, The breathing k-means algorithm, arXiv:2006.15666. Here cells are divided as seeding divides them, and
the number of generators that come and go is halved when a breath was in vain.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.methods._iteration import Conditions, Iteration, Method, Stopping
from cvtimg.engine.points import Points, assign, assign_two, cell_energies
from cvtimg.engine.seeding import halves

#: After breathing in, the iteration need not come to rest; after breathing out, nearly.
_IN = Stopping(tolerance=1e-2, max_iterations=5)
_OUT = Stopping(tolerance=1e-3, max_iterations=100)
#: A breath that lowers the energy by less than this share was in vain.
_WORTHWHILE = 1e-4


def breathe(
    points: Points,
    generators: NDArray[np.float64],
    descend: Method,
    conditions: Conditions,
    largest_breath: int,
    least_breath: int = 1,
) -> Iteration:
    """Breathe until no breath, of `largest_breath` generators down to the least, lowers the energy; then descend."""
    n_locked = conditions.n_locked
    best, breath = descend(points, generators, conditions.until(_OUT)), largest_breath
    energies = list(best.energies)
    while breath >= least_breath and energies[-1] > 0 and not conditions.watch.stopped:
        more = descend(points, add(points, best.generators, breath, n_locked), conditions.until(_IN))
        n_added = len(more.generators) - len(best.generators)
        if not n_added:
            break  # every cell is a single point
        fewer = descend(points, remove(points, more.generators, n_added, n_locked), conditions.until(_OUT))
        if fewer.energies[-1] < energies[-1] * (1 - _WORTHWHILE):
            best = fewer
            energies.append(fewer.energies[-1])
        else:
            breath //= 2
    end = descend(points, best.generators, conditions)
    # A method with labels of its own begins again from nearest generators, where its energy may be a little higher.
    if end.energies[-1] > energies[-1]:
        return replace(best, energies=energies)
    return replace(end, energies=energies + [lower for lower in end.energies if lower < energies[-1]])


def add(points: Points, generators: NDArray[np.float64], n_more: int, n_locked: int) -> NDArray[np.float64]:
    """Divide the cells of greatest energy, `n_more` or as many as can be; locked generators stay as well."""
    labels = assign(points, generators)
    energies = cell_energies(points, generators, labels)
    worst = np.argsort(-energies, kind="stable")[: min(n_more, np.count_nonzero(energies))]
    lower, upper = halves(points, labels, worst, len(generators))
    more = np.concatenate([generators, upper])
    free = worst >= n_locked
    more[worst[free]] = lower[free]
    return more


def remove(points: Points, generators: NDArray[np.float64], n_fewer: int, n_locked: int) -> NDArray[np.float64]:
    """Take away the generators whose removal raises the energy least, no two neighbours while there are others."""
    labels, seconds, gaps = assign_two(points, generators)
    n_generators = len(generators)
    costs = np.bincount(labels, points.density * gaps, n_generators)
    cells, neighbours = np.divmod(np.sort(labels * np.int64(n_generators) + seconds), n_generators)
    first = np.searchsorted(cells, np.arange(n_generators + 1))
    removed: list[int] = []
    spared: list[int] = []
    frozen = np.zeros(n_generators, bool)
    for cell in n_locked + np.argsort(costs[n_locked:], kind="stable"):
        if frozen[cell]:
            spared.append(cell)
        else:
            removed.append(cell)
            frozen[neighbours[first[cell] : first[cell + 1]]] = True
        if len(removed) == n_fewer:
            break
    removed += spared[: n_fewer - len(removed)]
    return np.delete(generators, removed, axis=0)
