"""Distinct colors of a picture that comes in parts, within bounded memory."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.colors import _counting
from cvtimg.colors.samples import TABLE_BYTES, ColorSamples, color_samples, interleave, merge_samples, pixels_of
from cvtimg.engine.ordering import MAX_ORDERED_DIMS, along_curve

__all__ = ["MOST_COLORS", "Counter"]

#: Distinct colors beyond which neighbours are taken together: the engine needs some 200 bytes for each.
MOST_COLORS = 1 << 22
_NO_WAY_BACK = np.empty((0, 0), np.int32)


class Counter:
    """Counts the colors of bands of a picture.

    Pixels of up to three bytes are counted in a table of 2^24 counts, 64 MiB, others in a growing list. Beyond `most`
    colors those that follow each other along a curve through their space become one, their mean, and `exact` is False.
    """

    def __init__(self, most: int = MOST_COLORS) -> None:
        self.exact = True
        self.n_distinct = 0
        self._most = most
        self._sum: ColorSamples | None = None
        self._table: _Table | None = None

    def add(self, band: NDArray[Any]) -> None:
        """Count the pixels of a band, (H, W) or (H, W, C)."""
        rows = np.ascontiguousarray(band.reshape(band.shape[0] * band.shape[1], -1))
        if rows.dtype == np.uint8 and rows.shape[1] <= TABLE_BYTES:
            if self._table is None:
                self._table = _Table(rows.shape[1])
            if not self._table.holds(len(rows)):
                self._join(self._table.samples())
                self._table = _Table(rows.shape[1])
            self._table.add(rows)
        else:
            self._join(replace(color_samples(band), inverse=_NO_WAY_BACK))

    @property
    def has_any(self) -> bool:
        """Whether there are pixels to count."""
        return self._sum is not None or self._table is not None

    def _join(self, samples: ColorSamples) -> None:
        total = samples if self._sum is None else merge_samples([self._sum, samples])
        self.n_distinct = max(self.n_distinct, total.n_colors)
        if total.n_colors > self._most:
            self.exact = False
            total = _coarser(total, self._most)
        self._sum = replace(total, inverse=_NO_WAY_BACK)

    def samples(self) -> ColorSamples:
        """Return the colors of all bands, without the way back to pixels."""
        if self._table is not None:
            table, self._table = self._table, None
            self._join(table.samples())
        if self._sum is None:
            raise ValueError("bands must be at least one")
        return self._sum


class _Table:
    """A count for each of all possible pixels of up to three bytes, in pages that are filled as they are met."""

    def __init__(self, n_bytes: int) -> None:
        n_pages = max(1, (1 << 8 * n_bytes) // _counting.PAGE_SIZE)
        self._spread = interleave(n_bytes)
        self._pages = np.zeros(n_pages, np.uint16)
        self._counts = np.zeros((n_pages + 1, _counting.PAGE_SIZE), np.uint32)
        self._n_used = self._n_pixels = 0

    def holds(self, n_more: int) -> bool:
        """Whether so many more pixels overflow no count."""
        return self._n_pixels + n_more < 1 << 32

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Count (N, B) pixels."""
        self._n_used = _counting.count_keys(pixels.reshape(-1), self._spread, self._pages, self._counts, self._n_used)
        self._n_pixels += len(pixels)

    def samples(self) -> ColorSamples:
        """Return what was counted, and leave the table unusable."""
        n_most = min(self._n_pixels, self._n_used * _counting.PAGE_SIZE)
        keys, density = np.empty(n_most, np.uint32), np.empty(n_most)
        n_colors = _counting.number_keys(self._pages, self._counts, keys, density)
        colors = pixels_of(keys[:n_colors], len(self._spread))
        return ColorSamples(colors, density[:n_colors].copy(), True, _NO_WAY_BACK)


def _coarser(samples: ColorSamples, n_most: int) -> ColorSamples:
    """Join neighbours along a curve to at most so many colors, their means rounded to the type of the picture."""
    colors, density = samples.colors, samples.density
    if not samples.in_order:
        order = along_curve(colors[:, :MAX_ORDERED_DIMS])
        colors, density = colors[order], density[order]
    starts = np.arange(0, len(colors), -(-len(colors) // n_most))
    masses = np.add.reduceat(density, starts)
    sums = [np.add.reduceat(colors[:, dim] * density, starts) for dim in range(colors.shape[1])]
    means = np.stack(sums, axis=1) / masses[:, np.newaxis]
    colors = (np.rint(means) if samples.colors.dtype.kind == "u" else means).astype(samples.colors.dtype)
    return merge_samples([ColorSamples(colors, masses, samples.in_order, _NO_WAY_BACK)])
