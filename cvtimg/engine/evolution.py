"""Evolution: cross tessellations of few points with each other for the lowest energy.

D. Gribel, T. Vidal, HG-means: A scalable hybrid genetic algorithm for minimum sum-of-squares clustering, Pattern
Recognition 88 (2019) 569-583, doi 10.1016/j.patcog.2018.12.022. Here the children of a generation descend side by side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvtimg._shared.progress import tell
from cvtimg._shared.types import Bools, Floats
from cvtimg.engine.methods import Conditions, Ends
from cvtimg.engine.methods.breathing import RESTING
from cvtimg.engine.methods.transfer import transfer_of_sets
from cvtimg.engine.points import Points
from cvtimg.engine.seeding import SEEDINGS, Seeding, random, seed_sets

#: Share within which energies of sets at rest are of the same tessellation: with more, neighbors count as one.
_SAME = 1e-6
#: Ends that are alike, after which searching ends: with more, it takes longer and hardly ever ends lower.
ENDS_ALIKE = 3
#: Share within which the first ends are alike, as those of separated clusters are: with more, others are taken for one.
_ALIKE = 1e-5
#: Generators for each swap of seeds of k-means++: with more, there are fewer swaps, and seeds are farther from best.
_GENERATORS_PER_SWAP = 4
#: Product of rows, columns and generators up to which a descent takes milliseconds: with more, there are elders of
#: random seeds, which cost one each, for larger tables, too.
_QUICK = 1 << 24
#: Generators whose products with a table take the time of moving any: with more, tables count as larger.
_MOVING = 16


class Evolution(NamedTuple):
    """How much to evolve."""

    n_kept: int  # tessellations that become parents
    n_random: int  # from random seeds, where that takes little time
    n_children: int  # in each generation
    patience: int  # children for each of 8 to 16 generators without an improvement, after which evolution ends
    most: int  # children in all, after which it ends, beside those that follow ...
    operations: float  # ... from this number over the products of rows, columns and generators ...
    power: float  # ... to this power
    hasty_from: int  # from this product on, no other elder is sought if the first ends are alike

    @property
    def of_sample(self) -> Evolution:
        """The same on a sample: what more elders and children gain there is less than what it does not know."""
        return self._replace(n_random=self.n_random // 2, most=self.most // 16, operations=self.operations / 4)


def evolve(
    points: Points, fixed: Floats, n_generators: int, init: str, conditions: Conditions, effort: Evolution
) -> Floats:
    """Return the (K, D) generators of lowest energy, the fixed ones first, among descendants of those of seedings."""
    # Ends of transfers are fewer than those of Lloyd's method, and lower.
    resting = conditions.until(RESTING)  # those that are left descend further afterwards
    n_products = points.tiles.size * (n_generators + _MOVING)
    most = effort.most + int((effort.operations / n_products) ** effort.power)
    patience = effort.patience * min(max(n_generators, 8), 16)
    elders = _elders(points, fixed, n_generators, init, resting, effort)
    n_idle = n_born = 0
    while True:
        # The best stay, in order, each tessellation once.
        order = np.argsort(elders.energies, kind="stable")
        energies = elders.energies[order]
        new = np.diff(energies, prepend=-np.inf) > _SAME * energies
        elders = Ends(*(values[order[new][: effort.n_kept]] for values in elders))
        least = float(elders.energies[0])
        if conditions.watch(least) or n_idle >= patience or n_born >= most or least == 0 or len(elders.energies) == 1:
            break
        n_children = min(effort.n_children, most - n_born)
        children = transfer_of_sets(points, _children(points, elders, n_children, conditions), resting)
        improved = children.energies.min() < least * (1 - _SAME)
        n_born += n_children
        n_idle = 0 if improved else n_idle + n_children
        elders = Ends(*(np.concatenate(both) for both in zip(elders, children, strict=True)))
        tell(max(n_idle / patience, n_born / most))
    # The best one at rest need not be the best one at the end. In one order, the same ends have the same labels.
    n_ends = effort.n_kept // 4 if n_products < _QUICK else 1
    ends = transfer_of_sets(points, elders.generators[:n_ends], conditions)
    free = ends.generators[ends.energies.argmin(), len(fixed) :]
    return np.concatenate([fixed, free[np.lexsort(free.T)]])


def _elders(
    points: Points, fixed: Floats, n_generators: int, init: str, conditions: Conditions, effort: Evolution
) -> Ends:
    """Descend from seeds with swaps, and from others where that takes little time, unless the first ends are alike."""
    n_products = points.tiles.size * (n_generators + _MOVING)
    n_swaps = max(1, n_generators // _GENERATORS_PER_SWAP)
    given = np.repeat(fixed[None], ENDS_ALIKE, axis=0)
    seeded = seed_sets(points, given, n_generators, n_swaps, conditions.rng)
    first = transfer_of_sets(points, seeded, conditions)
    alike = first.energies.max() <= first.energies.min() * (1 + _ALIKE)
    if alike and n_products >= effort.hasty_from:
        return Ends(first.generators[:1], first.energies[:1])
    seedings: list[Seeding] = [random] * (effort.n_random if n_products < _QUICK else 0)
    seedings += [SEEDINGS[init]] if init != "split" else []
    seeds = [seeding(points, n_generators - len(fixed), conditions.rng) for seeding in seedings]
    others = [transfer_of_sets(points, np.stack([np.concatenate([fixed, some])]), conditions) for some in seeds]
    elders = Ends(*(np.concatenate(all_) for all_ in zip(first, *others, strict=True)))
    first_of_all = np.repeat(elders.generators[:1], len(elders.energies) - 1, axis=0)
    elders.generators[1:] = _crossed(first_of_all, elders.generators[1:], np.zeros(first_of_all.shape[:2], bool))
    return elders


def _children(points: Points, elders: Ends, n_children: int, conditions: Conditions) -> Floats:
    """Cross pairs of elders, and put a generator of each, the one missed least, at a point drawn by its energy."""
    rng, n_generators, n_locked = conditions.rng, elders.generators.shape[1], conditions.n_locked
    # Each parent is the better of two elders, which are in order.
    pairs = rng.integers(0, len(elders.energies), (n_children, 2, 2)).min(axis=2)
    inherited = rng.integers(0, 2, (n_children, n_generators), np.uint8).astype(bool)
    parents = elders.generators[pairs]
    crossed = _crossed(parents[:, 0], parents[:, 1], inherited)
    return seed_sets(points, crossed, n_generators, 1, rng, n_locked=n_locked, n_draws=1, worthwhile=np.inf)


def _crossed(sets: Floats, others: Floats, kept: Bools) -> Floats:
    """Replace generators of (n, K, D) sets, unless they are (n, K) kept, by those of others that are near them."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    crossed = sets.copy()
    for child, other, stays in zip(crossed, others, kept, strict=True):
        apart = (child != other).any(axis=1)  # relatives have most in common, in the same places, and locked ones
        matches = linear_sum_assignment(cdist(child[apart], other[apart], "sqeuclidean"))[1]
        child[apart] = np.where(stays[apart, None], child[apart], other[apart][matches])
    return crossed
