"""Distinct colors of an image, how often each occurs, and the way back to the pixels.

A photograph of twelve million pixels has some hundred thousand colors. Everything after this step works on the
colors, weighted by their density, so its cost does not depend on the size of the picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_image, check_weights
from cvtimg._shared.threads import in_parts
from cvtimg.colors import _counting
from cvtimg.engine.ordering import MAX_ORDERED_DIMS, along_curve
from cvtimg.engine.samples import WeightedSamples

#: Pixels of up to this many bytes are counted in a table with an entry for each possible key.
TABLE_BYTES = 3
_FIRST_CAPACITY = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class ColorSamples(WeightedSamples):
    """The distinct colors of an image.

    Attributes
    ----------
    rows : (M, D) array of the image's type
        Each distinct color once, in the units of the image; `colors` is the same.
    density : (M,) float64 array
        How many pixels have each color.
    in_order : bool
        Whether colors follow a curve that fills their space, so that near ones are similar: where D <= 4.
    inverse : (H, W) int32 array
        For each pixel the index of its color: ``colors[inverse]`` is the image, as (H, W, D).
    """

    inverse: NDArray[np.int32]

    def __post_init__(self) -> None:
        for array in (self.rows, self.density, self.inverse):
            array.flags.writeable = False

    @property
    def colors(self) -> NDArray[Any]:
        """(M, D) distinct colors."""
        return self.rows

    @property
    def n_colors(self) -> int:
        """Number of distinct colors, M."""
        return len(self.rows)

    def weighted(self, weights: ArrayLike) -> ColorSamples:
        """Let pixels count by (H, W) weights, finite, >= 0 and not all 0: the density of a color is their sum."""
        checked = check_weights("weights", weights, self.inverse.shape)
        density = np.bincount(self.inverse.reshape(-1), checked.reshape(-1), self.n_colors)
        return replace(self, density=density.astype(np.float64))

    def some(self, chosen: NDArray[np.bool_]) -> ColorSamples:
        """Return some of the colors, without a way back to pixels."""
        return ColorSamples(self.rows[chosen], self.density[chosen], self.in_order, np.empty((0, 0), np.int32))


def color_samples(image: Any) -> ColorSamples:
    """Count the distinct colors of an image.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        uint8, uint16 or floating point, any number of channels, no NaN.

    Returns
    -------
    ColorSamples
        With D = C, or D = 1 for an image without a channel axis.

    Raises
    ------
    TypeError, ValueError
        If the image has another shape or type, or NaN or infinity in it.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.colors import color_samples
    >>> samples = color_samples(np.array([[0, 7, 7], [7, 9, 0]], dtype=np.uint8))
    >>> samples.colors.ravel().tolist(), samples.density.tolist()
    ([0, 7, 9], [2.0, 3.0, 1.0])
    >>> samples.inverse.tolist()
    [[0, 1, 1], [1, 2, 0]]
    """
    array = check_image("image", image)
    height, width = array.shape[:2]
    rows = array.reshape(height * width, -1)
    if rows.dtype.kind == "f":
        rows = rows + rows.dtype.type(0)  # -0.0 and 0.0 are one color, but not the same bytes
    pixels = rows.view(np.uint8)
    in_order = rows.shape[1] <= MAX_ORDERED_DIMS
    if pixels.shape[1] <= TABLE_BYTES:
        colors, density, inverse = _count_in_table(pixels)
    else:
        colors, density, inverse = _count_in_hash(pixels)
        if in_order:
            order = along_curve(colors.view(rows.dtype))
            rank = np.empty(len(order), np.int32)
            rank[order] = np.arange(len(order), dtype=np.int32)
            colors, density, inverse = colors[order], density[order], rank[inverse]
    return ColorSamples(colors.view(rows.dtype), density, in_order, inverse.reshape(height, width))


def merge_samples(several: Sequence[ColorSamples]) -> ColorSamples:
    """Add the densities of several pictures, or of parts of one, as if their pixels were those of one picture.

    Parameters
    ----------
    several : sequence of ColorSamples
        At least one; all of the same type and number of channels.

    Returns
    -------
    ColorSamples
        The colors of all. Its `inverse`, (1, N), leads to them from the N colors of the given samples one after the
        other, not from pixels.

    Raises
    ------
    ValueError
        If there are none, or they differ in type or number of channels.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.colors import color_samples, merge_samples
    >>> frames = np.array([[[0, 7, 7]], [[7, 9, 0]]], dtype=np.uint8)
    >>> merged = merge_samples([color_samples(frame) for frame in frames])
    >>> merged.colors.ravel().tolist(), merged.density.tolist()
    ([0, 7, 9], [2.0, 3.0, 1.0])
    """
    kinds = {(str(samples.colors.dtype), samples.colors.shape[1]) for samples in several}
    if len(kinds) != 1:
        found = ", ".join(f"{dtype} x {n_channels}" for dtype, n_channels in sorted(kinds)) or "none"
        raise ValueError(f"samples to merge must have one type and number of channels, not {found}")
    merged = color_samples(np.concatenate([samples.colors for samples in several])[np.newaxis])
    return merged.weighted(np.concatenate([samples.density for samples in several])[np.newaxis])


_Counted = tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.int32]]


def _count_in_table(pixels: NDArray[np.uint8]) -> _Counted:
    """Count pixels of at most three bytes, each a key into a table of pages that are filled as they are met."""
    n_pixels, n_bytes = pixels.shape
    spread = interleave(n_bytes)
    n_pages = max(1, (1 << 8 * n_bytes) // _counting.PAGE_SIZE)
    pages = np.zeros(n_pages, np.uint16)
    counts = np.zeros((n_pages + 1, _counting.PAGE_SIZE), np.uint32)
    flat = pixels.reshape(-1)
    n_used = _counting.count_keys(flat, spread, pages, counts, 0)
    keys = np.empty(min(n_pixels, n_used * _counting.PAGE_SIZE), np.uint32)
    density = np.empty(len(keys))
    n_colors = _counting.number_keys(pages, counts, keys, density)
    inverse = np.empty(n_pixels, np.int32)

    def look_up(start: int, stop: int) -> None:
        _counting.look_up_keys(flat[start * n_bytes : stop * n_bytes], spread, pages, counts, inverse[start:stop])

    in_parts(look_up, n_pixels, work=n_pixels)
    return pixels_of(keys[:n_colors], n_bytes), density[:n_colors].copy(), inverse


def _count_in_hash(pixels: NDArray[np.uint8]) -> _Counted:
    """Count pixels of any size, with room that grows as colors are met."""
    n_pixels = len(pixels)
    capacity = min(_FIRST_CAPACITY, n_pixels)
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


def interleave(n_bytes: int) -> NDArray[np.uint32]:
    """(B, 256) bits of the key that each byte sets: bits of equal rank side by side, so near keys are near colors."""
    values = np.arange(256, dtype=np.uint32)
    spread = np.zeros((n_bytes, 256), np.uint32)
    for byte in range(n_bytes):
        for bit in range(8):
            spread[byte] |= (values >> bit & 1) << (n_bytes * bit + n_bytes - 1 - byte)
    return spread


def pixels_of(keys: NDArray[np.uint32], n_bytes: int) -> NDArray[np.uint8]:
    """(M, B) bytes of each key, by tables for its lower and upper 12 bits."""
    half = np.arange(1 << 12, dtype=np.uint32)
    lower, upper = _deinterleave(half, n_bytes), _deinterleave(half << np.uint32(12), n_bytes)
    pixels: NDArray[np.uint8] = lower[keys & 0xFFF] | upper[keys >> 12]
    return pixels


def _deinterleave(keys: NDArray[np.uint32], n_bytes: int) -> NDArray[np.uint8]:
    """(M, B) bytes of each key: the inverse of `interleave`."""
    pixels = np.zeros((len(keys), n_bytes), np.uint8)
    for byte in range(n_bytes):
        for bit in range(8):
            pixels[:, byte] |= (keys >> (n_bytes * bit + n_bytes - 1 - byte) & 1).astype(np.uint8) << bit
    return pixels
