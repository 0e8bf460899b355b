"""From what a picture file holds to an upright sRGB array, by way of Pillow."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFile

from cvtimg.profiles import apply_profile

__all__ = ["decode", "depth", "orientation"]

_UPRIGHT = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}


def decode(image: ImageFile.ImageFile) -> NDArray[Any]:
    """Give the pixels of an open picture as `read_image` does."""
    bits = depth(image)  # asked first: load() forgets how the file is coded
    image.load()
    _scale_transparent_color(image, bits)
    turn = _UPRIGHT.get(orientation(image))
    upright = image if turn is None else image.transpose(turn)
    if image.mode == "F":
        return np.array(upright, np.float32)
    if image.mode.startswith("I"):
        return _deep_grey(np.asarray(upright))
    return np.array(_srgb(upright))


def depth(image: ImageFile.ImageFile) -> int:
    """Bits a band in the file, which Pillow may have widened or cut to 8."""
    if image.format == "PNG":
        coded = re.search(r";(\d+)", str(image.tile[0].args))
        if coded:
            return int(coded[1])
    if image.format == "TIFF":
        return int(getattr(image, "tag_v2", {}).get(258, (1,))[0])
    return {"1": 1, "I": 32, "F": 32}.get(image.mode, 16 if image.mode.startswith("I;16") else 8)


def orientation(image: Image.Image) -> int:
    """EXIF's number of the way that the picture lies, 1..8; 1 is upright."""
    try:
        return int(image.getexif().get(0x0112, 1))
    except Exception:  # damaged metadata, of which Pillow makes any error, spoils no pixel
        return 1


def _scale_transparent_color(image: Image.Image, bits: int) -> None:
    """Bring a PNG's transparent colour to 8 bits: Pillow does so for the pixels alone."""
    color = image.info.get("transparency")
    if image.format != "PNG" or color is None:
        return
    if image.mode == "L" and bits in (2, 4):
        image.info["transparency"] = color * 255 // (2**bits - 1)
    elif image.mode == "RGB" and bits == 16:
        image.info["transparency"] = tuple(value >> 8 for value in color)


def _deep_grey(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.itemsize == 2 or (values.min() >= 0 and values.max() <= 65535):
        return values.astype(np.uint16)
    return values.astype(np.float32)


def _srgb(image: Image.Image) -> Image.Image:
    """Bring an 8-bit picture of any mode to L, RGB or RGBA in sRGB."""
    icc = image.info.get("icc_profile")
    grey = image.mode in ("1", "L", "LA")
    opaque = "L" if grey else "CMYK" if image.mode == "CMYK" else "RGB"
    mode = "RGBA" if image.has_transparency_data else opaque
    plain = image if image.mode == mode else image.convert(mode)
    if icc:
        plain = apply_profile(plain, icc, grey)
    # Pillow has undone the inversion of Adobe's CMYK JPEG when it decoded.
    return plain.convert("RGB") if plain.mode == "CMYK" else plain
