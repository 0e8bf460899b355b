"""Tessellations of values of which some are missing: a missing value is as far from one generator as from another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.cvt import tessellate

Floats = NDArray[np.float32]

#: Rounds, and the share of the pixels below which those that change cells are few enough to stop.
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
    """Lower the sum over all pixels and channels of weight times squared distance to the generator.

    In each round the engine tessellates complete values: what is missing, or weighs less, is drawn to the generator
    of the cell where the pixel was. Their energy is nowhere less than that of the masked values, and equal to it where
    the round began, so what lowers the one lowers the other. Without gaps the first round is all there is.

    Parameters
    ----------
    values : (H, W, D) array
        Finite.
    weights : (H, W, D) array
        >= 0. A pixel without any weight keeps its label.
    labels : (H, W) array
        Where to start: 1..n_generators.
    volume_power : float
        Each cell counts by its share of the pixels to this power.

    References
    ----------
    D. Hunter and K. Lange, The American Statistician 58 (2004), doi 10.1198/0003130042836, for energies that are
    lowered by way of others that lie above them.
    """
    rows, loads = values.reshape(-1, values.shape[2]), weights.reshape(-1, values.shape[2])
    full = loads.max(axis=0)
    share = np.divide(loads, full, out=np.zeros_like(loads), where=full > 0)
    complete = bool((share == 1).all())
    known = loads.any(axis=1)
    scale = np.sqrt(full, dtype=np.float64)
    current = labels.reshape(-1).copy()
    generators, masses = masked_means(rows, loads, current, np.zeros((n_generators, rows.shape[1])))
    energies: list[float] = []
    converged = False
    while not converged and len(energies) < _MAX_ROUNDS:
        own = generators.astype(np.float32)[current - 1]
        filled = rows if complete else own + share * (rows - own)
        energies.append(_energy(rows, loads, own, current, n_generators, volume_power))
        end = tessellate(filled[known] * scale, n_generators, init=generators * scale, volume_power=volume_power)
        n_moved = np.count_nonzero(end.labels + 1 != current[known])
        current[known] = end.labels + 1
        generators, masses = masked_means(rows, loads, current, generators)
        converged = complete or bool(n_moved <= _ALMOST_NONE * len(current))
    own = generators.astype(np.float32)[current - 1]
    energies.append(_energy(rows, loads, own, current, n_generators, volume_power))
    return MaskedCells(current.reshape(labels.shape), generators, masses, tuple(energies), converged)


def masked_means(
    rows: Floats, loads: Floats, labels: NDArray[np.int32], before: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(K, D) mean of each cell in each channel, as `before` where nothing is known of it, and (K, D) the weight."""
    masses, means = np.zeros_like(before), before.copy()
    for channel in range(rows.shape[1]):
        load = loads[:, channel].astype(np.float64)
        masses[:, channel] = np.bincount(labels - 1, load, minlength=len(before))
        sums = np.bincount(labels - 1, load * rows[:, channel], minlength=len(before))
        np.divide(sums, masses[:, channel], out=means[:, channel], where=masses[:, channel] > 0)
    return means, masses


def _energy(
    rows: Floats, loads: Floats, own: Floats, labels: NDArray[np.int32], n_cells: int, volume_power: float
) -> float:
    apart = np.einsum("nd,nd,nd->n", loads, rows - own, rows - own, dtype=np.float64)
    parts = np.bincount(labels - 1, apart, minlength=n_cells)
    sizes = np.bincount(labels - 1, loads.any(axis=1), minlength=n_cells)
    return float((sizes / max(sizes.sum(), 1)) ** volume_power @ parts)
