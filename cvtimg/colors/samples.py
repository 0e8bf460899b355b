"""Distinct colors of an image, how often each occurs, and which pixel has which.

A photograph of twelve million pixels has a few hundred thousand colors. Later steps work on the colors, weighted by
their density, so that their cost does not depend on the size of the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import IN_CACHE
from cvtimg._shared.checks import check_alpha, check_pixels, check_weights
from cvtimg._shared.pixels import AlphaArray as AlphaArray
from cvtimg._shared.sums import take_rows
from cvtimg._shared.threads import in_stripes, of_each
from cvtimg._shared.types import Array, Bools, Floats, ImageLike, Ints
from cvtimg.engine.samples import MAX_ORDERED_DIMS, WeightedSamples, along_curve

#: The `inverse` of colors without their pixels.
NO_PIXELS = np.empty((0, 0), np.int32)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ColorSamples(WeightedSamples):
    """The distinct colors of an image.

    Attributes
    ----------
    rows : (M, D) array of the image's type
        The distinct colors, in the units of the image; also available as `colors`.
    density : (M,) float64 array
        Number of pixels of each color.
    in_order : bool
        Whether colors follow a space-filling curve, so that neighbors are similar: where D <= 4.
    inverse : (H, W) int32 array
        Index of the color of each pixel: ``colors[inverse]`` is the image, as (H, W, D).
    alpha : bool
        Whether the last channel is alpha.
    inside : (H, W) bool array or None
        Pixels that count; None for all.
    """

    inverse: Ints
    alpha: bool = False
    inside: Bools | None = None

    @property
    def colors(self) -> Array:
        """(M, D) distinct colors."""
        return self.rows

    @property
    def n_colors(self) -> int:
        """Number of distinct colors, M."""
        return len(self.rows)

    def weighted(self, weights: ArrayLike) -> ColorSamples:
        """Weight the pixels: the density of a color becomes the sum of the (H, W) weights >= 0 of its pixels."""
        checked = check_weights("weights", weights, self.inverse.shape)
        if self.inside is not None:
            checked = np.where(self.inside, checked, 0)
        density = np.bincount(self.inverse.reshape(-1), checked.reshape(-1), self.n_colors)
        return replace(self, density=density.astype(np.float64))

    def at_pixels(self, values: Array) -> Array:
        """Return, for each pixel, which of the (M, ...) values its color has: (H, W, ...)."""
        return take_rows(values, self.inverse)

    def without_pixels(self) -> ColorSamples:
        """Return the colors without `inverse`."""
        return replace(self, inverse=NO_PIXELS, inside=None)

    def some(self, chosen: Bools) -> ColorSamples:
        """Return some of the colors, without `inverse`."""
        return ColorSamples(self.rows[chosen], self.density[chosen], self.in_order, NO_PIXELS, self.alpha)


def color_samples(image: ImageLike, *, alpha: bool | None = None, mask: ArrayLike | None = None) -> ColorSamples:
    """Count the distinct colors of an image.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Any integer or floating point type and byte order, any number of channels; also a masked array, and objects
        with ``__array__`` or the DLPack protocol. Pixels that are masked or not finite do not count.
    alpha : bool, optional
        Whether the last channel is alpha. By default that of a Pillow image with alpha, and of an array from
        `cvtimg.read_image` of such a file; all channels of other arrays are bands.
    mask : (H, W) array, optional
        Pixels that count, where it is not 0; all by default.

    Returns
    -------
    ColorSamples
        With D = C, or D = 1 for an image without a channel axis.

    Examples
    --------
    >>> from cvtimg.colors import color_samples
    >>> samples = color_samples(np.array([[0, 7, 7], [7, 9, 0]], dtype=np.uint8))
    >>> samples.colors.ravel().tolist(), samples.density.tolist()
    ([0, 7, 9], [2.0, 3.0, 1.0])
    >>> samples.inverse.tolist()
    [[0, 1, 1], [1, 2, 0]]
    """
    array, inside = check_pixels("image", image, mask)
    height, width = array.shape[:2]
    rows = array.reshape(height * width, -1)
    alpha = check_alpha(alpha, image, rows.shape[1])
    if rows.dtype.kind == "f":
        rows = rows + rows.dtype.type(0)  # -0.0 and 0.0 are one color, but not the same bytes
    numbers = _numbers_of(rows)
    in_order = rows.shape[1] <= MAX_ORDERED_DIMS
    distinct, inverse, density = _counted(numbers)
    colors = _rows_of(distinct, rows.dtype, rows.shape[1])
    if in_order and rows.dtype != np.uint8:
        order = along_curve(colors)
        rank = np.empty(len(order), np.int32)
        rank[order] = np.arange(len(order), dtype=np.int32)
        colors, density, inverse = colors[order], density[order], rank[inverse]
    samples = ColorSamples(colors, density, in_order, inverse.reshape(height, width), alpha, inside)
    return samples if inside is None else samples.weighted(inside)


def merge_samples(several: Sequence[ColorSamples]) -> ColorSamples:
    """Add the densities of several images, or of parts of one, as if their pixels belonged to one image.

    Parameters
    ----------
    several : sequence of ColorSamples
        At least one; all of the same type and number of channels, or ValueError.

    Returns
    -------
    ColorSamples
        The colors of all images. Its `inverse`, (1, N), holds the index of each of the N given colors in turn, not of
        pixels.

    Examples
    --------
    >>> from cvtimg.colors import color_samples, merge_samples
    >>> frames = np.array([[[0, 7, 7]], [[7, 9, 0]]], dtype=np.uint8)
    >>> merged = merge_samples([color_samples(frame) for frame in frames])
    >>> merged.colors.ravel().tolist(), merged.density.tolist()
    ([0, 7, 9], [2.0, 3.0, 1.0])
    """
    kinds = {f"{samples.colors.dtype} x {samples.colors.shape[1]}" for samples in several}
    if len(kinds) != 1:
        kinds_given = ", ".join(sorted(kinds)) or "none"
        raise ValueError(f"samples to merge must have one type and number of channels, not {kinds_given}")
    alpha = several[0].alpha
    merged = color_samples(np.concatenate([samples.colors for samples in several])[np.newaxis], alpha=alpha)
    return merged.weighted(np.concatenate([samples.density for samples in several])[np.newaxis])


def _numbers_of(rows: Array) -> Array:
    """Return an (N,) number or, of many bytes, a record of each row: equal for equal rows, near for near 8-bit colors.

    Of up to four bands of 8 bits it is the place on a Morton curve: bits of equal rank are side by side.
    """
    pixels = rows.view(np.uint8)
    n_bytes = pixels.shape[1]
    if rows.dtype == np.uint8 and n_bytes <= MAX_ORDERED_DIMS:
        values, bits = np.arange(256, dtype=np.uint32)[:, None], np.arange(8)
        spread = ((values >> bits & 1) << n_bytes * bits).sum(axis=1, dtype=np.uint32)
        parts = [spread << np.uint32(n_bytes - 1 - band) for band in range(n_bytes)]
        numbers = np.zeros(len(rows), np.uint32)

        def number(block: slice) -> None:
            for part, band in zip(parts, pixels[block].T, strict=True):
                numbers[block] |= np.take(part, band)

        in_stripes(number, len(rows), n_bytes * len(rows), IN_CACHE)
        return numbers
    if n_bytes > 8:
        return pixels.view(f"V{n_bytes}")[:, 0]
    wide = np.zeros((len(rows), 8), np.uint8)
    wide[:, :n_bytes] = pixels
    return wide.view(np.uint64)[:, 0]


def _rows_of(numbers: Array, dtype: np.dtype[np.generic], n_bands: int) -> Array:
    """Return the (N, C) rows of some numbers: the inverse of `_numbers_of`."""
    if numbers.dtype != np.uint32:
        pixels = numbers.view(np.uint8).reshape(len(numbers), -1)
        return np.ascontiguousarray(pixels[:, : n_bands * dtype.itemsize]).view(dtype)
    rows = np.zeros((len(numbers), n_bands), np.uint8)

    def collect(block: slice) -> None:
        for place in range(8 * n_bands):
            bit, band = divmod(place, n_bands)
            rows[block, n_bands - 1 - band] |= ((numbers[block] >> np.uint32(place)) & 1).astype(np.uint8) << bit

    in_stripes(collect, len(numbers), 64.0 * rows.size, IN_CACHE)
    return rows


def _counted(numbers: Array) -> tuple[Array, Ints, Floats]:
    """Return the distinct numbers, the rank of each of (N,) among them, and how often each of them occurs."""
    n_runs = 1 << 16  # of 256 numbers: all of three bands of 8 bits. Larger ones are sorted
    if numbers.dtype != np.uint32 or int(numbers.max()) >> 8 >= n_runs:
        return _sorted(numbers)
    # Colors fill few of the runs of 256 numbers. A table of these runs alone is small, and stays in the cache.
    is_used = np.zeros(n_runs, np.bool_)
    start_of = np.zeros(n_runs, np.intp)
    places, inverse = np.empty(len(numbers), np.uint32), np.empty(len(numbers), np.int32)

    def use(block: slice) -> None:
        is_used[(numbers[block] >> np.uint32(8)).astype(np.intp)] = True

    def place(block: slice) -> None:
        wide = numbers[block].astype(np.intp)  # which NumPy takes as indices without a copy
        wide = np.take(start_of, wide >> 8) | wide & 255
        is_there[wide] = True
        places[block] = wide

    def rank(block: slice) -> None:
        np.take(rank_of, places[block], out=inverse[block], mode="clip")  # which needs no copy of what comes out

    in_stripes(use, len(numbers), 16.0 * len(numbers), IN_CACHE)
    used = np.flatnonzero(is_used)
    start_of[used] = np.arange(len(used)) << 8
    is_there = np.zeros(len(used) << 8, np.bool_)
    in_stripes(place, len(numbers), 16.0 * len(numbers), IN_CACHE)
    taken = np.flatnonzero(is_there)
    rank_of = np.empty(len(is_there), np.int32)
    rank_of[taken] = np.arange(len(taken), dtype=np.int32)
    in_stripes(rank, len(numbers), 16.0 * len(numbers), IN_CACHE)
    distinct = (used[taken >> 8] << 8 | taken & 255).astype(np.uint32)
    # Stripes that are long beside what they are counted in, which is added up.
    n_in_stripe, n = max(IN_CACHE, 4 * len(taken)), len(inverse)
    counts = in_stripes(lambda block: np.bincount(inverse[block], minlength=len(taken)), n, 8.0 * n, n_in_stripe)
    return distinct, inverse, reduce(np.add, counts).astype(np.float64)


def _sorted(numbers: Array) -> tuple[Array, Ints, Floats]:
    """Return the same of any numbers: of those between some of them, which parts of them are, side by side."""
    ends = np.sort(numbers[:: IN_CACHE >> 6])[64::64]
    part_of, inverse = np.empty(len(numbers), np.uint16), np.empty(len(numbers), np.int32)

    def divide(block: slice) -> None:
        part_of[block] = np.searchsorted(ends, numbers[block], "right")

    in_stripes(divide, len(numbers), 64.0 * len(numbers), IN_CACHE)
    parts = np.split(np.argsort(part_of, kind="stable"), np.cumsum(np.bincount(part_of, minlength=len(ends) + 1))[:-1])

    def sort(part: int) -> tuple[Array, Array]:
        where = parts[part]
        distinct, inverse[where], counts = np.unique(numbers[where], return_inverse=True, return_counts=True)
        return distinct, counts

    distinct, counts = zip(*of_each(sort, len(parts), 512.0 * len(numbers)), strict=True)
    for part, first in zip(parts[1:], np.cumsum([len(some) for some in distinct]), strict=False):
        inverse[part] += np.int32(first)
    return np.concatenate(distinct), inverse, np.concatenate(counts).astype(np.float64)
