"""Points divided into groups, each as even as it can be: runs with the same category."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.budgets import ROUNDING
from cvtimg._shared.checks import check_count
from cvtimg._shared.types import Floats, Indices
from cvtimg.designs.cells import check_unit_points


def split_evenly(
    points: ArrayLike,
    n_groups: int,
    *,
    known: ArrayLike = (),
    others: Sequence[ArrayLike] = (),
    rng: int | np.random.Generator = 0,
) -> Indices:
    """Divide (n, d) points of the unit cube into groups of equal size, but for one, that fill it evenly: (n,) numbers.

    The first points stay in the (L,) groups that are known of them; each of other (n,) groups is divided, too.

    Two points change places where that lowers the sum of the centered L2 discrepancies of the groups, as in sliced
    designs (P. Qian, J. American Statistical Association 107 (2012) 393-399, doi 10.1080/01621459.2011.644132); the
    points stay where they are, and so all of them are as even as before.
    """
    places = check_unit_points("points", points) - 0.5
    n_groups = check_count("n_groups", n_groups, len(places), "the number of points")
    held, random = np.asarray(known, np.intp), np.random.default_rng(rng)
    terms = partial(_terms, np.ascontiguousarray(places.T), [np.asarray(labels) for labels in others])
    # Few points begin several times, and the best are kept.
    starts = [_start(len(places), n_groups, held, random) for _ in range(8 if len(places) <= 256 else 1)]
    return min(starts, key=lambda labels: _exchange(terms, labels, n_groups, len(held), random))


def _terms(columns: Floats, others: Sequence[NDArray[np.generic]], point: int) -> Floats:
    """Return what a point costs with each (n,) in the same group: a term of the discrepancy, more in other groups."""
    terms, times = np.ones(columns.shape[1]), 1
    for column in columns:
        terms *= 1 + 0.5 * (abs(column) + abs(column[point]) - abs(column - column[point]))
    for labels in others:
        times = times + (labels == labels[point])
    terms *= times
    terms[point] = 0
    return terms


def _start(n_points: int, n_groups: int, known: Indices, rng: np.random.Generator) -> Indices:
    """Put points into groups at random, first into those that have the fewest."""
    counts = np.bincount(known, minlength=n_groups)
    labels = list(known)
    for _ in range(n_points - len(known)):
        labels.append(int(np.argmin(counts + rng.random(n_groups))))
        counts[labels[-1]] += 1
    return np.array(labels, np.intp)


def _exchange(
    terms_of: Callable[[int], Floats], labels: Indices, n_groups: int, n_known: int, rng: np.random.Generator
) -> float:
    """Let two points change groups where that gains the most, in place, until none gains; return what is left."""
    n_points = len(labels)
    every, free = np.arange(n_points), np.arange(n_known, n_points)
    sums: Floats = np.stack([np.bincount(labels, terms_of(point), n_groups) for point in range(n_points)])
    is_better, rounding = True, ROUNDING * float(sums.max())
    while is_better:
        is_better = False
        for i in rng.permutation(free).tolist():
            group, terms = labels[i], terms_of(i)
            change = sums[i, labels] - sums[i, group] + sums[:, group] - sums[every, labels] - 2 * terms
            change[(labels == group) | (every < n_known)] = 0
            j = int(change.argmin())
            if change[j] < -rounding:
                is_better = True
                difference = terms_of(j) - terms
                sums[:, group] += difference
                sums[:, labels[j]] -= difference
                labels[i], labels[j] = labels[j], group
    return float(sums[every, labels].sum())
