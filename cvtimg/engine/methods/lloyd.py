"""Lloyd's method: move every generator to the center of mass of its cell, and repeat.

S. Lloyd, IEEE Trans. Information Theory 28 (1982), doi 10.1109/TIT.1982.1056489.
"""

import numpy as np

import cvtimg.engine._kernels as _kernels
from cvtimg._shared.iteration import Stopping, iterate
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Floats, Ints
from cvtimg.engine.methods._iteration import Conditions, Iteration
from cvtimg.engine.points import Points, assign, cell_moments, energy
from cvtimg.engine.seeding import refill


def lloyd(points: Points, generators: Floats, conditions: Conditions) -> Iteration:
    """Iterate until the energy converges. It never rises, except by the rounding of distances to float32."""
    n_locked = conditions.n_locked
    labels: Ints
    masses: Floats
    sums: Floats

    def measure() -> float:
        nonlocal labels, masses, sums
        labels = assign(points, generators)
        masses, sums = cell_moments(points, labels, len(generators))
        return energy(points, generators, labels, masses, sums)

    def step() -> float:
        nonlocal generators
        moves = (masses > 0) & (np.arange(len(masses)) >= n_locked)
        generators = np.divide(sums, masses[:, None], out=generators.copy(), where=moves[:, None])
        generators = refill(points, generators, labels, masses, n_locked)
        return measure()

    history = iterate(measure(), step, conditions.stopping, conditions.watch)
    return Iteration(generators, *history, labels)


def descend_sets(points: Points, sets: Floats, stopping: Stopping, n_locked: int = 0) -> tuple[Floats, Floats, Ints]:
    """Move (n, K, D) generators until they rest; also return moments (n, K, D + 1) and labels (n, M) of their cells.

    With no iterations, only the cells are found.
    """
    n_sets, n_generators, n_dims = sets.shape
    moving, sums = sets.copy(), np.zeros((n_sets, n_generators, n_dims + 1))
    labels, energies = np.full((n_sets, len(points.density)), -1, np.int32), np.zeros(n_sets)
    lightest = points.density[points.density > 0].min()
    rule = points.energy_about_origin, n_locked, lightest, stopping.tolerance, stopping.max_iterations

    def descend(start: int, stop: int) -> None:
        scratch = np.empty((n_generators, n_dims), points.tiles.dtype), np.empty(n_generators, points.tiles.dtype)
        moments = moving[start:stop], sums[start:stop], labels[start:stop]
        _kernels.descend_sets(points.tiles, points.density, *rule, *moments, *scratch, energies[start:stop])

    in_parts(descend, n_sets, work=n_sets * points.tiles.size * n_generators)
    return moving, sums, labels
