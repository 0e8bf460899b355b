"""Evolution: cross tessellations of few points with each other for the lowest energy.

D. Gribel, T. Vidal, HG-means: A scalable hybrid genetic algorithm for minimum sum-of-squares clustering, Pattern
Recognition 88 (2019) 569-583, doi 10.1016/j.patcog.2018.12.022. Here the children of a generation descend side by side.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.iteration import Stopping
from cvtimg._shared.progress import tell
from cvtimg._shared.threads import in_parts
from cvtimg.engine import _kernels
from cvtimg.engine.methods import Conditions, Ends
from cvtimg.engine.methods.transfer import transfer_of_sets
from cvtimg.engine.points import Points
from cvtimg.engine.seeding import SEEDINGS, kmeans_plus_plus, random

#: When children rest: those that are left descend further afterwards.
_RESTING = Stopping(tolerance=1e-3, max_iterations=100)
#: Energies nearer to each other than this fraction, of sets at rest, are taken to be of the same tessellation.
_SAME = 1e-6


class Evolution(NamedTuple):
    """How much to evolve."""

    n_kept: int  # tessellations that become parents
    n_children: int  # in each generation
    patience: int  # evolution ends after so many children for each of 8 to 16 generators without an improvement,
    most: int  # and after so many in all,
    operations: int  # and as many more as this has products of rows, columns and generators


def evolve(
    points: Points, fixed: NDArray[np.float64], n_generators: int, init: str, conditions: Conditions, effort: Evolution
) -> NDArray[np.float64]:
    """Return the (K, D) generators of lowest energy, the fixed ones first, among descendants of those of seedings."""
    # Ends of transfers are fewer than those of Lloyd's method, and lower.
    resting = conditions.until(_RESTING)
    # Those of k-means++ have rare samples that are far away, which others miss; these cost less.
    seedings = [SEEDINGS[init]] + [partial(kmeans_plus_plus, n_draws=1)] * (effort.n_kept // 8)
    seedings += [random] * (effort.n_kept - len(seedings))
    seeds = [seeding(points, n_generators - len(fixed), conditions.rng) for seeding in seedings]
    elders = transfer_of_sets(points, np.stack([np.concatenate([fixed, some]) for some in seeds]), resting)
    most = effort.most + effort.operations // (points.tiles.size * n_generators)
    patience = effort.patience * min(max(n_generators, 8), 16)
    n_idle = n_born = 0
    while True:
        elders = _survivors(elders, effort.n_kept)
        least = float(elders.energies[0])
        if conditions.watch(least) or n_idle >= patience or n_born >= most or least == 0:
            break
        children = transfer_of_sets(points, _children(points, elders, effort.n_children, conditions), resting)
        improved = children.energies.min() < least * (1 - _SAME)
        n_born += effort.n_children
        n_idle = 0 if improved else n_idle + effort.n_children
        elders = Ends(*(np.concatenate(both) for both in zip(elders, children, strict=True)))
        tell(max(n_idle / patience, n_born / most))
    # The best one at rest need not be the best one at the end. In one order, the same ends have the same labels.
    ends = transfer_of_sets(points, elders.generators[: effort.n_kept // 4], conditions)
    free = ends.generators[ends.energies.argmin(), len(fixed) :]
    return np.concatenate([fixed, free[np.lexsort(free.T)]])


def _survivors(ends: Ends, n_kept: int) -> Ends:
    """Return the best ends in order, each tessellation once."""
    order = np.argsort(ends.energies, kind="stable")
    energies = ends.energies[order]
    new = np.diff(energies, prepend=-np.inf) > _SAME * energies
    return Ends(*(values[order[new][:n_kept]] for values in ends))


def _children(points: Points, elders: Ends, n_children: int, conditions: Conditions) -> NDArray[np.float64]:
    """Cross pairs of elders, and replace a free generator of each child by a point that is drawn by its energy."""
    rng, n_locked = conditions.rng, conditions.n_locked
    n_generators, n_dims = elders.generators.shape[1:]
    # Each parent is the better of two elders, which are in order.
    pairs = rng.integers(0, len(elders.energies), (n_children, 2, 2)).min(axis=2)
    inherited = rng.integers(0, 2, (n_children, n_generators), np.uint8)
    replaced = rng.integers(n_locked, n_generators, n_children)
    heights = rng.random(n_children)
    children = np.empty((n_children, n_generators, n_dims))

    def cross(start: int, stop: int) -> None:
        drawn = (values[start:stop] for values in (pairs, inherited, replaced, heights))
        single = np.empty((n_generators, n_dims), points.tiles.dtype), np.empty(n_generators, points.tiles.dtype)
        scratch = *single, np.empty(n_generators, np.uint8), np.empty(len(points.density))
        _kernels.cross_sets(
            points.tiles, points.density, elders.generators, *drawn, n_locked, children[start:stop], *scratch
        )

    in_parts(cross, n_children, work=n_children * points.tiles.size * n_generators)
    return children
