"""Lloyd's method: move every generator to the center of mass of its cell, and repeat.

S. Lloyd, IEEE Trans. Information Theory 28 (1982), doi 10.1109/TIT.1982.1056489.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.iteration import iterate
from cvtimg._shared.threads import in_parts
from cvtimg.engine import _kernels
from cvtimg.engine.methods._iteration import Conditions, Ends, Iteration
from cvtimg.engine.points import Points, assign, cell_moments, energy
from cvtimg.engine.seeding import refill

#: Moves of sets between two looks at whether they rest.
_MOVES = 2


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
    ends, energies = np.empty_like(sets), np.empty(len(sets))
    moving, cells = np.arange(len(sets)), _SetsOfCells.none(points, sets)
    for _ in range(-(-stopping.max_iterations // _MOVES)):
        *_, before, last = cells.move(points, conditions.n_locked, _MOVES).T
        ends[moving], energies[moving] = cells.generators, last
        falling = before - last > stopping.tolerance * before
        if not falling.any():
            break
        moving, cells = moving[falling], _SetsOfCells(*(values[falling] for values in cells))
    return Ends(ends, energies)


def masses_and_distances(points: Points, sets: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the (n, K) masses of the cells of (n, K, D) sets, and (n, M) squared distances to the own generator."""
    cells = _SetsOfCells.none(points, sets)
    cells.move(points, 0, 1)
    distances = np.empty(cells.labels.shape)

    def measure(start: int, stop: int) -> None:
        for n in range(start, stop):
            _kernels.distances_to_own(points.tiles, sets[n], cells.labels[n], distances[n])

    in_parts(measure, len(sets), work=len(sets) * points.tiles.size)
    return cells.sums[:, :, -1], distances


class _SetsOfCells(NamedTuple):
    """Sets of generators (n, K, D), and the moments (n, K, D + 1) and labels (n, M) of their cells."""

    generators: NDArray[np.float64]
    sums: NDArray[np.float64]
    labels: NDArray[np.int32]

    @classmethod
    def none(cls, points: Points, sets: NDArray[np.float64]) -> _SetsOfCells:
        """Return sets whose cells have no points yet."""
        n_sets, n_generators, n_dims = sets.shape
        sums = np.zeros((n_sets, n_generators, n_dims + 1))
        return cls(sets.copy(), sums, np.full((n_sets, len(points.density)), -1, np.int32))

    def move(self, points: Points, n_locked: int, n_moves: int) -> NDArray[np.float64]:
        """Move generators and cells in place; return the (n, n_moves) energies."""
        n_sets, n_generators, n_dims = self.generators.shape
        energies = np.empty((n_sets, n_moves))
        lightest = points.density[points.density > 0].min()

        def move(start: int, stop: int) -> None:
            own = slice(start, stop)
            scratch = np.empty((n_generators, n_dims), np.float32), np.empty(n_generators, np.float32)
            moments = self.generators[own], self.sums[own], self.labels[own]
            _kernels.move_often(points.tiles, points.density, n_locked, lightest, *moments, *scratch, energies[own])

        in_parts(move, n_sets, work=n_sets * n_moves * points.tiles.size / 8 * n_generators)
        return np.maximum(points.energy_about_origin + energies, 0.0)
