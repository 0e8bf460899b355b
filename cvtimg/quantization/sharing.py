"""One palette for many images, from the exact sum of their densities, in any order and counted anywhere."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import refuse
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import array_of, says_alpha
from cvtimg._shared.threads import pairwise_sum
from cvtimg.colors.places import widen_samples, without_idle_alpha
from cvtimg.colors.samples import ColorSamples, color_samples, merge_samples
from cvtimg.colors.spaces import to_depth
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import read_image
from cvtimg.quantization.palette_search import EngineOptions, Palette, find_palette

__all__ = ["add_samples", "count_picture", "in_fixed_order", "shared_palette"]


def shared_palette(
    pictures: Iterable[StrPath | ArrayLike],
    n_colors: int,
    *,
    space: SpaceName = "rgb",
    locked: ArrayLike | None = None,
    **engine: Unpack[EngineOptions],
) -> Palette:
    """Find the palette that represents all pixels of many images with the least error.

    The densities of the images are added exactly: the result is that of one image with all their pixels, bit for bit,
    in any order. `map_to_palette` then maps each image to the palette.

    Parameters
    ----------
    pictures : iterable of paths or (H, W) or (H, W, C) arrays
        Read one after the other: memory holds only the distinct colors of all, at most 2^24 of 8-bit RGB. Grey becomes
        RGB if there is color, opaque images get alpha if some have transparency, and 8 bits become 16 if some have
        16; floating point, and bands that are not colors, cannot be combined with other images.
    n_colors : int
        Size of the palette, in 1..65536.
    space, locked, method, init, effort, volume_power, rng, callback
        As in `find_palette`.

    Returns
    -------
    Palette

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it, its value and what is allowed.
    OSError
        If an image cannot be read.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.quantization import shared_palette
    >>> shared_palette([np.array([[10, 12]], np.uint8), np.array([[200, 202]], np.uint8)], 2).colors.tolist()
    [[11], [201]]
    """
    samples = pairwise_sum((count_picture(picture) for picture in pictures), add_samples)
    if samples is None:
        refuse("pictures", [], "at least one")
    return find_palette(in_fixed_order(samples), n_colors, space=space, locked=locked, **engine)


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
