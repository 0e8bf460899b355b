"""Moments of cells over samples: for any number of dimensions, and the metric of any p-norm."""

from __future__ import annotations

import numpy as np

from cvtimg._shared.checks import check_in_range
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg._shared.types import Floats, Indices, Points
from cvtimg.engine.samples import WeightedSamples
from cvtimg.placement.moments import CellSums, Moments
from cvtimg.placement.regions import Box, Region


class SampleMoments:
    """Moments of the cells of points over weighted samples.

    Parameters
    ----------
    samples : WeightedSamples
    p : float
        Power of the p-norm. Energy is the sum of weight times squared norm; "centroids" are where half a step of the
        gradient divided by the mass leads, which for the Euclidean norm are centers of mass.
    region : Region, optional
        Where samples come from; distances wrap around in a periodic box.
    """

    def __init__(self, samples: WeightedSamples, p: float = 2, region: Region | None = None) -> None:
        self._rows = np.ascontiguousarray(samples.rows, np.float64)
        self._weights = samples.density
        self._p = p
        n_dims = self._rows.shape[1]
        self._region = Box([0] * n_dims, [1] * n_dims) if region is None else region
        plain = p == 2 or not (isinstance(region, Box) and any(region.periodic))
        check_in_range("metric", p, plain, "2 in a periodic box")

    def __call__(self, generators: Points, /) -> Moments:
        """Compute the moments of the cells of (K, D) generators."""
        labels = self.labels(generators)
        steps = self._region.shortest(self._rows - generators[labels])
        masses = sum_by_label(labels, self._weights, len(generators))
        if self._p == 2:
            pulls, squares = steps, (steps**2).sum(axis=1)
        else:
            lengths, slopes = norms(steps, self._p)
            pulls, squares = lengths[:, None] * slopes, lengths**2
        moves = per_mass(sum_by_label(labels, pulls, len(generators), self._weights), masses)
        return Moments(masses, generators + moves, float((self._weights * squares).sum()))

    def labels(self, generators: Points) -> Indices:
        """Find the generator (M,) nearest to each sample."""
        return self._region.nearest(generators, self._rows, p=self._p)[1]

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


def norms(steps: Points, p: float) -> tuple[Floats, Points]:
    """Compute the (N,) p-norms of (N, D) steps and their (N, D) gradients, where powers neither over- nor underflow."""
    tiny = np.finfo(np.float64).tiny
    largest = np.maximum(np.abs(steps).max(axis=1, keepdims=True), tiny)
    shares = np.abs(steps) / largest
    lengths = np.maximum(np.linalg.norm(shares, p, axis=1, keepdims=True), tiny)
    return (largest * lengths)[:, 0], np.sign(steps) * (shares / lengths) ** (p - 1)
