"""Tessellations of samples with missing values: a missing value is equally far from all generators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.points import assign, pack

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class MaskedCells:
    """Cells of pixels: labels (H, W) from 1, generators and masses (K, D), and the energy before each round."""

    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    masses: NDArray[np.float64]
    energies: tuple[float, ...]
    converged: bool


def masked_cells(
    values: Floats, weights: Floats, labels: NDArray[np.int32], n_generators: int, *, most_rounds: int = 100
) -> MaskedCells:
    """Lower the sum over all pixels and channels of weight times squared distance to the generator."""
    # Values (H, W, D) are finite, best with a mean near 0, and weights (H, W, D) >= 0; a pixel without any weight keeps
    # its label. Labels are in 1..n_generators. Rounds end when almost no pixel changes its cell.
    rows, loads = values.reshape(-1, values.shape[2]), weights.reshape(-1, values.shape[2])
    known: NDArray[np.bool_] = np.asarray(loads.any(axis=1))
    if not known.any():
        return MaskedCells(
            labels, *masked_means(rows, loads, labels.ravel(), np.zeros((n_generators, rows.shape[1]))), (0.0,), True
        )
    # Up to a term without the generator, weight times squared distance is minus twice the product of a pixel, as
    # (weight, weight times value), and a generator, as (minus half its square, itself). The kernel of the engine can
    # therefore find the nearest.
    points = pack(
        np.concatenate([loads, loads * rows], axis=1)[known], np.ones(known.sum()), center=np.zeros(2 * rows.shape[1])
    )
    current = labels.reshape(-1).copy()
    generators, masses = masked_means(rows, loads, current, np.zeros((n_generators, rows.shape[1])))
    energies = [_energy(rows, loads, generators, current)]
    converged = False
    while not converged and len(energies) <= most_rounds:
        changed = current.copy()
        places = np.concatenate([-(generators**2) / 2, generators], axis=1)
        changed[known] = assign(points, places, offsets=np.zeros(len(places)))[: points.n_points] + 1
        converged = bool(np.count_nonzero(changed != current) <= 1e-4 * len(current))
        means, behind = masked_means(rows, loads, changed, generators)
        energy = _energy(rows, loads, means, changed)
        if energy > energies[-1]:  # by rounding: pixels would move to and fro
            converged = True
            break
        current, generators, masses = changed, means, behind
        energies.append(energy)
    return MaskedCells(current.reshape(labels.shape), generators, masses, tuple(energies), converged)


def masked_means(
    rows: Floats, loads: Floats, labels: NDArray[np.int32], before: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(K, D) mean of each cell in each channel, `before` where nothing is known of it, and (K, D) the weight."""
    masses, means = np.zeros_like(before), before.copy()
    for channel in range(rows.shape[1]):
        load = loads[:, channel].astype(np.float64)
        masses[:, channel] = np.bincount(labels - 1, load, minlength=len(before))
        sums = np.bincount(labels - 1, load * rows[:, channel], minlength=len(before))
        np.divide(sums, masses[:, channel], out=means[:, channel], where=masses[:, channel] > 0)
    return means, masses


def _energy(rows: Floats, loads: Floats, generators: NDArray[np.float64], labels: NDArray[np.int32]) -> float:
    apart = rows - generators.astype(np.float32)[labels - 1]
    return float(np.einsum("nd,nd,nd->", loads, apart, apart, dtype=np.float64))
