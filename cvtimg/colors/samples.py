"""Distinct colors of an image, how often each occurs, and which pixel has which.

A photograph of twelve million pixels has a few hundred thousand colors. Later steps work on the colors, weighted by
their density, so that their cost does not depend on the size of the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_alpha, check_pixels, check_weights
from cvtimg._shared.pixels import AlphaArray as AlphaArray
from cvtimg._shared.sums import take_rows
from cvtimg._shared.threads import in_parts, n_threads, of_each
from cvtimg.colors import _counting
from cvtimg.engine.samples import MAX_ORDERED_DIMS, WeightedSamples, along_curve

# --- counts of small pixels, in a table with an entry for each value that a pixel can have

#: Pixels of up to this many bytes are counted in a table.
TABLE_BYTES = 3
#: Pages of keys with equal bits but for the last 16.
_OF_16_BITS = (1 << 16) // _counting.PAGE_SIZE
#: Fewer pixels are counted by one thread.
_PIXELS_OF_A_THREAD = 1 << 18


class CountTable:
    """Counts of pixels of up to three bytes: 2^24 counts, 64 MiB, in pages that take memory from their first use."""

    def __init__(self, n_bytes: int) -> None:
        n_pages = max(1, (1 << 8 * n_bytes) // _counting.PAGE_SIZE)
        self._key_bits = _interleave(n_bytes)
        self._pages = np.zeros(n_pages, np.uint16)
        self._counts = np.zeros((n_pages + 1, _counting.PAGE_SIZE), np.uint32)
        self._n_used = self._n_pixels = 0

    def has_room(self, n_more: int) -> bool:
        """Whether this many more pixels overflow no count."""
        return self._n_pixels + n_more < 1 << 32

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Count (N, B) pixels."""
        self._n_pixels += len(pixels)
        if min(n_threads(), len(pixels) // _PIXELS_OF_A_THREAD) > 1 and len(self._pages) > _OF_16_BITS:
            self._add_sorted(pixels)
        else:
            self._n_used = _counting.count_keys(
                pixels.reshape(-1), self._key_bits, self._pages, self._counts, self._n_used
            )

    def _add_sorted(self, pixels: NDArray[np.uint8]) -> None:
        """Count pixels by the high bits of their keys, of which each thread has its own."""
        bands = np.array_split(pixels, min(n_threads(), len(pixels) // _PIXELS_OF_A_THREAD))
        in_pages = np.zeros((len(bands), len(self._pages)), np.int32)
        keys = np.empty(len(pixels), np.uint16)

        def count(n: int) -> None:
            page = self._pages[n * _OF_16_BITS : (n + 1) * _OF_16_BITS]
            _counting.count_sorted(keys[ends[n] : ends[n + 1]], page, self._counts)

        work = 4 * len(pixels)
        of_each(lambda n: _counting.count_pages(bands[n], self._key_bits, in_pages[n]), len(bands), work)
        new = np.flatnonzero((self._pages == 0) & in_pages.any(axis=0))
        self._pages[new] = np.arange(self._n_used + 1, self._n_used + len(new) + 1)
        self._n_used += len(new)
        sizes = in_pages.reshape(len(bands), -1, _OF_16_BITS).sum(axis=2, dtype=np.int64)
        starts = np.cumsum(sizes.T).reshape(sizes.T.shape).T - sizes
        starts, ends = np.ascontiguousarray(starts), np.append(starts[0], len(pixels))
        of_each(lambda n: _counting.sort_keys(bands[n], self._key_bits, starts[n], keys), len(bands), work)
        of_each(count, sizes.shape[1], work)

    def close(self) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
        """Return the (M, B) distinct pixels and their (M,) counts; from then on the table only looks up pixels."""
        firsts = range(0, len(self._pages), _OF_16_BITS)
        groups = [self._pages[first : first + firsts.step] for first in firsts]
        work = self._n_used * _counting.PAGE_SIZE
        n_colors = of_each(lambda n: np.count_nonzero(self._counts[groups[n][groups[n] > 0]]), len(groups), work)
        before = np.cumsum([0, *n_colors])
        keys, density = np.empty(before[-1], np.uint32), np.empty(before[-1])

        def number(n: int) -> None:
            _counting.number_keys(groups[n], self._counts, firsts[n], before[n], keys, density)

        of_each(number, len(groups), work)
        return _pixels_of(keys, len(self._key_bits)), density

    def look_up(self, pixels: NDArray[np.uint8]) -> NDArray[np.int32]:
        """Return the (N,) index of each of (N, B) pixels among the distinct ones."""
        n_pixels, n_bytes = pixels.shape
        flat, inverse = pixels.reshape(-1), np.empty(n_pixels, np.int32)

        def look_up(start: int, stop: int) -> None:
            part = flat[start * n_bytes : stop * n_bytes]
            _counting.look_up_keys(part, self._key_bits, self._pages, self._counts, inverse[start:stop])

        in_parts(look_up, n_pixels, work=n_pixels)
        return inverse


def _interleave(n_bytes: int) -> NDArray[np.uint32]:
    """Return the (B, 256) bits of the key that each byte sets; bits of equal rank are neighbors, as are near colors."""
    values = np.arange(256, dtype=np.uint32)
    key_bits = np.zeros((n_bytes, 256), np.uint32)
    for byte in range(n_bytes):
        for bit in range(8):
            key_bits[byte] |= (values >> bit & 1) << (n_bytes * bit + n_bytes - 1 - byte)
    return key_bits


def _pixels_of(keys: NDArray[np.uint32], n_bytes: int) -> NDArray[np.uint8]:
    """Return the (M, B) bytes of keys, by tables for their lower and upper 12 bits."""
    half = np.arange(1 << 12, dtype=np.uint32)
    lower, upper = _deinterleave(half, n_bytes), _deinterleave(half << np.uint32(12), n_bytes)
    pixels = np.empty((len(keys), n_bytes), np.uint8)

    def fill(start: int, stop: int) -> None:
        pixels[start:stop] = lower[keys[start:stop] & 0xFFF] | upper[keys[start:stop] >> 12]

    in_parts(fill, len(keys), work=16 * len(keys))
    return pixels


def _deinterleave(keys: NDArray[np.uint32], n_bytes: int) -> NDArray[np.uint8]:
    """Return the (M, B) bytes of keys: the inverse of `_interleave`."""
    pixels = np.zeros((len(keys), n_bytes), np.uint8)
    for byte in range(n_bytes):
        for bit in range(8):
            pixels[:, byte] |= (keys >> (n_bytes * bit + n_bytes - 1 - byte) & 1).astype(np.uint8) << bit
    return pixels


# --- colors of images

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

    inverse: NDArray[np.int32]
    alpha: bool = False
    inside: NDArray[np.bool_] | None = None

    @property
    def colors(self) -> NDArray[Any]:
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

    def at_pixels(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return, for each pixel, which of the (M, ...) values its color has: (H, W, ...)."""
        return take_rows(values, self.inverse)

    def some(self, chosen: NDArray[np.bool_]) -> ColorSamples:
        """Return some of the colors, without `inverse`."""
        return ColorSamples(self.rows[chosen], self.density[chosen], self.in_order, NO_PIXELS, self.alpha)


def color_samples(image: Any, *, alpha: bool | None = None, mask: ArrayLike | None = None) -> ColorSamples:
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
    pixels = rows.view(np.uint8)
    in_order = rows.shape[1] <= MAX_ORDERED_DIMS
    if pixels.shape[1] <= TABLE_BYTES:
        table = CountTable(pixels.shape[1])
        table.add(pixels)
        (colors, density), inverse = table.close(), table.look_up(pixels)
    else:
        colors, density, inverse = _count_in_hash_table(pixels)
        if in_order:
            order = along_curve(colors.view(rows.dtype))
            rank = np.empty(len(order), np.int32)
            rank[order] = np.arange(len(order), dtype=np.int32)
            colors, density, inverse = colors[order], density[order], rank[inverse]
    samples = ColorSamples(colors.view(rows.dtype), density, in_order, inverse.reshape(height, width), alpha, inside)
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


_Counted = tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.int32]]


def _count_in_hash_table(pixels: NDArray[np.uint8], capacity: int = 1 << 16) -> _Counted:
    """Count pixels of any size, in a hash table that grows with the number of colors."""
    n_pixels = len(pixels)
    capacity = min(capacity, n_pixels)
    firsts, density = np.empty(capacity, np.int64), np.empty(capacity)
    inverse = np.empty(n_pixels, np.int32)
    n_done = n_colors = 0
    while True:
        slots = np.full(1 << (2 * capacity - 1).bit_length(), -1, np.int32)
        _counting.rehash(pixels, firsts[:n_colors], slots)
        n_done, n_colors = _counting.count_rows(pixels, n_done, slots, firsts, density, inverse, n_colors)
        if n_done == n_pixels:
            return pixels[firsts[:n_colors]], density[:n_colors].copy(), inverse
        capacity = min(4 * capacity, n_pixels)
        firsts, density = np.resize(firsts, capacity), np.resize(density, capacity)
