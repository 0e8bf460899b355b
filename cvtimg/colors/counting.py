"""Distinct colors of an image that comes in parts, or of many images, added exactly in any order and bounded memory."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.pixels import array_of, says_alpha
from cvtimg.colors.places import widen_samples, without_idle_alpha
from cvtimg.colors.samples import NO_PIXELS, TABLE_BYTES, ColorSamples, CountTable, color_samples, merge_samples
from cvtimg.colors.spaces import to_depth
from cvtimg.engine.samples import MAX_ORDERED_DIMS, along_curve
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import read_image

__all__ = ["MOST_COLORS", "Count", "Counter", "add_counts", "add_samples", "coarser", "count_picture", "in_fixed_order"]

#: Beyond this many distinct colors neighbors are merged: the engine needs about 200 bytes for each.
MOST_COLORS = 1 << 22


class Count(NamedTuple):
    """The distinct colors of some pixels."""

    samples: ColorSamples | None = None  # The colors, without `inverse`; None if there are no pixels
    exact: bool = True  # Whether all colors were distinguished
    n_distinct: int = 0  # Number of colors; where they were not all distinguished, the largest number at a time

    def of_some(self, kind: str = "counts") -> ColorSamples:
        """Return the colors; raise ValueError if there is no pixel of a kind."""
        if self.samples is None:
            raise ValueError(f"image must have at least one pixel that {kind}")
        return self.samples

    @classmethod
    def of(cls, samples: ColorSamples) -> Count:
        """Return the count of the pixels of an image, or of a part of one."""
        return cls(replace(samples, inverse=NO_PIXELS, inside=None), True, samples.n_colors)


def add_counts(counts: Iterable[Count], most: int | None = None) -> Count:
    """Add counts in their order. Beyond `most` colors, `MOST_COLORS` by default, neighbors along a curve are merged."""
    most = MOST_COLORS if most is None else most
    total = Count()
    for count in counts:
        if total.samples is None or count.samples is None:
            samples = total.samples or count.samples
        else:
            samples = add_samples(total.samples, count.samples)
        n_distinct = max(total.n_distinct, count.n_distinct, samples.n_colors if samples else 0)
        total = Count(samples, total.exact and count.exact, n_distinct)
        if samples and samples.n_colors > most:
            total = Count(coarser(samples, most), False, n_distinct)
    return total


class Counter:
    """Counts the colors of strips of an image: pixels of up to three bytes in a table of 64 MiB, others in a list."""

    def __init__(self, most: int | None = None, *, alpha: bool = False) -> None:
        self._most, self._alpha = most, alpha
        self._count = Count()
        self._table: CountTable | None = None

    def add(self, band: NDArray[Any]) -> None:
        """Count the pixels of a strip, (H, W) or (H, W, C)."""
        rows = np.ascontiguousarray(band.reshape(band.shape[0] * band.shape[1], -1))
        if rows.dtype != np.uint8 or rows.shape[1] > TABLE_BYTES:
            self._count = add_counts([self._count, Count.of(color_samples(band, alpha=self._alpha))], self._most)
            return
        if self._table is not None and not self._table.has_room(len(rows)):
            self._close()
        if self._table is None:
            self._table = CountTable(rows.shape[1])
        self._table.add(rows)

    def _close(self) -> None:
        if self._table is not None:
            samples = ColorSamples(*self._table.close(), True, NO_PIXELS, self._alpha)
            self._table, self._count = None, add_counts([self._count, Count.of(samples)], self._most)

    def total(self) -> Count:
        """Return the colors of all strips."""
        self._close()
        return self._count


def count_picture(
    picture: StrPath | ArrayLike, depth: str | None = None, *, mask: ArrayLike | None = None
) -> ColorSamples:
    """Count the colors of an image, at this many bits per sample, without `inverse`."""
    # This is what workers exchange: a few megabytes for a photograph of any size.
    image = read_image(picture) if isinstance(picture, (str, os.PathLike)) else picture
    alpha = says_alpha(image)
    if depth:
        image = to_depth(array_of(image), np.dtype(f"uint{depth}"))
    if alpha:
        seen = without_idle_alpha(array_of(image))
        image, alpha = seen, seen.shape[2] in (2, 4)
    samples = color_samples(image, alpha=alpha, mask=mask)
    return replace(samples, inverse=NO_PIXELS, inside=None)


def add_samples(first: ColorSamples, second: ColorSamples) -> ColorSamples:
    """Add two densities. Counts of pixels are integers, whose sums are exact in any order."""
    return replace(merge_samples(_alike(first, second)), inverse=NO_PIXELS)


def _alike(first: ColorSamples, second: ColorSamples) -> list[ColorSamples]:
    """Bring samples to one type and number of channels, if possible."""
    pair = [first, second]
    dtypes, channels = {str(samples.colors.dtype) for samples in pair}, {samples.colors.shape[1] for samples in pair}
    if dtypes == {"uint8", "uint16"}:
        pair = [replace(samples, rows=to_depth(samples.colors, np.dtype(np.uint16))) for samples in pair]
    n_colors = [samples.colors.shape[1] - samples.alpha for samples in pair]
    if len(channels) > 1 and set(n_colors) <= {1, 3}:
        pair = [widen_samples(samples, max(n_colors), first.alpha or second.alpha) for samples in pair]
    return pair


def in_fixed_order(samples: ColorSamples) -> ColorSamples:
    """Sort colors: a table of counts has its own order, a hash table that of the first occurrences."""
    order = np.lexsort(samples.colors.T[::-1])
    in_order = replace(samples, rows=samples.colors[order], density=samples.density[order])
    return merge_samples([in_order]) if samples.in_order else in_order


def coarser(samples: ColorSamples, n_most: int) -> ColorSamples:
    """Merge neighbors along a space-filling curve to at most this many colors, rounded to the type of the image."""
    if samples.n_colors <= n_most:
        return samples
    colors, density = samples.colors, samples.density
    if not samples.in_order:
        order = along_curve(colors[:, :MAX_ORDERED_DIMS])
        colors, density = colors[order], density[order]
    starts = np.arange(0, len(colors), -(-len(colors) // n_most))
    masses = np.add.reduceat(density, starts)
    sums = [np.add.reduceat(colors[:, dim] * density, starts) for dim in range(colors.shape[1])]
    means = np.stack(sums, axis=1) / masses[:, np.newaxis]
    colors = (np.rint(means) if samples.colors.dtype.kind in "iu" else means).astype(samples.colors.dtype)
    merged = merge_samples([ColorSamples(colors, masses, samples.in_order, NO_PIXELS, samples.alpha)])
    return replace(merged, inverse=NO_PIXELS)
