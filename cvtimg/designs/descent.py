"""Points moved to the centers of mass of their cells in the unit cube, plain or Latin, by samples or exactly."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from cvtimg._shared.budgets import ENOUGH_SAMPLES
from cvtimg._shared.choices import EffortName
from cvtimg._shared.iteration import Stopping
from cvtimg._shared.types import Bools, Floats
from cvtimg.designs.cells import MOST_EXACT_DIMS, Cube, sobol_samples
from cvtimg.designs.latin import Slices, anneal, even_out, latinize
from cvtimg.designs.measures import point_measures, star_discrepancy
from cvtimg.engine.tessellation import tessellate
from cvtimg.placement.descent import Terms, l_bfgs, over_relaxed

#: Share by which the energy of Latin points may be above the best if they are more even.
_ABOUT = 5e-3


@dataclass(frozen=True, slots=True)
class DesignEffort:
    """How much work is done."""

    samples: int  # for each point
    n_starts: int  # of which the best is kept
    exact: Stopping  # when descents on the exact energy stop
    sampled: Stopping  # when descents on samples of the torus stop
    latin_rounds: int  # in which points move and become Latin again
    swaps: int  # comparisons along an axis, to swap coordinates of Latin points


#: The registry: names for `effort`.
EFFORTS = {
    "fast": DesignEffort(256, 1, Stopping(1e-4, 40), Stopping(1e-3, 20), 10, 10_000_000),
    "balanced": DesignEffort(1024, 1, Stopping(1e-5, 120), Stopping(1e-4, 60), 30, 100_000_000),
    "best": DesignEffort(4096, 6, Stopping(1e-7, 600), Stopping(1e-5, 150), 60, 1_000_000_000),
}


def place(cube: Cube, n_points: int, existing: Floats, effort: EffortName, rng: np.random.Generator) -> list[Floats]:
    """Find (n, d) points of low energy beside (L, d) that exist, from a few starts, those of least energy first."""
    starts = [_tessellated(cube, n_points, existing, effort, "split", rng)]
    if not cube.exact and not cube.periodic:
        return starts
    others = range(EFFORTS[effort].n_starts - 1)
    starts += [_tessellated(cube, n_points, existing, "balanced", "random", rng) for _ in others]
    free = np.arange(n_points + len(existing)) >= len(existing)
    descend, stopping = (l_bfgs, EFFORTS[effort].exact) if cube.exact else (over_relaxed, EFFORTS[effort].sampled)
    # On a wall, mirror images would lie on the points.
    terms = Terms(stopping, free, None if cube.periodic else lambda points, before: np.clip(points, 1e-9, 1 - 1e-9))
    ends = [descend(cube, np.concatenate([existing, start]), terms) for start in starts]
    ends.sort(key=lambda end: end.energies[-1])
    designs = [end.generators[len(existing) :] for end in ends]
    return [points % 1.0 for points in designs] if cube.periodic else designs


def place_latin(
    cube: Cube, starts: list[Floats], existing: Floats, effort: EffortName, rng: np.random.Generator
) -> Floats:
    """Make the points of each start Latin; of those whose energy is about the least, return the most even."""
    work, latin = EFFORTS[effort].swaps, partial(_latin, existing=existing)
    settled = [_alternate(cube, points, existing, effort, latin) for points in starts]
    ends = [even_out(points, existing, cube.periodic, work, rng) for points in settled]
    if len(ends) == 1 or len(ends[0]) + len(existing) == 1:
        return ends[0]
    energies = [cube(np.concatenate([existing, points])).energy for points in ends]
    enough = min(energies) * (1 + _ABOUT)
    about_least = [points for points, energy in zip(ends, energies, strict=True) if energy <= enough]
    return min(about_least, key=partial(_unevenness, periodic=cube.periodic))


def place_for(
    criterion: str, cube: Cube, n_points: int, existing: Floats, effort: EffortName, rng: np.random.Generator
) -> Floats:
    """Find (n, d) Latin points for a criterion beside (L, d) that exist."""
    start = _latin(sobol_samples(n_points, cube.samples.shape[1], rng)[:n_points].astype(np.float64), existing)
    return anneal(start, existing, criterion, cube.periodic, EFFORTS[effort].swaps, rng)


def place_latin_within(
    cube: Cube,
    start: Floats,
    existing: Floats,
    effort: EffortName,
    allowed: Callable[[Floats], Bools],
    mended: Callable[[Floats], Floats],
) -> tuple[Floats, bool]:
    """Make points of a region Latin as far as they are allowed to; return them, and whether no slice is empty.

    Slices have equal shares of the region, because those of equal width would ask for many points where it is thin.
    Centers of mass that are outside are `mended`.
    """
    slices = Slices.of_region(cube.samples, len(start) + len(existing))

    def latin(points: Floats) -> Floats:
        return slices.latinize(mended(points), existing, allowed)

    places = _alternate(cube, start, existing, effort, latin, slices.n_empty)
    return places, slices.n_empty(np.concatenate([existing, places])) == 0


def _alternate(
    cube: Cube,
    points: Floats,
    existing: Floats,
    effort: EffortName,
    latin: Callable[[Floats], Floats],
    fault: Callable[[Floats], int] = lambda _: 0,
) -> Floats:
    """Move points to their centers of mass and make them Latin again, in turns.

    Returns those of least energy among those of least fault.
    """
    points = latin(points)
    best, least = points, (sys.maxsize, np.inf)
    for _ in range(EFFORTS[effort].latin_rounds):
        every = np.concatenate([existing, points])
        moments = cube(every)
        if (reached := (fault(every), moments.energy)) < least:
            best, least = points, reached
        moved = latin(moments.centroids[len(existing) :])
        if (moved == points).all():
            break
        points = moved
    return best


def _unevenness(points: Floats, periodic: bool) -> float:
    """Multiply how uneven boxes and cells are where both are exact; else measure the centered L2 discrepancy."""
    from scipy.stats.qmc import discrepancy

    if points.shape[1] > MOST_EXACT_DIMS:
        return float(discrepancy(points))
    return star_discrepancy(points)[0] * point_measures(points, periodic=periodic).chi


def _tessellated(
    cube: Cube, n_points: int, existing: Floats, effort: EffortName, init: Any, rng: np.random.Generator
) -> Floats:
    locked = existing if len(existing) else None
    n_all = n_points + len(existing)
    samples, weights, start = cube.samples, cube.weights, init
    if len(samples) > ENOUGH_SAMPLES:  # the first of Sobol's points are as even as all of them
        few = slice(0, len(samples) // 4)
        some = None if weights is None else weights[few]
        result = tessellate(samples[few], n_all, density=some, locked=locked, init=init, effort="balanced", rng=rng)
        start, effort = result.generators[len(existing) :], "balanced"
    result = tessellate(samples, n_all, density=weights, locked=locked, init=start, effort=effort, rng=rng)
    return result.generators[len(existing) :]


def _latin(points: Floats, existing: Floats) -> Floats:
    inside = np.clip(points, 0, 1)
    if not len(existing):
        return latinize(inside)
    slices = Slices.even(points.shape[1], len(points) + len(existing))
    return slices.latinize(inside, existing, lambda places: np.ones(len(places), bool))
