"""Decode image files to upright sRGB arrays.

Pillow decodes most files. TIFF that it would reduce to 8 bits or to three bands is decoded by tifffile, which is
imported on first use, and rare compression by imagecodecs.
"""

import re
from typing import BinaryIO

import numpy as np
from PIL import Image, ImageFile, UnidentifiedImageError

from cvtimg._shared.pixels import with_mark
from cvtimg._shared.types import Array
from cvtimg.pictures.formats.animated import composed
from cvtimg.pictures.formats.arrays import NPY_MAGIC, as_samples, decode_npy, upright
from cvtimg.pictures.formats.opening import open_picture, orientation
from cvtimg.pictures.formats.png import decode_deep_png
from cvtimg.pictures.formats.png_chunks import described
from cvtimg.pictures.formats.tiff import TIFF_MAGICS, Layout, check_alone, decode_tiff, tags_of
from cvtimg.pictures.profiles import apply_profile


def decode(file: BinaryIO, *, keep_profile: bool = False, indices: bool = False) -> Array:
    """Decode an open file, as `read_image` does; with `indices`, return palette indices instead of colors.

    An array of four bands says whether the last is alpha.
    """
    magic = file.read(8)
    file.seek(0)
    if magic.startswith(NPY_MAGIC):
        return decode_npy(file)
    try:
        image = open_picture(file)
    except UnidentifiedImageError:
        if not magic.startswith(TIFF_MAGICS):
            raise
        check_alone(file)
        return decode_tiff(file, keep_profile=keep_profile)
    with image:
        if image.format == "TIFF":
            check_alone(file)
        if indices and image.mode == "P" and orientation(image) == 1:
            return np.array(image)
        if image.format == "GIF" and image.tile and image.tile[0].extents != (0, 0, *image.size):
            return with_mark(next(composed(file)), True)  # a frame that does not cover the screen
        if image.format == "TIFF" and not Layout.of(tags_of(image)).for_pillow:
            return decode_tiff(file, keep_profile=keep_profile)
        if image.format == "PNG" and depth(image) == 16 and not image.mode.startswith("I"):
            values = decode_deep_png(file, image, keep_profile=keep_profile)
        else:
            values = decode_opened(image, keep_profile=keep_profile)
        return with_mark(values, values.shape[2:] == (4,))


def decode_opened(image: ImageFile.ImageFile, *, keep_profile: bool = False) -> Array:
    """Decode the current frame or page of a Pillow image."""
    bits = depth(image)  # before load(), which discards the encoding of the file
    image.load()
    color = image.info.get("transparency")
    if color is not None and image.format == "PNG" and image.mode == "L" and bits in (2, 4):
        image.info["transparency"] = color * 255 // (2**bits - 1)  # Pillow scales only the pixels
    if image.mode.startswith(("I", "F")):
        values = np.array(image)
        values = as_samples(values.astype(np.uint16) if bits == 16 else values)
    else:
        values = np.array(to_srgb(image, keep_profile=keep_profile))
    return upright(values, orientation(image))


def depth(image: ImageFile.ImageFile) -> int:
    """Return the bits per band in the file, which may differ from those of the Pillow image."""
    if image.format == "PNG":
        coded = re.search(r";(\d+)", str(image.tile[0].args))
        if coded:
            return int(coded[1])
    if image.format == "TIFF":
        return Layout.of(tags_of(image)).bits
    if image.mode == "I" and image.format == "PPM":  # which Pillow scales to 0..65535
        return 16
    return {"1": 1, "I": 32, "F": 32}.get(image.mode, 16 if image.mode.startswith("I;16") else 8)


def to_srgb(image: Image.Image, *, keep_profile: bool = False, icc: bytes | None = None) -> Image.Image:
    """Convert an 8-bit image of any mode to L, RGB or RGBA in sRGB; `keep_profile` leaves RGB in its own profile."""
    icc = icc or image.info.get("icc_profile")
    grey = image.mode in ("1", "L", "LA")
    opaque = "L" if grey else "CMYK" if image.mode == "CMYK" else "RGB"
    mode = "RGBA" if image.has_transparency_data else opaque
    plain = image if image.mode == mode else image.convert(mode)
    colors = described(image.info) if image.format == "PNG" else None
    if colors is not None:
        bands = np.asarray(plain)
        return Image.fromarray(colors.to_srgb(bands.reshape(*bands.shape[:2], -1)).reshape(bands.shape))
    if icc and "cicp" not in image.info and not (keep_profile and opaque == "RGB"):
        plain = apply_profile(plain, icc, grey)
    # Pillow has already undone the inversion of Adobe CMYK JPEGs.
    return plain.convert("RGB") if plain.mode == "CMYK" else plain
