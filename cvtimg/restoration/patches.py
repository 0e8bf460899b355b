"""Kinds of patches, and groups of patches that look alike.

A photograph has many colors but few kinds of patches: flat areas, edges in each direction, each texture. The patches
around all pixels are tessellated by their main components, and each cell is cut in two, across its main axis, until
groups are small. Groups are small enough for one covariance to describe all patches in them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts, in_stripes
from cvtimg.engine.points import assign, pack
from cvtimg.engine.seeding import TooFewSamplesError
from cvtimg.engine.tessellation import tessellate
from cvtimg.restoration import _patches
from cvtimg.restoration.versions import Floats

#: Patches are 5 x 5 pixels.
REACH = 2
SIDE = 2 * REACH + 1

#: Number of patches from which principal components are found.
_N_SAMPLES = 1 << 14
#: Ratio of the noise of bands up to which it is taken for equal.
_EQUAL = 1.25
#: Lightness and opponent colors, as columns. Chroma counts double: it varies less, so noise hides less of what differs.
_OPPONENT = (np.array([[1, 2, 2], [1, 0, -4], [1, -2, 2]]) / np.sqrt([3, 2, 6])).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """Axes along which the bands of an image have equal noise, at most a few of them at a time."""

    matrix: NDArray[np.float64]  # (C, C): maps bands to axes
    slices: tuple[slice, ...]  # axes that are filtered together

    @classmethod
    def of(cls, noise_by_band: list[NDArray[np.float64]], image: Floats, most: int = 4) -> Axes:
        """Give bands, (C,) in each version, equal noise; of more than `most`, put what they share first."""
        n_bands = image.shape[2]
        slices = tuple(slice(first, first + most) for first in range(0, n_bands, most))
        noise = np.stack(noise_by_band)
        least = np.maximum(np.nanmean(noise, axis=0) if np.isfinite(noise).any() else np.ones(n_bands), 1e-30)
        equal = least.max() <= _EQUAL * least.min()
        scales = np.ones(n_bands) if equal else np.sqrt(np.mean(least**2)) / least
        rows = image.reshape(-1, n_bands)[:: max(1, image.size // (n_bands * _N_SAMPLES))] * scales
        turned = np.linalg.eigh(np.cov(rows.T))[1][:, ::-1] if len(slices) > 1 else np.eye(n_bands)
        return cls(scales[:, None] * turned, slices)

    def along(self, image: Floats) -> Floats:
        """(H, W, C) image, by axes."""
        return product(image, self.matrix.astype(np.float32))

    def back(self, image: Floats) -> Floats:
        """(H, W, C) image, by bands again."""
        return product(image, np.linalg.inv(self.matrix).astype(np.float32))

    def looks(self, image: Floats) -> Floats:
        """(H, W, D) what patches are compared by: opponent colors of three bands, or the first axes."""
        return product(image, _OPPONENT) if image.shape[2] == 3 else image[:, :, self.slices[0]]


@dataclass(frozen=True, slots=True, eq=False)
class Kinds:
    """Cells of the patches of an image."""

    mean: Floats  # (P,): mean patch
    basis: Floats  # (P, D): main components of the patches
    generators: NDArray[np.float64]  # (K, D): kinds of patches, in these components

    @classmethod
    def of(cls, bordered: Floats, n_generators: int, rng: np.random.Generator, n_components: int = 16) -> Kinds:
        """Find kinds of patches from some patches of an image with a border of `REACH` pixels."""
        patches = windows(bordered)
        n_pixels = patches.shape[0] * patches.shape[1]
        drawn = np.sort(rng.choice(n_pixels, min(n_pixels, max(_N_SAMPLES, 50 * n_generators)), replace=False))
        sample = patches[np.unravel_index(drawn, patches.shape[:2])].reshape(len(drawn), -1)
        mean = sample.mean(axis=0)
        sample = sample - mean
        _, axes = np.linalg.eigh(product(sample.T, sample).astype(np.float64))
        basis = axes[:, -n_components:].astype(np.float32)
        points = product(sample, basis)
        try:
            found = tessellate(points, n_generators, effort="fast", rng=rng)
        except TooFewSamplesError as error:  # of flat colors; to count them first would take time
            found = tessellate(points, error.n_distinct, effort="fast", rng=rng)
        return cls(mean, basis, found.generators)

    def features(self, bordered: Floats, chunk: int = 1 << 15) -> Floats:
        """(N, D) features of the patches of an image with a border of `REACH` pixels, about `chunk` at a time."""
        patches = windows(bordered)

        def part(rows: slice) -> Floats:
            return product(patches[rows].reshape(-1, len(self.mean)) - self.mean, self.basis)

        step = max(1, chunk // patches.shape[1])
        return np.concatenate(in_stripes(part, len(patches), work=float(patches.size * self.basis.shape[1]), n=step))

    def label(self, features: Floats) -> NDArray[np.int32]:
        """(N,) kind of each patch, from 0."""
        points = pack(features, np.ones(len(features)), center=np.zeros(features.shape[1]))
        return assign(points, points.frame.inward(self.generators))[: points.n_points]


@dataclass(frozen=True, slots=True, eq=False)
class Groups:
    """Groups of patches: (N,) pixels in the order of their groups, and (G + 1,) where each group begins."""

    order: NDArray[np.int32]
    bounds: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.bounds) - 1

    @property
    def sizes(self) -> NDArray[np.int64]:
        """(G,) number of patches of each group."""
        return np.diff(self.bounds)

    def of_pixels(self) -> NDArray[np.int32]:
        """(N,) group of each pixel."""
        found = np.empty(len(self.order), np.int32)
        found[self.order] = np.repeat(np.arange(len(self), dtype=np.int32), self.sizes)
        return found

    def sums(self, values: NDArray[np.float32]) -> NDArray[np.float64]:
        """(G,) or (G, ...) sums over the patches of each group."""
        return np.add.reduceat(values[self.order], self.bounds[:-1], axis=0, dtype=np.float64)


def group_patches(features: Floats, labels: NDArray[np.int32], largest: int) -> Groups:
    """Cut cells, (N,) from 0, in two by features, (N, D), until no group has more than `largest` patches."""
    order = np.argsort(labels, kind="stable").astype(np.int32)
    bounds = np.flatnonzero(np.diff(labels[order], prepend=-1, append=-1)).astype(np.int64)
    while True:
        large = np.flatnonzero(np.diff(bounds) > largest)
        if not len(large):
            return Groups(order, bounds)
        starts, stops, cuts = bounds[large], bounds[large + 1], np.empty(len(large), np.int64)

        def halve(first: int, last: int, starts=starts, stops=stops, cuts=cuts) -> None:  # type: ignore[no-untyped-def]
            _patches.halve_groups(features, order, starts, stops, cuts, first, last)

        in_parts(halve, len(large), work=float((stops - starts).sum()) * features.shape[1] ** 2 / 8)
        bounds = np.insert(bounds, large + 1, cuts)


def product(image: Floats, matrix: Floats) -> Floats:
    """Multiply by a matrix, without warnings."""
    # NumPy's BLAS for 64-bit ARM computes in lanes that hold no numbers, and raises their flags of division by zero.
    with np.errstate(all="ignore"):
        return image @ matrix


def with_border(image: Floats) -> Floats:
    """Mirror the border of an image, so that there is a patch around each pixel."""
    return np.pad(image, ((REACH, REACH), (REACH, REACH), (0, 0)), mode="symmetric")


def windows(bordered: Floats) -> NDArray[np.float32]:
    """(H, W, 5, 5, C) view of the patches of an (H + 4, W + 4, C) image."""
    seen = np.lib.stride_tricks.sliding_window_view(bordered, (SIDE, SIDE), axis=(0, 1))
    return np.moveaxis(seen, 2, 4)
