"""Distinct colors of an image that comes in parts, in bounded memory."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg.colors.count_table import TABLE_BYTES, CountTable
from cvtimg.colors.samples import ColorSamples, color_samples, merge_samples
from cvtimg.engine.ordering import MAX_ORDERED_DIMS, along_curve

__all__ = ["MOST_COLORS", "Counter", "coarser"]

#: Beyond this many distinct colors neighbors are merged: the engine needs about 200 bytes for each.
MOST_COLORS = 1 << 22
_NO_PIXELS = np.empty((0, 0), np.int32)


class Counter:
    """Counts the colors of strips of an image.

    Pixels of up to three bytes are counted in a table of 64 MiB, others in a growing list. Beyond `most` colors,
    neighbors along a space-filling curve are replaced by their mean, and `exact` becomes False.
    """

    def __init__(self, most: int = MOST_COLORS, *, alpha: bool = False) -> None:
        self._alpha = alpha
        self.exact = True
        self.n_distinct = 0
        self._most = most
        self._sum: ColorSamples | None = None
        self._table: CountTable | None = None

    def add(self, band: NDArray[Any]) -> None:
        """Count the pixels of a strip, (H, W) or (H, W, C)."""
        rows = np.ascontiguousarray(band.reshape(band.shape[0] * band.shape[1], -1))
        if rows.dtype == np.uint8 and rows.shape[1] <= TABLE_BYTES:
            if self._table is None:
                self._table = CountTable(rows.shape[1])
            if not self._table.has_room(len(rows)):
                self._join(_samples(self._table, self._alpha))
                self._table = CountTable(rows.shape[1])
            self._table.add(rows)
        else:
            self._join(replace(color_samples(band, alpha=self._alpha), inverse=_NO_PIXELS))

    @property
    def has_any(self) -> bool:
        """Whether there are pixels to count."""
        return self._sum is not None or self._table is not None

    def _join(self, samples: ColorSamples) -> None:
        total = samples if self._sum is None else merge_samples([self._sum, samples])
        self.n_distinct = max(self.n_distinct, total.n_colors)
        if total.n_colors > self._most:
            self.exact = False
            total = coarser(total, self._most)
        self._sum = replace(total, inverse=_NO_PIXELS)

    def samples(self) -> ColorSamples:
        """Return the colors of all strips, without `inverse`."""
        if self._table is not None:
            table, self._table = self._table, None
            self._join(_samples(table, self._alpha))
        check_that("image", self._sum is not None, "have at least one strip")
        assert self._sum is not None
        return self._sum


def _samples(table: CountTable, alpha: bool) -> ColorSamples:
    colors, density = table.close()
    return ColorSamples(colors, density, True, _NO_PIXELS, alpha)


def coarser(samples: ColorSamples, n_most: int) -> ColorSamples:
    """Merge neighbors along a space-filling curve to at most this many colors, rounded to the type of the image."""
    colors, density = samples.colors, samples.density
    if not samples.in_order:
        order = along_curve(colors[:, :MAX_ORDERED_DIMS])
        colors, density = colors[order], density[order]
    starts = np.arange(0, len(colors), -(-len(colors) // n_most))
    masses = np.add.reduceat(density, starts)
    sums = [np.add.reduceat(colors[:, dim] * density, starts) for dim in range(colors.shape[1])]
    means = np.stack(sums, axis=1) / masses[:, np.newaxis]
    colors = (np.rint(means) if samples.colors.dtype.kind in "iu" else means).astype(samples.colors.dtype)
    return merge_samples([ColorSamples(colors, masses, samples.in_order, _NO_PIXELS, samples.alpha)])
