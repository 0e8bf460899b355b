"""Lloyd's method: move every generator to the center of mass of its cell, and again.

S. Lloyd, IEEE Trans. Information Theory 28 (1982), doi 10.1109/TIT.1982.1056489.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.methods._iteration import Conditions, Iteration
from cvtimg.points import Points, assign, cell_energies, cell_moments, energy
from cvtimg.seeding import divide


def lloyd(points: Points, generators: NDArray[np.float64], conditions: Conditions) -> Iteration:
    """Iterate until the energy rests. It never rises, but for the rounding of distances to float32."""
    energies: list[float] = []
    locked = np.arange(len(generators)) < conditions.n_locked
    while True:
        labels = assign(points, generators)
        masses, sums = cell_moments(points, labels, len(generators))
        energies.append(energy(points, generators, masses, sums))
        if conditions.ended(energies):
            return Iteration(generators, energies, conditions.stopping.converged(energies))
        free = ~locked & (masses > 0)
        generators = np.divide(sums, masses[:, None], out=generators.copy(), where=free[:, None])
        empty = ~locked & (masses == 0)
        if empty.any():
            generators = _refill(points, generators, labels, free, empty)


def _refill(
    points: Points,
    generators: NDArray[np.float64],
    labels: NDArray[np.int32],
    free: NDArray[np.bool_],
    empty: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Give empty cells half of the free cells of greatest energy, where a generator lowers the energy most."""
    weighted = points.density > 0
    energies = cell_energies(points, generators, labels)
    n_divided = min(np.count_nonzero(empty), np.count_nonzero(free))
    worst = np.argsort(np.where(free, -energies, np.inf), kind="stable")[:n_divided]
    members = [np.flatnonzero((labels == cell) & weighted).astype(np.int32) for cell in worst]
    halves = divide(points, members, int(np.count_nonzero(empty)))
    refilled = generators.copy()
    places = np.concatenate([worst, np.flatnonzero(empty)])[: len(halves)]
    refilled[places] = np.reshape([half.mean for half in halves], (-1, points.n_dims))
    return refilled
