"""Breathing: leave a local minimum by adding generators where they help most and removing those that help least.

B. Fritzke, The breathing k-means algorithm, arXiv:2006.15666. Here cells are divided as in seeding, and the number of
generators added and removed is halved after each breath that did not help.
"""

from dataclasses import replace

import numpy as np

from cvtimg._shared.iteration import Stopping
from cvtimg._shared.types import Floats
from cvtimg.engine.methods._iteration import Conditions, Iterate, Iteration
from cvtimg.engine.points import Points, assign_next, cell_energies
from cvtimg.engine.seeding import halves

#: When generators rest: after some were added hardly, wherever ends are compared nearly. With less it takes longer.
_IN = Stopping(tolerance=1e-2, max_iterations=5)
RESTING = Stopping(tolerance=1e-3, max_iterations=100)
#: Share of the energy that a breath must take to help: with more, breaths end sooner, and higher.
_WORTHWHILE = 1e-4


def breathe(
    points: Points, generators: Floats, descend: Iterate, conditions: Conditions, breaths: tuple[float, float]
) -> Iteration:
    """Breathe until no breath lowers the energy, then descend."""
    # With breaths of (0, 0) this is the descent alone; others are at least one generator.
    if not any(breaths):
        return descend(points, generators, conditions)
    breath, smallest = (max(1, int(share * len(generators))) for share in breaths)
    n_locked = conditions.n_locked
    best = descend(points, generators, conditions.until(RESTING))
    energies = list(best.energies)
    while breath >= smallest and energies[-1] > 0 and not conditions.watch.stopped:
        more = descend(points, add(points, best, breath, n_locked), conditions.until(_IN))
        n_added = len(more.generators) - len(best.generators)
        if not n_added:
            break  # every cell is a single point
        fewer = descend(points, remove(points, more, n_added, n_locked), conditions.until(RESTING))
        if fewer.energies[-1] < energies[-1] * (1 - _WORTHWHILE):
            best = fewer
            energies.append(fewer.energies[-1])
        else:
            breath //= 2
    end = descend(points, best.generators, conditions)
    # A method with labels of its own starts again from nearest generators, where its energy may be slightly higher.
    if end.energies[-1] > energies[-1]:
        return replace(best, energies=energies)
    return replace(end, energies=energies + [lower for lower in end.energies if lower < energies[-1]])


def add(points: Points, end: Iteration, n_more: int, n_locked: int) -> Floats:
    """Divide the `n_more` cells of highest energy, or as many as can be divided; locked generators stay as well."""
    generators, labels = end.generators, end.labels_of(points)
    energies = cell_energies(points, generators, labels)
    worst = np.argsort(-energies, kind="stable")[: min(n_more, np.count_nonzero(energies))]
    lower, upper = halves(points, labels, worst, len(generators))
    more = np.concatenate([generators, upper])
    free = worst >= n_locked
    more[worst[free]] = lower[free]
    return more


def remove(points: Points, end: Iteration, n_fewer: int, n_locked: int) -> Floats:
    """Remove the generators whose loss raises the energy least, and no two neighbors unless there is no other way."""
    generators, labels = end.generators, end.labels_of(points)
    seconds, gaps = assign_next(points, generators, labels)
    n_generators = len(generators)
    costs = np.bincount(labels, points.density * gaps, n_generators)
    if n_fewer == 1:
        return np.delete(generators, n_locked + costs[n_locked:].argmin(), axis=0)
    cells, neighbors = np.divmod(np.sort(labels * np.int64(n_generators) + seconds), n_generators)
    first = np.searchsorted(cells, np.arange(n_generators + 1))
    removed: list[int] = []
    spared: list[int] = []
    frozen = np.zeros(n_generators, bool)
    for cell in n_locked + np.argsort(costs[n_locked:], kind="stable"):
        if frozen[cell]:
            spared.append(cell)
        else:
            removed.append(cell)
            frozen[neighbors[first[cell] : first[cell + 1]]] = True
        if len(removed) == n_fewer:
            break
    removed += spared[: n_fewer - len(removed)]
    return np.delete(generators, removed, axis=0)
