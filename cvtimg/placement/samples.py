"""Moments of cells over samples: for any number of dimensions, and any metric."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_in_range
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg.engine.samples import WeightedSamples
from cvtimg.placement.densities import Points
from cvtimg.placement.metrics import Gauge, LpGauge
from cvtimg.placement.moments import CellSums, Moments
from cvtimg.placement.regions import Box, Region

#: Nearest generators in the Euclidean metric, of which one is nearest in another for most samples.
_CANDIDATES = 12
#: Distances that are computed at a time.
_AT_ONCE = 1 << 20


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

    def __init__(self, samples: WeightedSamples, gauge: Gauge, region: Region | None = None) -> None:
        self._rows = np.ascontiguousarray(samples.rows, np.float64)
        self._weights = samples.density
        self._gauge = gauge
        n_dims = self._rows.shape[1]
        self._region = Box([0] * n_dims, [1] * n_dims) if region is None else region
        plain = gauge == LpGauge(2) or not (isinstance(region, Box) and any(region.periodic))
        check_in_range("metric", gauge, plain, "2 in a periodic box")

    def __call__(self, generators: Points, /) -> Moments:
        """Compute the moments of the cells of (K, D) generators."""
        labels = self.labels(generators)
        steps = self._region.shortest(self._rows - generators[labels])
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
        if isinstance(self._gauge, LpGauge):
            return self._region.nearest(generators, self._rows, p=self._gauge.p)[1]
        return self._nearest_by_gauge(generators)

    def cells(self, points: Points) -> CellSums:
        """Sum over the cells of (K, D) points, by the Euclidean metric."""
        labels, (n_points, n_dims) = self.labels(points), points.shape
        steps = self._region.shortest(self._rows - points[labels])
        reaches = np.zeros(n_points)
        np.maximum.at(reaches, labels, np.linalg.norm(steps, axis=1))
        products = np.einsum("m,md,me->mde", self._weights, steps, steps).reshape(-1, n_dims**2)
        return CellSums(
            sum_by_label(labels, self._weights, n_points),
            sum_by_label(labels, steps, n_points, self._weights),
            sum_by_label(labels, products, n_points).reshape(-1, n_dims, n_dims),
            reaches,
        )

    def _nearest_by_gauge(self, generators: Points) -> NDArray[np.intp]:
        """Compare the Euclidean neighbors, and all generators where a farther one may still be nearer by the gauge."""
        n = min(_CANDIDATES, len(generators))
        found = self._region.nearest(generators, self._rows, n)
        distances, near = (at.reshape(len(self._rows), n) for at in found)
        lengths = np.stack([self._gauge.lengths(self._rows - generators[near[:, i]]) for i in range(n)], axis=1)
        best = lengths.argmin(axis=1)
        rows = np.arange(len(best))
        labels = near[rows, best]
        least = self._gauge.least(self._rows.shape[1])
        unsure = np.flatnonzero((least * distances[:, -1] < lengths[rows, best]) & (n < len(generators)))
        for part in np.array_split(unsure, -(-len(unsure) * len(generators) // _AT_ONCE)) if len(unsure) else ():
            steps = (self._rows[part, None] - generators).reshape(-1, generators.shape[1])
            labels[part] = self._gauge.lengths(steps).reshape(len(part), -1).argmin(axis=1)
        return labels
