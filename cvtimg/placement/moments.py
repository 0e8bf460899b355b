"""Moments of Voronoi cells: exact over the pixels of an image; over samples, in any space and by any p-norm.

A cell meets the middle line of a row of pixels in one interval, whose ends are found exactly; the density is constant
over each pixel. A pass costs as the boundaries of all cells are long, in pixels, and no triangulation is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

import cvtimg.placement._placement as _placement
from cvtimg._shared.checks import check_in_range, check_picture_density, check_places
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Floats, Floats32, Indices, Ints, Points
from cvtimg.engine.samples import WeightedSamples
from cvtimg.placement.regions import Box, Region

#: Generators in a bucket on average, and the side of a bucket in pixels: larger ones hold more sums of rows in memory,
#: smaller ones have too little to do.
_IN_A_BUCKET, _SIDES = 3.0, (4, 128)
#: Parts of a pass, each with sums of its own. They are fixed, so that no bit depends on threads.
_PARTS = 16


@dataclass(frozen=True, slots=True, eq=False)
class Moments(ReadOnly):
    """Moments of the cells of K generators.

    Attributes
    ----------
    masses : (K,) float64 array
        Integral of the density over each cell.
    centroids : (K, D) float64 array
        Center of mass of each cell; the generator itself where the cell has no mass.
    energy : float
        Integral of the density times the squared distance to the own generator.
    """

    masses: Floats
    centroids: Floats
    energy: float

    def _claims(self) -> Claims:
        yield "masses are not negative", self.masses >= 0
        yield "the energy is not negative", self.energy >= 0


@dataclass(frozen=True, slots=True, eq=False)
class CellSums:
    """Integrals over the Voronoi cells of K points z."""

    volumes: Floats  # (K,)
    firsts: Floats  # (K, D): of x - z
    seconds: Floats  # (K, D, D): of (x - z)(x - z)^T
    reaches: Floats  # (K,): greatest distance from z to a place of its cell

    @property
    def energy(self) -> float:
        """Integral of the squared distance to the nearest point."""
        return float(np.einsum("kdd->", self.seconds))

    def moments(self, points: Floats, density: float = 1.0) -> Moments:
        """Return the moments of the cells of (K, D) points for a density that is the same everywhere."""
        centroids = points + per_mass(self.firsts, self.volumes)
        return Moments(density * self.volumes, centroids, density * self.energy)


class CellMoments(Protocol):
    """What every descent asks for: the moments of the cells of any (K, D) generators."""

    def __call__(self, generators: Floats, /) -> Moments:
        """Compute the moments."""
        ...


class PixelMoments:
    """Moments of cells over one image, for any number of generators.

    Parameters
    ----------
    density : (H, W) array
        Mass of each pixel, finite, >= 0 and not all 0. It is kept as float32.
    scale : float
        Pixels per unit of length, in which generators, centroids and energy are counted: 2 for an image that was
        enlarged to double size, if places are counted in its original pixels.

    Attributes
    ----------
    density : (H, W) float32 array
    scale : float
    mass : float
        Sum of the density.

    Notes
    -----
    Cells are cut exactly along the middle line of each row of pixels. Where a dot has few pixels, enlarge the image:
    with 20 pixels in each cell centroids are right to 1 or 2 percent of the distance between generators.

    Examples
    --------
    >>> from cvtimg.placement import PixelMoments
    >>> moments = PixelMoments([[1, 1, 1, 3]])([[1, 0.5], [3, 0.5]])
    >>> moments.masses.tolist(), moments.centroids.tolist()
    ([2.0, 4.0], [[1.0, 0.5], [3.25, 0.5]])
    """

    __slots__ = ("_center", "_spread", "density", "mass", "scale")

    def __init__(self, density: ArrayLike, scale: float = 1.0) -> None:
        self.density: Floats32 = np.ascontiguousarray(check_picture_density("density", density))
        self.scale = scale
        height, width = self.density.shape
        rows = self.density.sum(axis=1, dtype=np.float64)
        columns = self.density.sum(axis=0, dtype=np.float64)
        x, y = np.arange(width) + 0.5, np.arange(height) + 0.5
        self.mass: float = float(rows.sum())
        # Squared distances are counted from the center of mass: a sum about a corner would lose digits.
        center = np.array([(columns * x).sum(), (rows * y).sum()]) / self.mass
        # Over one pixel x varies by 1/12, and so does y.
        spread = (columns * (x - center[0]) ** 2).sum() + (rows * (y - center[1]) ** 2).sum() + self.mass / 6
        self._center: Floats = center / scale
        self._spread = float(spread) / scale**2

    def __call__(self, generators: ArrayLike, /) -> Moments:
        """Compute the moments of the cells of (K, 2) generators (x, y)."""
        generators = check_places("points", generators, 2)
        buckets = _sorted(self.density.shape, generators * self.scale)
        n, (height, width) = len(generators), self.density.shape
        n_parts = min(_PARTS, buckets.rows)
        bands = np.arange(n_parts + 1, dtype=np.int32) * buckets.rows // n_parts
        sums = np.empty((n_parts, n, 3))  # a part touches what is near
        touched = np.empty((n_parts, 2), np.int32)

        def sum_parts(start: int, stop: int) -> None:
            sums[start:stop] = 0
            buckets.sum_cells(self.density, bands, start, stop, sums, touched)

        in_parts(sum_parts, n_parts, work=12 * height * width + 4000 * n)
        totals, energies = np.zeros((n, 3)), np.zeros(n_parts)
        about = sums, touched, generators, self._center, self.scale
        in_parts(partial(buckets.add_parts, *about, totals=totals, energies=energies), n_parts, work=64 * n)
        return Moments(totals[:, 0].copy(), totals[:, 1:].copy(), max(self._spread + float(energies.sum()), 0.0))

    def labels(self, generators: Floats, /) -> Ints:
        """Find the generator nearest to the center of each pixel, (H, W)."""
        return pixel_labels(self.density.shape, generators * self.scale)

    def halved(self) -> PixelMoments:
        """Take four pixels together, for a coarser level of the same image."""
        height, width = self.density.shape
        halves = self.density[::2].copy()
        halves[: height // 2] += self.density[1::2]
        quarters = halves[:, ::2].copy()
        quarters[:, : width // 2] += halves[:, 1::2]
        return PixelMoments(quarters, self.scale / 2)


def pixel_labels(shape: tuple[int, ...], points: ArrayLike) -> Ints:
    """Label the pixels of an image of a shape by the nearest of (K, 2) points.

    Examples
    --------
    >>> from cvtimg.placement import pixel_labels
    >>> pixel_labels((1, 4), [[1, 0.5], [4, 0.5]]).tolist()
    [[0, 0, 1, 1]]
    """
    buckets = _sorted(shape, check_places("points", points, 2))
    labels = np.empty(shape, np.int32)
    in_parts(partial(buckets.label_pixels, labels), buckets.rows, work=12 * labels.size + 4000 * buckets.n_generators)
    return labels


def _sorted(shape: tuple[int, ...], generators: Floats) -> _placement.Buckets:
    """Sort generators by square buckets of an image."""
    height, width = shape
    side = int(np.clip(round((_IN_A_BUCKET * height * width / len(generators)) ** 0.5), *_SIDES))
    return _placement.Buckets(np.ascontiguousarray(generators), height, width, side)


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
