"""Lloyd's method: move every generator to the center of mass of its cell, and repeat.

S. Lloyd, IEEE Trans. Information Theory 28 (1982), doi 10.1109/TIT.1982.1056489.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.iteration import iterate
from cvtimg.engine import _kernels
from cvtimg.engine.methods._iteration import Conditions, Iteration
from cvtimg.engine.points import Points, assign, cell_moments, energy
from cvtimg.engine.seeding import refill

#: Moves in a round of `lloyd_in_rounds`.
_MOVES = 4


def lloyd(points: Points, generators: NDArray[np.float64], conditions: Conditions) -> Iteration:
    """Iterate until the energy converges. It never rises, except by the rounding of distances to float32."""
    locked = np.arange(len(generators)) < conditions.n_locked
    labels: NDArray[np.int32]
    masses: NDArray[np.float64]
    sums: NDArray[np.float64]

    def measure() -> float:
        nonlocal labels, masses, sums
        labels = assign(points, generators)
        masses, sums = cell_moments(points, labels, len(generators))
        return energy(points.energy_about_origin, generators, masses, sums)

    def step() -> float:
        nonlocal generators
        free, empty = ~locked & (masses > 0), ~locked & (masses == 0)
        generators = np.divide(sums, masses[:, None], out=generators.copy(), where=free[:, None])
        if empty.any():
            generators = refill(points, generators, labels, free, empty)
        return measure()

    history = iterate(measure(), step, conditions.stopping, conditions.watch)
    return Iteration(generators, *history)


def lloyd_in_rounds(points: Points, generators: NDArray[np.float64], conditions: Conditions) -> Iteration:
    """Iterate as `lloyd` does, with no locked generators, checking only every few moves whether to stop."""
    # For so few points that a pass over them takes less time than the call that starts it.
    n_generators, n_dims = generators.shape
    moved = generators.copy()
    sums, single = np.empty((n_generators, n_dims + 1)), np.empty((n_generators, n_dims), np.float32)
    half_norms, labels = np.empty(n_generators, np.float32), np.empty(len(points.density), np.int32)
    energies: list[float] = []
    while True:
        some = np.empty(_MOVES + 1)
        _kernels.move_often(points.tiles, points.density, moved, sums, single, half_norms, labels, some)
        if not sums[:, -1].all():
            return lloyd(points, moved, conditions)  # which refills empty cells
        measured = np.maximum(points.energy_about_origin + some, 0.0).tolist()
        energies += measured[1:] if energies else measured
        if conditions.ended(energies):
            return Iteration(moved, energies, conditions.stopping.converged(energies))
