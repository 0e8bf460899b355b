"""Moments of cells over samples: for any number of dimensions, any metric, and generators that are no points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_in_range
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg.engine.samples import WeightedSamples
from cvtimg.placement.densities import Points
from cvtimg.placement.metrics import Gauge, LpGauge
from cvtimg.placement.moments import Moments
from cvtimg.placement.regions import Box, Region

#: Nearest generators in the Euclidean metric, of which one is nearest in another for most samples.
_CANDIDATES = 12
#: Distances that are computed at a time.
_AT_ONCE = 1 << 22


class SampleMoments:
    """Moments of the cells of points over weighted samples.

    Parameters
    ----------
    samples : WeightedSamples
    gauge : Gauge
        The metric. Energy is the sum of weight times squared gauge; "centroids" are where half a step of the gradient
        divided by the mass leads, which for the Euclidean metric are centers of mass.
    region : Region, optional
        Where samples come from; distances wrap around in a periodic box.
    """

    __slots__ = ("_box", "_gauge", "_rows", "_weights")

    def __init__(self, samples: WeightedSamples, gauge: Gauge, region: Region | None = None) -> None:
        self._rows = np.ascontiguousarray(samples.rows, np.float64)
        self._weights = samples.density
        self._gauge = gauge
        self._box = region if isinstance(region, Box) and any(region.periodic) else None
        check_in_range("metric", gauge, self._box is None or gauge == LpGauge(2), "2 in a periodic box")

    def __call__(self, generators: Points, /) -> Moments:
        """Compute the moments of the cells of (K, D) generators."""
        labels = self.labels(generators)
        steps = self.wrapped(self._rows - generators[labels])
        masses = sum_by_label(labels, self._weights, len(generators))
        if self._gauge == LpGauge(2):
            pulls, squares = steps, (steps**2).sum(axis=1)
        else:
            lengths = self._gauge.lengths(steps)
            pulls, squares = lengths[:, None] * self._gauge.slopes(steps), lengths**2
        moves = per_mass(sum_by_label(labels, pulls, len(generators), self._weights), masses)
        return Moments(masses, generators + moves, float((self._weights * squares).sum()))

    def labels(self, generators: Points) -> NDArray[np.intp]:
        """Find the generator (M,) nearest to each sample."""
        from scipy.spatial import cKDTree

        if self._box is not None:
            low, sides = self._box.bounds[0], self._box.sides
            around = np.where(self._box.periodic, sides, 0)
            places, rows = self._box.project(generators) - low, self._box.project(self._rows) - low
            # A tree takes what is below the side, not the side itself.
            places, rows = (np.where(around > 0, at % np.where(around > 0, around, 1), at) for at in (places, rows))
            return cKDTree(places, boxsize=around).query(rows)[1]
        if isinstance(self._gauge, LpGauge):
            return cKDTree(generators).query(self._rows, p=self._gauge.p)[1]
        return self._nearest_by_gauge(generators, cKDTree(generators))

    def _nearest_by_gauge(self, generators: Points, tree: object) -> NDArray[np.intp]:
        """Compare the Euclidean neighbors, and all generators where a farther one may still be nearer by the gauge."""
        n = min(_CANDIDATES, len(generators))
        distances, near = (at.reshape(len(self._rows), n) for at in tree.query(self._rows, n))  # type: ignore[attr-defined]
        lengths = np.stack([self._gauge.lengths(self._rows - generators[near[:, i]]) for i in range(n)], axis=1)
        best = lengths.argmin(axis=1)
        rows = np.arange(len(best))
        labels = near[rows, best]
        least = self._gauge.range(self._rows.shape[1])[0]
        unsure = np.flatnonzero((least * distances[:, -1] < lengths[rows, best]) & (n < len(generators)))
        for part in np.array_split(unsure, -(-len(unsure) * len(generators) // _AT_ONCE)) if len(unsure) else ():
            steps = (self._rows[part, None] - generators).reshape(-1, generators.shape[1])
            labels[part] = self._gauge.lengths(steps).reshape(len(part), -1).argmin(axis=1)
        return labels

    def wrapped(self, steps: Points) -> Points:
        """Take (M, D) steps the short way around a periodic box."""
        if self._box is None:
            return steps
        sides = np.where(self._box.periodic, self._box.sides, np.inf)
        turns = np.divide(steps, sides, out=np.zeros_like(steps), where=np.isfinite(sides))
        return steps - np.where(np.isfinite(sides), np.rint(turns) * np.where(np.isfinite(sides), sides, 0), 0)
