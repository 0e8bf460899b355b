"""The energy curve of segments: of exactly what `segment` would compute, with averaging and the cost of edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.elbow.curves import EnergyCurve, energy_curve
from cvtimg.elbow.rules import Scale
from cvtimg.engine.points import assign, pack
from cvtimg.segmentation.prepared import Prepared

#: Curves start from an image blurred as for this many segments.
_SEGMENTS_AT_START = 4


def curve_of_segments(prepared: Prepared, n_max: int, rng: int | np.random.Generator) -> EnergyCurve:
    """Compute the energies of 1, 2, ... n_max segments from those of the cells that they start from.

    The curve never rises: where another segment would cost more, because of its edges, it stays empty, and the curve
    keeps the energy and the generators of one segment less.
    """
    inside, volume_power = prepared.values.inside, prepared.volume_power
    start = prepared.start(_SEGMENTS_AT_START)
    rows = (prepared.field if start is None else start)[inside]
    cells = energy_curve(rows, n_max, volume_power=volume_power, rng=rng)
    if start is None and prepared.average_after is None and not prepared.edge_weight:
        return cells
    points = pack(rows, np.ones(len(rows)))
    energies: list[float] = []
    generators: list[NDArray[np.float64]] = []
    for places in cells.generators:
        labels = np.zeros(inside.shape, np.int32)
        labels[inside] = assign(points, points.frame.inward(places))[: len(rows)] + 1
        energy, means = _settled(prepared, labels, len(places))
        if energies and energy > energies[-1]:
            energy, means = energies[-1], generators[-1]
        energies.append(energy)
        generators.append(means)
    return EnergyCurve(np.array(energies), tuple(generators), Scale(float(rows.size), None))


def _settled(prepared: Prepared, start: NDArray[np.int32], n_segments: int) -> tuple[float, NDArray[np.float64]]:
    """Return the energy of the segments in the end, and their means."""
    labels, end = prepared.settle(start, n_segments)
    if end is not None:
        return end.energies[-1], end.generators[end.masses[:, 0] > 0]
    own = labels[labels > 0] - 1
    rows = prepared.data[labels > 0].astype(np.float64)
    masses = np.bincount(own, minlength=n_segments).astype(np.float64)
    sums = np.stack([np.bincount(own, column, n_segments) for column in rows.T], axis=1)
    means: NDArray[np.float64] = np.divide(sums, masses[:, None], out=sums, where=masses[:, None] > 0)
    parts = np.bincount(own, ((rows - means[own]) ** 2).sum(axis=1), n_segments)
    return float((masses / masses.sum()) ** prepared.volume_power @ parts), means[masses > 0]
