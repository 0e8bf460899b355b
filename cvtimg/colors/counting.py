"""Distinct colors of an image that comes in parts, or of many images, added exactly in any order and bounded memory."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_pixels
from cvtimg._shared.pixels import array_of, says_alpha
from cvtimg.colors.places import widen_samples, without_idle_alpha
from cvtimg.colors.samples import NO_PIXELS, ColorSamples, color_samples, merge_samples
from cvtimg.colors.spaces import to_depth
from cvtimg.engine.samples import MAX_ORDERED_DIMS, along_curve
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import read_image

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

    def plus(self, samples: ColorSamples) -> Count:
        """Add the colors of more pixels. Beyond `MOST_COLORS`, neighbors along a curve are merged."""
        colors = samples.without_pixels() if self.samples is None else add_samples(self.samples, samples)
        n_distinct = max(self.n_distinct, colors.n_colors)
        if colors.n_colors > MOST_COLORS:
            return Count(coarser(colors, MOST_COLORS), False, n_distinct)
        return Count(colors, self.exact, n_distinct)


def count_picture(
    picture: StrPath | ArrayLike, depth: str | None = None, *, mask: ArrayLike | None = None
) -> ColorSamples:
    """Count the colors of an image, at this many bits per sample, without `inverse`."""
    # This is what workers exchange: a few megabytes for a photograph of any size.
    image = read_image(picture) if isinstance(picture, (str, os.PathLike)) else picture
    alpha = says_alpha(image)
    if depth:
        array, mask = check_pixels("image", image, mask)
        image = to_depth(array, np.dtype(f"uint{depth}"))
    if alpha:
        seen = without_idle_alpha(array_of(image))
        image, alpha = seen, seen.shape[2] in (2, 4)
    return color_samples(image, alpha=alpha, mask=mask).without_pixels()


def add_samples(first: ColorSamples, second: ColorSamples) -> ColorSamples:
    """Add two densities, if they can have one type and number of channels: integers, with exact sums in any order."""
    pair = [first, second]
    if {str(samples.colors.dtype) for samples in pair} == {"uint8", "uint16"}:
        pair = [replace(samples, rows=to_depth(samples.colors, np.dtype(np.uint16))) for samples in pair]
    n_colors = [samples.colors.shape[1] - samples.alpha for samples in pair]
    if first.colors.shape[1] != second.colors.shape[1] and set(n_colors) <= {1, 3}:
        pair = [widen_samples(samples, max(n_colors), first.alpha or second.alpha) for samples in pair]
    return merge_samples(pair).without_pixels()


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
    means_of_parts = ColorSamples(colors, masses, samples.in_order, NO_PIXELS, samples.alpha)
    return merge_samples([means_of_parts]).without_pixels()
