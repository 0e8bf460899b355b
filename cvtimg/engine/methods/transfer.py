"""Transfer: move single points to the cell where the energy is lowest, and update both means at once.

Cells may be weighted by their mass: E_p is the sum of (n_k / N)^p S_k, where S_k is the energy of cell k about its
mean, n_k its mass and N the total mass. Moving the means with the weights frozen, as Lloyd's method would, can raise
E_p; single transfers, whose effect on E_p is known exactly, never do. With p = 0 this is Hartigan's method
(J. Hartigan, M. Wong, Applied Statistics 28, 1979, doi 10.2307/2346830), whose fixed points are fixed points of
Lloyd's method too. It is slower than Lloyd's method: each point in turn is compared with every generator.
"""

import numpy as np

import cvtimg.engine._kernels as _kernels
from cvtimg._shared.iteration import Stopping, iterate
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Floats, Ints
from cvtimg.engine.methods._iteration import Conditions, Ends, Iteration
from cvtimg.engine.methods.lloyd import descend_sets
from cvtimg.engine.points import Points, assign, cell_energies, cell_moments
from cvtimg.engine.seeding import refill


def transfer(points: Points, generators: Floats, conditions: Conditions) -> Iteration:
    """Sweep over the points until transfers lower the energy by next to nothing. No cell loses its last point."""
    locked = np.arange(len(generators)) < conditions.n_locked
    labels = assign(points, generators)
    start = cell_moments(points, labels, len(generators))[0]
    labels = assign(points, refill(points, generators, labels, start, conditions.n_locked))
    masses: Floats
    means: Floats
    parts: Floats

    def measure() -> float:
        nonlocal masses, means, parts
        masses, sums = cell_moments(points, labels, len(generators))
        free = ~locked & (masses > 0)
        means = np.divide(sums, masses[:, None], out=generators.copy(), where=free[:, None])
        parts = cell_energies(points, means, labels)
        return weighted_energy(masses, parts, conditions.volume_power)

    def step() -> float | None:
        state = labels[None], masses[None], means[None], parts[None]
        return measure() if _sweep(points, *state, conditions.until(Stopping.after(1))) else None

    history = iterate(measure(), step, conditions.stopping, conditions.watch)
    return Iteration(means, *history, labels)


def transfer_of_sets(points: Points, sets: Floats, conditions: Conditions) -> Ends:
    """Sweep over the points from each of (n, K, D) sets of generators, until each rests; empty cells may fill."""
    # Lloyd's method does most of the way in less time, but cells that are weighted it would take astray.
    power = conditions.volume_power
    stopping = Stopping.after(0) if power else conditions.stopping
    means, moments, labels = descend_sets(points, sets, stopping, conditions.n_locked)
    masses, sums = moments[:, :, -1].copy(), moments[:, :, :-1]
    free = (masses > 0) & (np.arange(masses.shape[1]) >= conditions.n_locked)
    np.divide(sums, masses[:, :, None], out=means, where=free[:, :, None])
    if power or points.exact:
        parts = np.stack([cell_energies(points, *of_set) for of_set in zip(means, labels, strict=True)])
    else:  # transfers change the sum alone, and go by nothing else
        parts = np.zeros(masses.shape)
        norms = masses[:, :, None] * means
        parts[:, 0] = points.energy_about_origin + np.einsum("nkd,nkd->n", means, norms - 2 * sums)
    _sweep(points, labels, masses, means, parts, conditions)
    return Ends(means, _weighted(masses / masses[0].sum(), parts, power))


def _sweep(points: Points, labels: Ints, masses: Floats, means: Floats, parts: Floats, conditions: Conditions) -> int:
    """Transfer points between the cells of n sets, in place; return how many moved last."""
    (n_sets, n_cells, n_dims), stopping = means.shape, conditions.stopping
    rule = conditions.n_locked, conditions.volume_power, masses[0].sum(), stopping.tolerance, stopping.max_iterations
    n_moved: dict[int, int] = {}

    def sweep(start: int, stop: int) -> None:
        scratch = np.empty((n_cells, n_dims), points.tiles.dtype), np.empty((2, n_cells), points.tiles.dtype)
        state = (array[start:stop] for array in (labels, masses, means, parts))
        n_moved[stop] = _kernels.transfer(points.tiles, points.density, *state, *scratch, *rule)

    in_parts(sweep, n_sets, work=means.size * points.tiles.size / n_dims)
    return n_moved[n_sets]


def weighted_energy(masses: Floats, energies: Floats, volume_power: float) -> float:
    """Sum the energies of the cells, each times its fraction of the mass to the power `volume_power`."""
    return float(_weighted(masses / masses.sum(), energies, volume_power))


def _weighted(shares: Floats, energies: Floats, power: float) -> Floats:
    # Not by BLAS, whose bits depend on the processor.
    return np.asarray(np.einsum("...k,...k->...", shares**power, energies))
