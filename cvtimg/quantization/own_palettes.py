"""Palettes of indexed images that are reproduced exactly."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from cvtimg.files.whole import StrPath
from cvtimg.palettes.files import read_palette
from cvtimg.pictures.files import image_info
from cvtimg.quantization.remapping import Quantized

__all__ = ["own_palette"]


def own_palette(source: StrPath, result: Quantized, n_colors: Any) -> NDArray[Any] | None:
    """Return the palette of an indexed image that is reproduced exactly, so that its indices keep their meaning.

    None for other images, and if the palette of the file has over `n_colors` colors, or that is not a number.
    """
    if result.energy or not isinstance(n_colors, int) or result.palette.dtype.itemsize > 1:
        return None
    if image_info(source).mode != "P":
        return None
    own = read_palette(source)
    return own if len(own) <= n_colors and own.shape[1] == result.palette.shape[1] else None
