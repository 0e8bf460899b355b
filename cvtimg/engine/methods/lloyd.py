"""Lloyd's method: move every generator to the center of mass of its cell, and repeat.

S. Lloyd, IEEE Trans. Information Theory 28 (1982), doi 10.1109/TIT.1982.1056489.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.iteration import iterate
from cvtimg._shared.threads import in_parts
from cvtimg.engine import _kernels
from cvtimg.engine.methods._iteration import Conditions, Ends, Iteration
from cvtimg.engine.points import Points, assign, cell_moments, distances_to_own, energy
from cvtimg.engine.seeding import refill

#: Moves of sets between two looks at whether they rest.
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


def lloyd_of_sets(points: Points, sets: NDArray[np.float64], conditions: Conditions) -> Ends:
    """Iterate from each of (n, K, D) sets of generators, side by side, until each rests; empty cells stay empty."""
    stopping = conditions.stopping
    ends, energies = sets.copy(), np.empty(len(sets))
    moving = np.arange(len(sets))
    for _ in range(-(-stopping.max_iterations // _MOVES)):
        moved = ends[moving]
        *_, before, last = _move_sets(points, moved, conditions.n_locked, _MOVES)[0].T
        ends[moving], energies[moving] = moved, last
        moving = moving[before - last > stopping.tolerance * before]
        if not moving.size:
            break
    return Ends(ends, energies)


def masses_and_distances(points: Points, sets: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the (n, K) masses of the cells of (n, K, D) sets, and (n, M) squared distances to the own generator."""
    _, masses, labels = _move_sets(points, sets, len(sets[0]), 0)
    apart = [distances_to_own(points, generators, own) for generators, own in zip(sets, labels, strict=True)]
    return masses, np.stack(apart)


def _move_sets(
    points: Points, sets: NDArray[np.float64], n_locked: int, n_moves: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32]]:
    """Move (n, K, D) sets of generators in place; return energies before each move and after all, masses, labels."""
    n_sets, n_generators, n_dims = sets.shape
    sums = np.empty((n_sets, n_generators, n_dims + 1))
    labels = np.empty((n_sets, len(points.density)), np.int32)
    energies = np.empty((n_sets, n_moves + 1))

    def move(start: int, stop: int) -> None:
        own = slice(start, stop)
        single, half_norms = np.empty((n_generators, n_dims), np.float32), np.empty(n_generators, np.float32)
        _kernels.move_often(
            points.tiles, points.density, n_locked, sets[own], sums[own], single, half_norms, labels[own], energies[own]
        )

    in_parts(move, n_sets, work=n_sets * (n_moves + 1) * points.tiles.size / 8 * n_generators)
    return np.maximum(points.energy_about_origin + energies, 0.0), sums[:, :, -1], labels
