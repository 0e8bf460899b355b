"""Placement by points that are drawn: MacQueen's method and the two-parameter probabilistic family, in parallel.

L. Ju, Q. Du, M. Gunzburger, Parallel Computing 28 (2002) 1477-1500, doi 10.1016/S0167-8191(02)00151-5.

A move draws points in parts, each from a stream of its own, that any processes may work on: only generators go out,
and only a mass and a mean of each cell come back. Nothing but the seed decides the result.
"""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Executor
from functools import partial
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_at_least, check_count
from cvtimg._shared.sums import per_mass
from cvtimg.engine.methods import Probabilistic
from cvtimg.placement.densities import Density, DensityLike, Points, as_density
from cvtimg.placement.descent import Descent
from cvtimg.placement.metrics import LpGauge
from cvtimg.placement.moments import Moments
from cvtimg.placement.place import draw_start
from cvtimg.placement.polygons import as_region
from cvtimg.placement.regions import MOST_POINTS, Region
from cvtimg.placement.result import Placement
from cvtimg.placement.samples import SampleMoments

#: Parts of a move, for as many processes; they are fixed, so that no bit depends on processes.
_PARTS = 8
#: Points for each generator in a move, and in the measure at the end.
_DRAWS_PER_GENERATOR, _MEASURED_PER_GENERATOR = 64, 400
#: The method of MacQueen: one point in a move.
MACQUEEN = Probabilistic(draws=1, a1=1.0, a2=0.0, b1=0.0, b2=1.0)


def place_by_draws(
    region: Any,
    n_generators: int,
    *,
    density: DensityLike = None,
    rule: Probabilistic | None = None,
    n_moves: int = 50,
    executor: Executor | None = None,
    rng: int | np.random.Generator = 0,
) -> Placement:
    """Place generators by points that are drawn, in as many processes as an executor has.

    Parameters
    ----------
    region : Region, bool array, polygon coordinates, GeoJSON or shapely geometry
        What `cvtimg.placement.as_region` takes.
    n_generators : int
        Number of generators K.
    density : None, float, (H, W) array or callable
        What `cvtimg.placement.as_density` takes; for processes a function must be picklable.
    rule : cvtimg.engine.Probabilistic, optional
        How many points a move draws, and how far it goes; `MACQUEEN` for the method of MacQueen. By default 64 points
        for each generator.
    n_moves : int
        How many moves.
    executor : concurrent.futures.Executor, optional
        Where parts of each move are worked on: a ProcessPoolExecutor, or that of a Dask cluster,
        ``client.get_executor()``. By default this process.
    rng : int or numpy.random.Generator
        Seed: the result is the same in any number of processes.

    Returns
    -------
    Placement
        Its energies are estimates by the points of each move, which may rise. The last one, and the masses and
        centroids, are of points that are drawn anew.

    Notes
    -----
    `place_generators` ends lower in less time. This is for regions where only drawing is possible, and for densities
    that are slow to compute.

    Examples
    --------
    >>> from cvtimg.placement import place_by_draws
    >>> from cvtimg.placement import Box
    >>> sorted(place_by_draws(Box([0, 0], [2, 1]), 2).points.round(1).tolist())
    [[0.5, 0.5], [1.5, 0.5]]
    """
    where, weight = as_region(region), as_density(density)
    check_count("n_generators", n_generators, MOST_POINTS, "what memory holds")
    check_at_least("n_moves", n_moves, 1, "how often points are drawn")
    family = rule or Probabilistic(draws=_DRAWS_PER_GENERATOR * n_generators)
    draws = family.draws or _DRAWS_PER_GENERATOR * n_generators
    random = np.random.default_rng(rng)
    generators = draw_start(where, weight, n_generators, random)
    counts = np.ones(n_generators)
    energies = []
    for _ in range(n_moves):
        found = _draw(where, weight, generators, draws, random, executor)
        met = found.masses > 0
        j = counts[met, None]
        old, new = family.a1 * j + family.b1, family.a2 * j + family.b2
        generators[met] = (old * generators[met] + new * found.centroids[met]) / (j + 1)
        generators = where.project(generators)
        counts[met] += 1
        energies.append(found.energy)
    end = _draw(where, weight, generators, _MEASURED_PER_GENERATOR * n_generators, random, executor)
    return Placement.of(Descent(generators, end, (*energies, end.energy), converged=False), where)


def _draw(
    region: Region,
    density: Density,
    generators: Points,
    draws: int,
    rng: np.random.Generator,
    executor: Executor | None,
) -> Moments:
    """Draw points and find the moments of the cells by them."""
    sizes = [size for size in np.diff(np.linspace(0, draws, _PARTS + 1).astype(int)).tolist() if size]
    seeds = rng.integers(1 << 62, size=len(sizes)).tolist()
    work = partial(draw_part, region, density, generators)
    parts: Iterable[Moments] = map(work, sizes, seeds) if executor is None else executor.map(work, sizes, seeds)
    masses, sums, energy = np.zeros(len(generators)), np.zeros(generators.shape), 0.0
    for size, part in zip(sizes, parts, strict=True):
        masses += size / draws * part.masses
        sums += size / draws * part.masses[:, None] * (part.centroids - generators)
        energy += size / draws * part.energy
    return Moments(masses, generators + per_mass(sums, masses), energy)


def draw_part(region: Region, density: Density, generators: Points, n: int, seed: int) -> Moments:
    """Draw n points of a region and find the moments of the cells of generators by them: the part of a process."""
    return SampleMoments(region.sample(n, density=density, rng=seed), LpGauge(2), region)(generators)
