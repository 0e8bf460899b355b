"""Color quantization: a picture in the few colors that stand best for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._checks import check_image
from cvtimg.color import peak
from cvtimg.palette_search import EngineOptions, find_palette
from cvtimg.places import has_alpha, with_alpha
from cvtimg.remapping import Quantized, map_to_palette
from cvtimg.samples import color_samples


def quantize(
    image: Any,
    n_colors: int,
    *,
    space: str = "rgb",
    locked: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    **engine: Unpack[EngineOptions],
) -> Quantized:
    """Find the colors that stand best for a picture, and give each pixel the nearest of them.

    The palette is rounded to the depth of the picture before the pixels are mapped to it. A picture that has at
    most `n_colors` colors comes back exactly. This is `find_palette` and then `map_to_palette`.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        uint8, uint16 or floating point. Of two or four channels the last is alpha: colors count as far as they are
        seen, opaque pixels stay opaque, and what is fully transparent stays so.
    n_colors : int
        Size of the palette, in 1..65536, with the locked colors and, if there are such pixels, with full transparency.
    space : {"rgb", "linear", "lab", "oklab"}
        Where distances are measured, and means are taken. All but "rgb" are for grey and RGB, with alpha or without.
    locked : (L, C) array, optional
        Colors that are in the palette exactly, in the units of the picture.
    weights : (H, W) array, optional
        How much each pixel counts when the palette is sought, >= 0; by default all count alike.
    method, init, effort, volume_power, rng
        As in `tessellate`. Pixels go to the nearest color whatever the `volume_power` that the palette is made with.

    Returns
    -------
    Quantized

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here; the message names it.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import quantize
    >>> picture = np.array([[10, 12, 200], [11, 202, 201]], dtype=np.uint8)
    >>> result = quantize(picture, 2)
    >>> result.image.tolist(), result.energy
    ([[11, 11, 201], [11, 201, 201]], 4.0)
    """
    array = check_image("image", image)
    seen = _without_idle_alpha(array)
    samples = color_samples(seen)
    counted = samples if weights is None else samples.weighted(weights)
    found = find_palette(counted, n_colors, space=space, locked=locked, **engine)
    result = replace(map_to_palette(samples, found.colors, space=space), tessellation=found.tessellation)
    n_channels = result.palette.shape[1]
    if seen is not array and not has_alpha(n_channels):
        result = replace(result, palette=with_alpha(result.palette))
    shape = (*array.shape[:2], result.palette.shape[1])
    return replace(result, shape=array.shape if shape[2:] in ((1,), array.shape[2:]) else shape)


def _without_idle_alpha(image: NDArray[Any]) -> NDArray[Any]:
    """Return a picture that is opaque all over without its alpha: three bytes a pixel are counted sooner than four."""
    if image.ndim == 2 or not has_alpha(image.shape[2]) or (image[..., -1] != peak(image.dtype)).any():
        return image
    return np.ascontiguousarray(image[..., :-1])
