"""Transfer: move single points to the cell where the energy is lowest, and update both means at once.

Cells may be weighted by their mass: E_p is the sum of (n_k / N)^p S_k, where S_k is the energy of cell k about its
mean, n_k its mass and N the total mass. Moving the means with the weights frozen, as Lloyd's method would, can raise
E_p; single transfers, whose effect on E_p is known exactly, never do. With p = 0 this is Hartigan's method
(J. Hartigan, M. Wong, Applied Statistics 28, 1979, doi 10.2307/2346830), whose fixed points are fixed points of
Lloyd's method too. It is slower than Lloyd's method: each point in turn is compared with every generator.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine import _kernels
from cvtimg.engine.methods._iteration import Conditions, Iteration
from cvtimg.engine.points import Points, assign, cell_energies, cell_moments
from cvtimg.engine.seeding import refill


def transfer(points: Points, generators: NDArray[np.float64], conditions: Conditions) -> Iteration:
    """Sweep over the points until transfers lower the energy by next to nothing. No cell loses its last point."""
    locked = np.arange(len(generators)) < conditions.n_locked
    labels = _labels_of_full_cells(points, generators, locked)
    energies: list[float] = []
    n_moved = -1
    while True:
        masses, sums = cell_moments(points, labels, len(generators))
        free = ~locked & (masses > 0)
        means = np.divide(sums, masses[:, None], out=generators.copy(), where=free[:, None])
        parts = cell_energies(points, means, labels)
        energies.append(weighted_energy(masses, parts, conditions.volume_power))
        if conditions.ended(energies) or n_moved == 0:
            return Iteration(means, energies, n_moved == 0 or conditions.stopping.converged(energies), labels)
        n_moved = _kernels.transfer(
            points.tiles,
            points.density,
            labels,
            masses,
            np.ascontiguousarray(means.T),
            parts,
            np.empty(len(parts)),
            conditions.n_locked,
            conditions.volume_power,
            masses.sum(),
        )


def weighted_energy(masses: NDArray[np.float64], energies: NDArray[np.float64], volume_power: float) -> float:
    """Sum the energies of the cells, each times its fraction of the mass to the power `volume_power`."""
    # Not by BLAS, whose bits depend on the processor.
    return float(np.einsum("k,k->", (masses / masses.sum()) ** volume_power, energies))


def _labels_of_full_cells(
    points: Points, generators: NDArray[np.float64], locked: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Label points with their nearest generators, after moving the generators of empty cells."""
    labels = assign(points, generators)
    masses, _ = cell_moments(points, labels, len(generators))
    empty = ~locked & (masses == 0)
    if not empty.any():
        return labels
    return assign(points, refill(points, generators, labels, ~locked & ~empty, empty))
