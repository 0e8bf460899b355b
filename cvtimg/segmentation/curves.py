"""The energy curve of segments: of what `segment` will run, averaging and edge weight too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.elbow.curves import EnergyCurve, energy_curve
from cvtimg.elbow.rules import Scale
from cvtimg.engine.points import assign, pack
from cvtimg.segmentation.averaging import Averaging, average_segments
from cvtimg.segmentation.edge_weight import descend


def curve_of_segments(
    data: NDArray[np.float32],
    start: NDArray[np.float32],
    inside: NDArray[np.bool_],
    n_max: int,
    *,
    average: Averaging | None = None,
    edge_weight: float = 0,
    edge_radius: int = 3,
    volume_power: float = 0,
    rng: int | np.random.Generator = 0,
) -> EnergyCurve:
    """Compute the energies of 1, 2, .. n_max segments from those of the cells that they start from.

    Parameters
    ----------
    data : (H, W, D) float32 array
        What is segmented.
    start : (H, W, D) float32 array
        The cells of which pixels start from: the same, or averaged where that is noisy.
    inside : (H, W) bool array
        The mask.
    n_max : int
        The greatest number.
    average, edge_weight, edge_radius, volume_power, rng
        As in `segment`; averaging "before" has been done.

    Returns
    -------
    EnergyCurve
        Never rising: where more segments would cost more, for their edges, one stays without pixels and the energy is
        that of one less, whose generators then stand again.
    """
    cells = energy_curve(start[inside], n_max, volume_power=volume_power, rng=rng)
    if not edge_weight and not average and start is data:
        return cells
    rows = start[inside]
    points = pack(rows, np.ones(len(rows)))
    energies: list[float] = []
    generators: list[NDArray[np.float64]] = []
    for places in cells.generators:
        labels = np.zeros(inside.shape, np.int32)
        labels[inside] = assign(points, points.frame.inward(places))[: len(rows)] + 1
        if average and average.when == "after":
            labels = average_segments(data, labels, len(places), average)
        energy, means = _settled(data, labels, len(places), edge_weight, edge_radius, volume_power)
        if energies and energy > energies[-1]:
            energy, means = energies[-1], generators[-1]
        energies.append(energy)
        generators.append(means)
    return EnergyCurve(np.array(energies), tuple(generators), Scale(float(rows.size), None))


def _settled(
    data: NDArray[np.float32],
    labels: NDArray[np.int32],
    n_segments: int,
    edge_weight: float,
    edge_radius: int,
    volume_power: float,
) -> tuple[float, NDArray[np.float64]]:
    """Return the energy of segments, after the descent if edges cost, and their means."""
    if edge_weight:
        end = descend(data, labels, n_segments, edge_weight=edge_weight, radius=edge_radius, volume_power=volume_power)
        return end.energies[-1], end.generators[end.masses[:, 0] > 0]
    own = labels[labels > 0] - 1
    rows = data[labels > 0].astype(np.float64)
    masses = np.bincount(own, minlength=n_segments).astype(np.float64)
    sums = np.stack([np.bincount(own, column, n_segments) for column in rows.T], axis=1)
    means: NDArray[np.float64] = np.divide(sums, masses[:, None], out=sums, where=masses[:, None] > 0)
    parts = np.bincount(own, ((rows - means[own]) ** 2).sum(axis=1), n_segments)
    return float((masses / masses.sum()) ** volume_power @ parts), means[masses > 0]
