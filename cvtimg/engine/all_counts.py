"""Tessellations for every number of generators from 1 to K, each found from its neighbors.

A solution with k generators is nearly one with k + 1, once its worst cell is divided, and with k - 1, once the
generator that helps least is removed. So a few searches from scratch, at numbers that double, serve all numbers in
between: upwards by dividing, downwards by removing. All of this uses fewer points; only the last moves are on all.
"""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from cvtimg._shared.progress import each, part
from cvtimg.engine.methods import Conditions, Iterate, Iteration, Method, Stopping
from cvtimg.engine.methods.breathing import RESTING, add, breathe, remove
from cvtimg.engine.methods.transfer import weighted_energy
from cvtimg.engine.points import SMALL_ENERGY, Points, cell_energies, cell_moments
from cvtimg.engine.search import EFFORTS, SEARCHED, SearchEffort, fewer_points, search
from cvtimg.engine.seeding import TooFewSamplesError, split

#: Points at least from which the curve is found: with more, 2^14, it takes twice the time and ends 0.3 % lower.
_LEAST_POINTS = 1 << 11
#: When generators rest that are nearly those of the number before: with 8 more steps, energies are the same.
_LINK = Stopping(tolerance=2e-3, max_iterations=8)


def chain(
    points: Points, n_max: int, method: Method, conditions: Conditions, effort: SearchEffort | None = None
) -> list[Iteration]:
    """Return the ends for 1, 2, .. `n_max` generators, or up to the first whose energy is 0."""
    # The energy never rises from one end to the next. With an effort each number is also searched by itself, and the
    # better end kept.
    ends, nothing = list[Iteration](), np.empty((0, points.n_dims))
    one_step = conditions.until(Stopping.after(1))  # on all points, from generators found with fewer
    with part(0, SEARCHED if effort is None else 0.0):
        fewer = fewer_points(points, n_max, _LEAST_POINTS, conditions.rng)
        links = _links(fewer, n_max, method, conditions)
        if fewer is not points and len(links) < n_max and not conditions.watch.stopped:
            links = _links(points, n_max, method, conditions)  # fewer points may lack rare samples
    for link in each(links):
        end = _measured(points, method(points, link.generators, one_step), conditions)
        if effort is not None:
            once = replace(effort, evolution=None)  # which is for a single number
            start = search(points, nothing, len(link.generators), "split", method, conditions, once)
            alone = _measured(points, method(points, start, conditions.until(effort.stopping)), conditions)
            end = min(end, alone, key=lambda some: some.energies[-1])
        if ends and end.energies[-1] > ends[-1].energies[-1]:
            start = add(points, ends[-1], 1, 0)
            end = _measured(points, method(points, start, one_step), conditions)
            end = min(end, ends[-1], key=lambda some: some.energies[-1])
        if ends:
            ends[-1] = replace(ends[-1], labels=None)  # one for each point
        ends.append(end)
        if end.energies[-1] == 0 or conditions.watch.stopped:
            break
    return ends


def _links(points: Points, n_max: int, iterate: Iterate, conditions: Conditions) -> list[Iteration]:
    """Go up and down between searches from scratch, then once more from end to end; keep the best of each number."""
    best: dict[int, Iteration] = {}

    def offer(end: Iteration) -> None:
        n_generators = len(end.generators)
        if n_generators not in best or end.energies[-1] < best[n_generators].energies[-1]:
            best[n_generators] = end

    def follow(numbers: Iterable[int], step: int) -> None:
        for number in numbers:
            if number not in best:
                return
            move = add if step > 0 else remove
            offer(iterate(points, move(points, best[number], 1, 0), conditions.until(_LINK)))

    numbers = sorted({*(1 << power for power in range(n_max.bit_length())), n_max})
    for number in numbers:
        try:
            start = split(points, number, conditions.rng)
        except TooFewSamplesError:
            break  # steps upwards will reach the last number there is
        offer(breathe(points, start, iterate, conditions.until(RESTING), EFFORTS["balanced"].breaths))
        if conditions.watch.stopped:
            break
    for few, many in [*pairwise(numbers), (1, n_max)]:
        follow(range(few, many), 1)
        follow(range(many, few, -1), -1)
    return [best[number] for number in range(1, n_max + 1) if number in best]


def _measured(points: Points, end: Iteration, conditions: Conditions) -> Iteration:
    """Sum a small energy point by point, where the moments of the cells lose digits."""
    if end.energies and (points.exact or end.energies[-1] > SMALL_ENERGY * points.energy_about_origin):
        return end
    labels = end.labels_of(points)
    masses, _ = cell_moments(points, labels, len(end.generators))
    parts = cell_energies(points, end.generators, labels)
    energy = weighted_energy(masses, parts, conditions.volume_power)
    return Iteration(end.generators, [energy], end.converged, end.labels)
