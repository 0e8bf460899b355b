"""PNG with 16 bits a band in color, which Pillow would cut to 8."""

from __future__ import annotations

from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import ImageFile

from cvtimg.images.arrays import upright
from cvtimg.images.opening import orientation
from cvtimg.profiles import convert_deep

__all__ = ["decode_deep_png", "encode_deep_png"]

_HEADER_SIZE = 33


def decode_deep_png(file: BinaryIO, image: ImageFile.ImageFile) -> NDArray[np.uint16]:
    """Read uint16 (H, W, 3), or (H, W, 4) with transparency; `image` is the same file, opened by Pillow."""
    import imagecodecs

    file.seek(0)
    content = file.read()
    values: NDArray[np.uint16] = imagecodecs.png_decode(content)
    if values.shape[2] == 2:
        values = values[..., [0, 0, 0, 1]]
    icc = image.info.get("icc_profile")
    # Pillow would decode all pixels to look for EXIF behind them.
    has_exif = "exif" in image.info or b"eXIf" in content
    return upright(convert_deep(values, icc) if icc else values, orientation(image) if has_exif else 1)


def encode_deep_png(file: BinaryIO, values: NDArray[Any], chunks: bytes) -> None:
    """Write uint16 (H, W, 3) or (H, W, 4), with chunks before the pixels."""
    import imagecodecs

    content = imagecodecs.png_encode(np.ascontiguousarray(values), 3)
    file.write(content[:_HEADER_SIZE] + chunks + content[_HEADER_SIZE:])
