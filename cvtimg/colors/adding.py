"""Distinct colors of many images, or of an image in many blocks, added exactly, in any order and counted anywhere."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_that
from cvtimg._shared.pixels import array_of, says_alpha, with_mark
from cvtimg.blocks.images import PixelBlocks
from cvtimg.colors.counting import MOST_COLORS, coarser
from cvtimg.colors.places import widen_samples, without_idle_alpha
from cvtimg.colors.samples import ColorSamples, color_samples, merge_samples
from cvtimg.colors.spaces import to_depth
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import read_image

__all__ = ["add_samples", "count_blocks", "count_picture", "in_fixed_order"]


def count_picture(
    picture: StrPath | ArrayLike, depth: str | None = None, *, mask: ArrayLike | None = None
) -> ColorSamples:
    """Count the colors of an image, at this many bits per sample, without `inverse`.

    This is what workers exchange: a few megabytes for a photograph of any size.
    """
    image = read_image(picture) if isinstance(picture, (str, os.PathLike)) else picture
    alpha = says_alpha(image)
    if depth:
        image = to_depth(array_of(image), np.dtype(f"uint{depth}"))
    if alpha:
        seen = without_idle_alpha(array_of(image))
        image, alpha = seen, seen.shape[2] in (2, 4)
    samples = color_samples(image, alpha=alpha, mask=mask)
    return replace(samples, inverse=np.empty((0, 0), np.int32), inside=None)


def add_samples(first: ColorSamples, second: ColorSamples) -> ColorSamples:
    """Add two densities. Counts of pixels are integers, whose sums are exact in any order."""
    merged = merge_samples(_alike(first, second))
    return replace(merged, inverse=np.empty((0, 0), np.int32))


def _alike(first: ColorSamples, second: ColorSamples) -> list[ColorSamples]:
    """Bring samples to one type and number of channels, if possible."""
    pair = [first, second]
    dtypes, channels = {str(one.colors.dtype) for one in pair}, {one.colors.shape[1] for one in pair}
    if dtypes == {"uint8", "uint16"}:
        pair = [replace(one, rows=to_depth(one.colors, np.dtype(np.uint16))) for one in pair]
    n_colors = [one.colors.shape[1] - one.alpha for one in pair]
    if len(channels) > 1 and set(n_colors) <= {1, 3}:
        alpha = any(one.alpha for one in pair)
        pair = [widen_samples(one, max(n_colors), alpha) for one in pair]
    return pair


def in_fixed_order(samples: ColorSamples) -> ColorSamples:
    """Sort colors: a table of counts has its own order, a hash table that of the first occurrences."""
    order = np.lexsort(samples.colors.T[::-1])
    in_order = replace(samples, rows=samples.colors[order], density=samples.density[order])
    return merge_samples([in_order]) if samples.in_order else in_order


@dataclass(frozen=True, slots=True, eq=False)
class _Counted:
    """The distinct colors of some blocks, if there are any pixels, and whether all were distinguished."""

    samples: ColorSamples | None
    exact: bool = True

    @staticmethod
    def total(parts: Sequence[_Counted]) -> _Counted:
        """Add the counts of consecutive blocks."""
        samples, exact = None, all(part.exact for part in parts)
        for more in (part.samples for part in parts if part.samples is not None):
            samples = more if samples is None else add_samples(samples, more)
            if samples.n_colors > MOST_COLORS:
                samples, exact = coarser(samples, MOST_COLORS), False
        return _Counted(samples, exact)


def count_blocks(blocks: PixelBlocks, alpha: bool = False) -> tuple[ColorSamples, bool]:
    """Return the distinct colors of an image in blocks, in a fixed order, and whether all were distinguished.

    Raises
    ------
    ValueError
        If no pixel counts.
    """
    counted = blocks.total(partial(_count_pixels, alpha=alpha), _Counted.total)
    check_that("image", counted.samples is not None, "have at least one pixel that is finite and not nodata")
    assert counted.samples is not None
    return in_fixed_order(counted.samples), counted.exact


def _count_pixels(pixels: NDArray[Any], *, alpha: bool) -> _Counted:
    return _Counted(count_picture(with_mark(pixels[None], alpha)) if len(pixels) else None)
