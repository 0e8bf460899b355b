"""Evolution: cross tessellations of few points with each other for the lowest energy.

D. Gribel, T. Vidal, HG-means: A scalable hybrid genetic algorithm for minimum sum-of-squares clustering, Pattern
Recognition 88 (2019) 569-583, doi 10.1016/j.patcog.2018.12.022. Here the children of a generation descend side by side.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.iteration import Stopping
from cvtimg._shared.progress import tell
from cvtimg.engine.methods import METHODS, Conditions, Ends, Method
from cvtimg.engine.methods.lloyd import masses_and_distances
from cvtimg.engine.points import Points
from cvtimg.engine.seeding import SEEDINGS, kmeans_plus_plus, random

#: When children rest: those that are left descend further afterwards.
_RESTING = Stopping(tolerance=1e-3, max_iterations=100)
#: Energies nearer to each other than this fraction, of sets at rest, are taken to be of the same tessellation.
_SAME = 1e-4


@dataclass(frozen=True, slots=True)
class Evolution:
    """How much to evolve."""

    n_kept: int  # tessellations that become parents
    n_children: int  # in each generation
    patience: int  # evolution ends after so many children without an improvement
    most: int  # and after so many in all of 32 columns; as many as cost the same of fewer or more
    n_candidates: int = 4  # generators of a child, drawn at random, of which the one that is missed least is replaced


def evolve(
    points: Points,
    fixed: NDArray[np.float64],
    n_generators: int,
    init: str,
    method: Method,
    conditions: Conditions,
    effort: Evolution,
) -> NDArray[np.float64]:
    """Return the (K, D) generators of lowest energy, the fixed ones first, among descendants of those of seedings."""
    descend, resting, n_best = method.descend_all, conditions.until(_RESTING), effort.n_kept // 2
    # Those of k-means++ have rare samples that are far away, which others miss; these cost less.
    seedings = [SEEDINGS[init]] + [partial(kmeans_plus_plus, n_draws=1)] * n_best
    seedings += [random] * (effort.n_kept - len(seedings))
    free = [seeding(points, n_generators - len(fixed), conditions.rng) for seeding in seedings]
    elders = descend(points, np.stack([np.concatenate([fixed, some]) for some in free]), resting)
    most = effort.most * 32 // points.n_dims
    n_idle = n_born = 0
    while True:
        elders = _survivors(elders, effort.n_kept)
        least = float(elders.energies[0])
        if conditions.watch(least) or n_idle >= effort.patience or n_born >= most or least == 0:
            break
        children = descend(points, _children(points, elders, effort, conditions), resting)
        improved = children.energies.min() < least * (1 - _SAME)
        n_born += effort.n_children
        n_idle = 0 if improved else n_idle + effort.n_children
        elders = Ends(*(np.concatenate(both) for both in zip(elders, children, strict=True)))
        tell(n_idle / effort.patience)
    # The best one at rest need not be the best one at the end. Transfers of single points lower many ends further.
    elders = _survivors(descend(points, elders.generators, conditions), n_best)
    ends = METHODS["transfer"].descend_all(points, elders.generators, conditions)
    best: NDArray[np.float64] = ends.generators[ends.energies.argmin()]
    return best


def _survivors(ends: Ends, n_kept: int) -> Ends:
    """Return the best ends in order, each tessellation once."""
    order = np.argsort(ends.energies, kind="stable")
    energies = ends.energies[order]
    new = np.diff(energies, prepend=-np.inf) > _SAME * energies
    kept = order[new][:n_kept]
    return Ends(*(values[kept] for values in ends))


def _children(points: Points, elders: Ends, effort: Evolution, conditions: Conditions) -> NDArray[np.float64]:
    """Cross pairs of elders, and replace one free generator of each child by a point that is drawn by its energy."""
    rng, n_locked, n_children = conditions.rng, conditions.n_locked, effort.n_children
    n_generators = elders.generators.shape[1]
    # Each parent is the better of two elders, which are in order.
    pairs = rng.integers(0, len(elders.energies), (n_children, 2, 2)).min(axis=2)
    children, others = elders.generators[pairs[:, 0]], elders.generators[pairs[:, 1]]
    inherited = rng.random((n_children, n_generators - n_locked, 1)) < 0.5
    children[:, n_locked:] = np.where(inherited, children[:, n_locked:], _matched(children, others, n_locked))
    masses, distances = masses_and_distances(points, children)
    every = np.arange(n_children)
    candidates = rng.integers(n_locked, n_generators, (n_children, effort.n_candidates))
    costs = _merging_costs(children, masses, candidates)
    replaced = candidates[every, costs.argmin(axis=1)]
    cumulative = np.cumsum(points.density * distances, axis=1)
    draws = cumulative[:, -1:] * rng.random((n_children, 1))
    children[every, replaced] = points.rows(np.argmax(cumulative >= draws, axis=1))
    return children


def _merging_costs(
    sets: NDArray[np.float64], masses: NDArray[np.float64], candidates: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return by how much the energy rises, about, if each (n, c) candidate of (n, K, D) sets joins its neighbor."""
    # J. Ward, J. American Statistical Association 58 (1963), doi 10.1080/01621459.1963.10500845.
    every = np.arange(len(sets))[:, None]
    own, others = masses[every, candidates][:, :, None], masses[:, None]
    steps = sets[every, candidates][:, :, None] - sets[:, None]
    shared = np.divide(own * others, own + others, out=np.zeros(steps.shape[:3]), where=own + others > 0)
    costs = shared * np.einsum("nckd,nckd->nck", steps, steps)
    np.put_along_axis(costs, candidates[:, :, None], np.inf, axis=2)
    return costs.min(axis=2)


def _matched(generators: NDArray[np.float64], others: NDArray[np.float64], n_locked: int) -> NDArray[np.float64]:
    """Return the free ones of `others`, (n, K, D), in the order that pairs them with the nearest of `generators`."""
    from scipy.optimize import linear_sum_assignment  # takes a while to import

    own, partners = generators[:, n_locked:], others[:, n_locked:]
    crossed = np.einsum("nkd,njd->nkj", own, partners)
    costs = np.einsum("njd,njd->nj", partners, partners)[:, None] - 2 * crossed
    order = np.stack([linear_sum_assignment(cost)[1] for cost in costs])
    return np.take_along_axis(partners, order[:, :, None], axis=1)
