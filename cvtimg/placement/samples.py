"""Moments of cells over samples: for any number of dimensions, any metric, and generators that are no points.

A sample belongs to the figure, a segment or circle, that is nearest, by the distance to its foot, the nearest place of
the figure. What moves are the numbers that make a figure: the ends of a segment; the center and radius of a circle. The
gradient of the energy by these is that of the squared distance at the feet, for a foot moves along its figure for free.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_in_range, check_one_of, check_shape
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


class Figures(ABC):
    """A kind of generators."""

    __slots__ = ()

    @abstractmethod
    def start(self, points: Points, spacing: float, rng: np.random.Generator) -> Points:
        """Make figures (K, P) around (K, 2) points that are about `spacing` apart."""

    @abstractmethod
    def squared_distances(self, figures: Points, places: Points) -> Points:
        """Compute (M, K) squared distances of (M, 2) places."""

    @abstractmethod
    def pulls(self, figures: Points, places: Points) -> Points:
        """Compute minus half the gradients (M, P) of the squared distances of (M, 2) places, each to its own figure."""

    @abstractmethod
    def middles(self, figures: Points) -> Points:
        """Return the (K, 2) middles of figures."""

    def price(self, figures: Points) -> tuple[NDArray[np.float64], Points]:
        """Return what each figure costs for each unit of mass, (K,), and half the gradient of that, (K, P)."""
        return np.zeros(len(figures)), np.zeros_like(figures)

    def project(self, figures: Points, before: Points) -> Points:
        """Bring figures that have moved back to what they may be."""
        return figures


@dataclass(frozen=True, slots=True, eq=False)
class Segments(Figures):
    """Line segments, as rows (x1, y1, x2, y2).

    Free segments would grow without bound, so that their length is given or has a price.

    Attributes
    ----------
    length : float, (K,) array or None
        Length of all, or of each; those of length 0 are points.
    price_per_length : float or None
        Energy per unit of mass of the cell and of squared length.
    """

    length: float | NDArray[np.float64] | None = None
    price_per_length: float | None = None

    def __post_init__(self) -> None:
        check_one_of(length=self.length, price_per_length=self.price_per_length)
        for name in ("length", "price_per_length"):
            value = getattr(self, name)
            allowed = value is None or (np.isfinite(value).all() and np.min(value) >= 0)
            check_in_range(name, value, allowed, "finite and >= 0")

    def start(self, points: Points, spacing: float, rng: np.random.Generator) -> Points:
        """Make segments of any direction."""
        given = np.asarray(0.5 * spacing if self.length is None else self.length)
        check_shape("length", given.shape, given.shape in ((), (len(points),)), f"a number or ({len(points)},)")
        angles = rng.random(len(points)) * np.pi
        lengths = np.broadcast_to(given, len(points))
        half = 0.5 * lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return np.concatenate([points - half, points + half], axis=1)

    def squared_distances(self, figures: Points, places: Points) -> Points:
        """Compute (M, K) squared distances of (M, 2) places."""
        return (_from_feet(figures, places[:, None])[1] ** 2).sum(axis=2)

    def pulls(self, figures: Points, places: Points) -> Points:
        """Pull the ends by the share of each in the foot."""
        part, rest = _from_feet(figures, places)
        return np.concatenate([(1 - part) * rest, part * rest], axis=1)

    def middles(self, figures: Points) -> Points:
        """Return the (K, 2) middles."""
        return (figures[:, :2] + figures[:, 2:]) / 2

    def price(self, figures: Points) -> tuple[NDArray[np.float64], Points]:
        """Return the price of the squared lengths."""
        along = figures[:, 2:] - figures[:, :2]
        price = self.price_per_length or 0.0
        return price * (along**2).sum(axis=1), price * np.concatenate([-along, along], axis=1)

    def project(self, figures: Points, before: Points) -> Points:
        """Give each its length again, about its middle."""
        if self.length is None:
            return figures
        middles, along = self.middles(figures), figures[:, 2:] - figures[:, :2]
        old = before[:, 2:] - before[:, :2]
        lost = (along**2).sum(axis=1) == 0
        along[lost] = old[lost]
        size = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
        half = 0.5 * (np.broadcast_to(self.length, len(along)) / size)[:, None] * along
        return np.concatenate([middles - half, middles + half], axis=1)


@dataclass(frozen=True, slots=True)
class Circles(Figures):
    """Circles, as rows (x, y, radius)."""

    def start(self, points: Points, spacing: float, rng: np.random.Generator) -> Points:
        """Make circles that nearly touch."""
        return np.concatenate([points, np.full((len(points), 1), 0.3 * spacing)], axis=1)

    def squared_distances(self, figures: Points, places: Points) -> Points:
        """Compute (M, K) squared distances of (M, 2) places."""
        steps = places[:, None] - figures[:, :2]
        return (np.hypot(steps[..., 0], steps[..., 1]) - figures[:, 2]) ** 2

    def pulls(self, figures: Points, places: Points) -> Points:
        """Pull the center towards the place, and the radius to it."""
        steps = places - figures[:, :2]
        sizes = np.hypot(steps[:, 0], steps[:, 1])
        rest = (sizes - figures[:, 2])[:, None]
        return np.concatenate([rest * steps / np.maximum(sizes, 1e-300)[:, None], rest], axis=1)

    def middles(self, figures: Points) -> Points:
        """Return the (K, 2) centers."""
        return figures[:, :2].copy()

    def project(self, figures: Points, before: Points) -> Points:
        """Keep radii >= 0."""
        return np.concatenate([figures[:, :2], np.maximum(figures[:, 2:], 0)], axis=1)


class FigureMoments:
    """Moments of the cells of figures over weighted samples; "centroids" are figures, moved by half a gradient."""

    __slots__ = ("_kind", "_rows", "_weights")

    def __init__(self, samples: WeightedSamples, kind: Figures) -> None:
        self._rows = np.asarray(samples.rows, np.float64)
        self._weights = samples.density
        self._kind = kind

    def __call__(self, generators: Points, /) -> Moments:
        """Compute the moments of the cells of (K, P) figures."""
        labels, squares = self.labels(generators)
        n = len(generators)
        masses = sum_by_label(labels, self._weights, n)
        pulls = self._kind.pulls(generators[labels], self._rows)
        costs, slopes = self._kind.price(generators)
        moves = per_mass(sum_by_label(labels, pulls, n, self._weights), masses) - slopes
        energy = float((self._weights * squares).sum() + (masses * costs).sum())
        return Moments(masses, generators + moves, energy)

    def labels(self, generators: Points) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Find the figure (M,) nearest to each sample, its price counted, and the squared distance to it."""
        costs = self._kind.price(generators)[0]
        labels, squares = [], []
        for rows in np.array_split(self._rows, max(1, len(self._rows) * len(generators) // _AT_ONCE)):
            distances = self._kind.squared_distances(generators, rows)
            nearest = (distances + costs).argmin(axis=1)
            labels.append(nearest)
            squares.append(distances[np.arange(len(rows)), nearest])
        return np.concatenate(labels), np.concatenate(squares)


def _from_feet(segments: Points, places: Points) -> tuple[Points, Points]:
    """How far along segments the feet of places are, 0 to 1, the middle of one without length; the steps from them."""
    along, steps = segments[:, 2:] - segments[:, :2], places - segments[:, :2]
    squares = (along**2).sum(axis=1)
    part = np.where(squares > 0, (steps * along).sum(axis=-1) / np.where(squares > 0, squares, 1), 0.5)
    part = np.clip(part, 0, 1)[..., None]
    return part, steps - part * along
