"""Tessellations of samples with missing values: a missing value is equally far from all generators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.points import assign, pack
from cvtimg.engine.tessellation import tessellate
from cvtimg.segmentation.averaging import Averaging, average_segments

Floats = NDArray[np.float32]
#: Takes generators and the (N,) labels of all pixels; returns new labels of the known ones.
_Move = Callable[[NDArray[np.float64], NDArray[np.int32]], NDArray[np.int32]]

#: Largest number of rounds, and the share of pixels changing cells below which they stop.
_MAX_ROUNDS = 100
_ALMOST_NONE = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class MaskedCells:
    """Cells of pixels: labels (H, W) from 1, generators and masses (K, D), and the energy before each round."""

    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    masses: NDArray[np.float64]
    energies: tuple[float, ...]
    converged: bool


def masked_cells(
    values: Floats, weights: Floats, labels: NDArray[np.int32], n_generators: int, *, volume_power: float = 0
) -> MaskedCells:
    """Lower the sum over all pixels and channels of weight times squared distance to the generator."""
    # Values (H, W, D) are finite, best with a mean near 0, and weights (H, W, D) >= 0; a pixel without any weight keeps
    # its label. Labels are in 1..n_generators. Cells count by their share of the pixels to the volume power.
    rows, loads = values.reshape(-1, values.shape[2]), weights.reshape(-1, values.shape[2])
    known: NDArray[np.bool_] = np.asarray(loads.any(axis=1))
    if not known.any():
        return MaskedCells(
            labels, *masked_means(rows, loads, labels.ravel(), np.zeros((n_generators, rows.shape[1]))), (0.0,), True
        )
    move = _engine(rows, loads, known, volume_power) if volume_power else _nearest(rows, loads, known)
    current = labels.reshape(-1).copy()
    generators, masses = masked_means(rows, loads, current, np.zeros((n_generators, rows.shape[1])))
    energies = [_energy(rows, loads, generators, current, volume_power)]
    converged = False
    while not converged and len(energies) <= _MAX_ROUNDS:
        changed = current.copy()
        changed[known] = move(generators, current)
        converged = bool(np.count_nonzero(changed != current) <= _ALMOST_NONE * len(current))
        means, behind = masked_means(rows, loads, changed, generators)
        energy = _energy(rows, loads, means, changed, volume_power)
        if energy > energies[-1]:  # by rounding: pixels would move to and fro
            converged = True
            break
        current, generators, masses = changed, means, behind
        energies.append(energy)
    return MaskedCells(current.reshape(labels.shape), generators, masses, tuple(energies), converged)


def _nearest(rows: Floats, loads: Floats, known: NDArray[np.bool_]) -> _Move:
    """Move each pixel to the generator nearest to its known values: Lloyd's step."""
    # Up to a term without the generator, weight times squared distance is minus twice the product of a pixel, as
    # (weight, weight times value), and a generator, as (minus half its square, itself). The kernel of the engine can
    # therefore find the nearest.
    points = pack(
        np.concatenate([loads, loads * rows], axis=1)[known], np.ones(known.sum()), center=np.zeros(2 * rows.shape[1])
    )

    def move(generators: NDArray[np.float64], labels: NDArray[np.int32]) -> NDArray[np.int32]:
        places = np.concatenate([-(generators**2) / 2, generators], axis=1)
        return assign(points, places, offsets=np.zeros(len(places)))[: points.n_points] + 1

    return move


def _engine(rows: Floats, loads: Floats, known: NDArray[np.bool_], volume_power: float) -> _Move:
    """Let the engine tessellate complete values: those that are missing or uncertain are drawn to their generator."""
    # The energy of the completed values is nowhere below that of the masked ones and equal to it at the start of a
    # round, so lowering one lowers the other: D. Hunter and K. Lange, The American Statistician 58 (2004), doi
    # 10.1198/0003130042836.
    full = loads.max(axis=0)
    share = np.divide(loads, full, out=np.zeros_like(loads), where=full > 0)[known]
    scale = np.sqrt(full, dtype=np.float64)

    def move(generators: NDArray[np.float64], labels: NDArray[np.int32]) -> NDArray[np.int32]:
        own = generators.astype(np.float32)[labels[known] - 1]
        filled = own + share * (rows[known] - own)
        init = generators * scale
        return tessellate(filled * scale, len(init), init=init, volume_power=volume_power).labels + 1

    return move


def average_masked(
    values: Floats, weights: Floats, labels: NDArray[np.int32], n_generators: int, averaging: Averaging
) -> MaskedCells:
    """Average segments and relabel pixels in turn, with missing values taken from the generators."""
    rows, loads = values.reshape(labels.size, -1), weights.reshape(labels.size, -1)
    start, _ = masked_means(rows, loads, labels.ravel(), np.zeros((n_generators, rows.shape[1])))
    complete = np.where(weights > 0, values, start.astype(np.float32)[labels - 1]) * np.sqrt(loads.max(axis=0))
    ends = average_segments(complete, labels, n_generators, averaging)
    generators, masses = masked_means(rows, loads, ends.ravel(), start)
    return MaskedCells(ends, generators, masses, (_energy(rows, loads, generators, ends.ravel(), 0),), True)


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


def _energy(
    rows: Floats, loads: Floats, generators: NDArray[np.float64], labels: NDArray[np.int32], volume_power: float
) -> float:
    apart = rows - generators.astype(np.float32)[labels - 1]
    losses = np.einsum("nd,nd,nd->n", loads, apart, apart, dtype=np.float64)
    parts = np.bincount(labels - 1, losses, minlength=len(generators))
    sizes = np.bincount(labels - 1, loads.any(axis=1), minlength=len(generators))
    return float((sizes / max(sizes.sum(), 1)) ** volume_power @ parts)
