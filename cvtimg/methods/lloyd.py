"""Lloyd's method: move every generator to the center of mass of its cell, and again.

S. Lloyd, IEEE Trans. Information Theory 28 (1982), doi 10.1109/TIT.1982.1056489.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.methods._iteration import Iteration, Stopping
from cvtimg.points import Points, assign, cell_energies, cell_moments, energy
from cvtimg.seeding import divide


def lloyd(points: Points, generators: NDArray[np.float64], stopping: Stopping) -> Iteration:
    """Iterate until the energy rests. It never rises, but for the rounding of distances to float32."""
    energies: list[float] = []
    while True:
        labels = assign(points, generators)
        masses, sums = cell_moments(points, labels, len(generators))
        energies.append(energy(points, generators, masses, sums))
        converged = stopping.converged(energies)
        if converged or len(energies) > stopping.max_iterations:
            return Iteration(generators, energies, converged)
        empty = masses == 0
        means = np.divide(sums, masses[:, None], out=generators.copy(), where=~empty[:, None])
        generators = _refill(points, means, labels, empty) if empty.any() else means


def _refill(
    points: Points, generators: NDArray[np.float64], labels: NDArray[np.int32], empty: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Give empty cells half of the cells of greatest energy, where a generator lowers the energy most."""
    weighted = points.density > 0
    energies = cell_energies(points, generators, labels)
    worst = np.argsort(np.where(empty, -1, energies), kind="stable")[-min(empty.sum(), (~empty).sum()) :]
    members = [np.flatnonzero((labels == cell) & weighted).astype(np.int32) for cell in worst]
    halves = divide(points, members, int(empty.sum()))
    refilled = generators.copy()
    places = np.concatenate([worst, np.flatnonzero(empty)])[: len(halves)]
    refilled[places] = [half.mean for half in halves]
    return refilled
