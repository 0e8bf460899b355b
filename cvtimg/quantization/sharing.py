"""One palette for many images, from the exact sum of their densities, in any order and counted anywhere."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Unpack

from numpy.typing import ArrayLike

from cvtimg._shared.checks import refuse
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.threads import pairwise_sum
from cvtimg.colors.adding import add_samples, count_picture, in_fixed_order
from cvtimg.files.whole import StrPath
from cvtimg.quantization.palette_search import EngineOptions, Palette, find_palette

__all__ = ["shared_palette"]


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
