"""PNG beyond Pillow: color with 16 bits per band, and smaller indexed images."""

from __future__ import annotations

import struct
import zlib
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import ImageFile

from cvtimg.pictures.formats.arrays import upright
from cvtimg.pictures.formats.opening import PNG_MAGIC, orientation

__all__ = ["chunk", "decode_deep_png", "encode_deep_png", "encode_indexed_png", "optimized"]

_HEADER_SIZE = 33
_INDEXED = 3
# Unfiltered indexed pixels: bytes relative to pngquant 2.17 with the same number of colors, mean of four photographs of
# 0.4 megapixels, first without dithering at 256 colors, then with Floyd-Steinberg at 64; and time.
#   zlib level 6       0.94, 1.03, 16 ms       level 9      0.93, 1.02, 31 ms
#   libdeflate level 6 0.94, 1.04, 6 ms        level 10     0.86, 0.96, 50 to 75 ms       level 12 0.88, 0.96, 100 ms
# For 12 megapixels level 6 takes 0.15 s, and level 10 over a second: too long compared to 0.5 s for everything else.
# Flat areas are an exception: there the output of level 10 is larger than that of 9, and 12 gives the smallest.
_LEVELS, _LEVELS_OF_FLAT = (10, 6), (12, 9)
_LARGE = 1 << 21
_FLAT = 1 / 8  # largest compression ratio, at level 1, of an image that counts as flat
_OPTIMIZATION = 4  # the lowest level that sorts the palette


def decode_deep_png(file: BinaryIO, image: ImageFile.ImageFile, *, keep_profile: bool = False) -> NDArray[np.uint16]:
    """Read uint16 (H, W, 3), or (H, W, 4) with transparency; `image` is the same file opened with Pillow."""
    import imagecodecs

    file.seek(0)
    content = file.read()
    values: NDArray[np.uint16] = imagecodecs.png_decode(content)
    if values.shape[2] == 2:
        values = values[..., [0, 0, 0, 1]]
    icc = image.info.get("icc_profile")
    # Pillow would decode all pixels to find EXIF data after them.
    has_exif = "exif" in image.info or b"eXIf" in content
    if icc and not keep_profile:
        from cvtimg.pictures.profiles import convert_deep

        values = convert_deep(values, icc)
    return upright(values, orientation(image) if has_exif else 1)


def encode_deep_png(file: BinaryIO, values: NDArray[Any], chunks: bytes) -> None:
    """Write uint16 (H, W, 3) or (H, W, 4), with `chunks` before the pixels."""
    import imagecodecs

    content = imagecodecs.png_encode(np.ascontiguousarray(values), 3)
    file.write(content[:_HEADER_SIZE] + chunks + content[_HEADER_SIZE:])


def encode_indexed_png(
    file: BinaryIO, indices: NDArray[Any], colors: NDArray[np.uint8], alpha: NDArray[np.uint8], chunks: bytes
) -> None:
    """Write (H, W) indices, (K, 3) colors and (K,) alpha with the fewest bits; `chunks` precede the palette."""
    import imagecodecs

    height, width = indices.shape
    bits = next(bits for bits in (1, 2, 4, 8) if len(colors) <= 1 << bits)
    rows = np.zeros((height, 1 + -(-width * bits // 8)), np.uint8)  # each row begins with its filter, 0 for none
    rows[:, 1:] = _packed(indices, bits)
    content = rows.tobytes()
    flat = len(imagecodecs.deflate_encode(content, 1)) < _FLAT * len(content)
    level = (_LEVELS_OF_FLAT if flat else _LEVELS)[indices.size > _LARGE]
    file.write(PNG_MAGIC + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, _INDEXED, 0, 0, 0)))
    file.write(chunks + chunk(b"PLTE", colors.tobytes()))
    if (alpha < 255).any():
        file.write(chunk(b"tRNS", alpha.tobytes().rstrip(b"\xff")))
    file.write(chunk(b"IDAT", bytes(imagecodecs.deflate_encode(content, level))) + chunk(b"IEND", b""))


def optimized(png: bytes) -> bytes:
    """Recompress a PNG losslessly with oxipng."""
    try:
        import oxipng
    except ImportError as error:
        raise ModuleNotFoundError("optimize needs oxipng: pip install 'cvtimg[oxipng]'", name="oxipng") from error
    smaller: bytes = oxipng.optimize_from_memory(png, level=_OPTIMIZATION)
    return smaller


def chunk(name: bytes, data: bytes) -> bytes:
    """Return a PNG chunk with its length and checksum."""
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def _packed(indices: NDArray[Any], bits: int) -> NDArray[np.uint8]:
    """Pack (H, W) indices into (H, B) bytes, the first index in the upper bits."""
    if bits == 8:
        return indices.astype(np.uint8)
    n_each = 8 // bits
    height, width = indices.shape
    padded = np.zeros((height, -(-width // n_each), n_each), np.uint8)
    padded.reshape(height, -1)[:, :width] = indices
    packed: NDArray[np.uint8] = np.bitwise_or.reduce(padded << np.arange(8 - bits, -1, -bits, dtype=np.uint8), axis=2)
    return packed
