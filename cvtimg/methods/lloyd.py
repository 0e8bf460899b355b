"""Lloyd's method: move every generator to the center of mass of its cell, and again.

S. Lloyd, IEEE Trans. Information Theory 28 (1982), doi 10.1109/TIT.1982.1056489.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.methods._iteration import Conditions, Iteration
from cvtimg.points import Points, assign, cell_moments, energy
from cvtimg.seeding import refill


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
            generators = refill(points, generators, labels, free, empty)
