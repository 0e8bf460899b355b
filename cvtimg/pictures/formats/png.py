"""PNG beyond Pillow: color with 16 bits per band, and smaller indexed images."""

from __future__ import annotations

import struct
import zlib
from enum import IntEnum
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import ImageFile
from PIL.PngImagePlugin import PngImageFile

from cvtimg._shared.extras import optional
from cvtimg.pictures.formats.arrays import upright
from cvtimg.pictures.formats.opening import PNG_MAGIC, orientation
from cvtimg.pictures.formats.png_chunks import described
from cvtimg.pictures.profiles import convert_deep


class _Kind(IntEnum):
    """Kinds of color of a PNG."""

    GRAY, COLOR, INDEXED, GRAY_AND_ALPHA, COLOR_AND_ALPHA = 0, 2, 3, 4, 6


class _Deflate(NamedTuple):
    """Levels of libdeflate."""

    # Unfiltered indexed pixels: bytes relative to pngquant 2.17 with the same number of colors, mean of four
    # photographs of 0.4 megapixels, first without dithering at 256 colors, then with Floyd-Steinberg at 64; and time.
    #   zlib level 6       0.94, 1.03, 16 ms    level 9   0.93, 1.02, 31 ms
    #   libdeflate level 6 0.94, 1.04, 6 ms     level 10  0.86, 0.96, 50 to 75 ms    level 12 0.88, 0.96, 100 ms
    # For 12 megapixels level 6 takes 0.15 s, and level 10 over a second: long, as all else takes 0.5 s.
    # Flat areas are an exception: there the output of level 10 is larger than that of 9, and 12 gives the smallest.
    levels: tuple[int, int] = (10, 6)  # of small and of large images
    levels_of_flat: tuple[int, int] = (12, 9)
    large: int = 1 << 21
    likely: float = 1.5  # a form that has so many times the bytes of another at level 6 is not the smallest
    flat: float = 1 / 8  # largest compression ratio, at level 1, of an image that counts as flat
    # 16-bit color, four photographs of 0.4 megapixels: rows that choose between two filters, then libdeflate level 6,
    # take 0.98 of the bytes and 0.5 of the time of libpng with all five filters at level 3.
    level_of_deep: int = 6


_DEFLATE = _Deflate()


def decode_deep_png(file: BinaryIO, image: ImageFile.ImageFile, *, keep_profile: bool = False) -> NDArray[np.uint16]:
    """Read uint16 (H, W, 3), or (H, W, 4) with transparency; `image` is the same file opened with Pillow."""
    values = _all_bits(file, image)
    if values.shape[2] == 2:
        values = values[..., [0, 0, 0, 1]]
    clear = image.info.get("transparency")
    if clear is not None:
        opaque = (values != np.asarray(clear)).any(axis=2, keepdims=True)
        values = np.concatenate([values, opaque * np.uint16(65535)], axis=2)
    colors, icc = described(image.info), image.info.get("icc_profile")
    if colors is not None:
        values = colors.to_srgb(values)
    elif icc and "cicp" not in image.info and not keep_profile:
        values = convert_deep(values, icc)
    return upright(values, orientation(image))


def _all_bits(file: BinaryIO, image: ImageFile.ImageFile) -> NDArray[np.uint16]:
    """Decode (H, W, C) samples of 16 bits with Pillow, which keeps the upper bytes, or the lower ones if told."""
    raw = str(image.tile[0].args)
    if raw == "LA;16B":  # four bytes per pixel, as in RGBA
        image.tile = [image.tile[0]._replace(args="RGBA")]
        return np.array(image).view(">u2").astype(np.uint16)
    file.seek(0)
    with PngImageFile(file) as lower:
        lower.tile = [lower.tile[0]._replace(args=raw.replace(";16B", ";16L"))]
        values = np.asarray(lower).astype(np.uint16)
    values |= np.asarray(image).astype(np.uint16) << 8
    return values


def encode_deep_png(file: BinaryIO, values: NDArray[Any], chunks: bytes) -> None:
    """Write uint16 (H, W, 3) or (H, W, 4), with `chunks` before the pixels."""
    import deflate

    height, width, n_bands = values.shape
    samples = np.ascontiguousarray(values, ">u2").view(np.uint8).reshape(height, -1)
    left, above = samples.copy(), samples.copy()
    left[:, 2 * n_bands :] -= samples[:, : -2 * n_bands]
    above[1:] -= samples[:-1]
    rows = np.empty((height, 1 + samples.shape[1]), np.uint8)  # each row begins with its filter, 1 or 2
    nearer = _sizes(left) <= _sizes(above)
    rows[:, 0] = np.where(nearer, 1, 2)
    rows[:, 1:] = np.where(nearer[:, None], left, above)
    kind = _Kind.COLOR_AND_ALPHA if n_bands == 4 else _Kind.COLOR
    content = bytes(deflate.zlib_compress(rows.tobytes(), _DEFLATE.level_of_deep))
    _write_png(file, (width, height), 16, kind, chunks, content)


def _sizes(differences: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the sum of the absolute differences of each row, which small files keep small."""
    return np.minimum(differences, -differences).sum(axis=1, dtype=np.int64)


class _Form(NamedTuple):
    """A way to store an image."""

    kind: _Kind
    bits: int
    chunks: bytes  # before the pixels
    rows: bytes


def encode_indexed_png(
    file: BinaryIO, indices: NDArray[Any], palette: NDArray[np.uint8], chunks: bytes, *, smallest: bool = False
) -> None:
    """Write (H, W) indices into a (K, 3) or (K, 4) palette with the fewest bits; `chunks` precede the palette.

    If the `smallest` file is asked for, the same colors are written as gray or RGB, with or without alpha, where these
    take fewer bytes: as gradients and gray photographs do, whose neighbors differ little.
    """
    import deflate

    height, width = indices.shape
    large, forms = indices.size > _DEFLATE.large, [_indexed(indices, palette)]
    if smallest:
        opaque = not (palette[:, 3:] < 255).any()
        gray = b"iCCP" not in chunks and bool((palette[:, :1] == palette[:, 1:3]).all())
        bands = ([0] if gray else [0, 1, 2]) + ([] if opaque else [3])
        forms.append(_filtered(palette[:, bands][indices]))
    # Level 1 misses the long repetitions of filtered drawings, and tells too little of their size.
    sizes = [len(form.chunks) + len(deflate.zlib_compress(form.rows, 6)) for form in forms] if smallest else [0]
    written: list[tuple[_Form, bytes]] = []
    for form in (form for form, size in zip(forms, sizes, strict=True) if size <= _DEFLATE.likely * min(sizes)):
        flat = len(deflate.zlib_compress(form.rows, 1)) < _DEFLATE.flat * len(form.rows)
        level = (_DEFLATE.levels_of_flat if flat else _DEFLATE.levels)[large]
        written.append((form, bytes(deflate.zlib_compress(form.rows, level))))
    form, content = min(written, key=lambda one: len(one[0].chunks) + len(one[1]))
    _write_png(file, (width, height), form.bits, form.kind, chunks + form.chunks, content)


def _indexed(indices: NDArray[Any], palette: NDArray[np.uint8]) -> _Form:
    """Return indices with the fewest bits."""
    alphas = palette[:, 3:].tobytes().rstrip(b"\xff")
    if alphas.endswith(b"\0\n"):  # Pillow takes an alpha of 10 at the end for the end of a line
        if len(alphas) == len(palette):
            palette, indices = palette[::-1], len(palette) - 1 - indices.astype(np.intp)
        alphas = palette[: len(alphas) + 1, 3].tobytes()
    height, width = indices.shape
    bits = next(bits for bits in (1, 2, 4, 8) if len(palette) <= 1 << bits)
    rows = np.zeros((height, 1 + -(-width * bits // 8)), np.uint8)  # each row begins with its filter, 0 for none
    rows[:, 1:] = _packed(indices, bits)
    chunks = chunk(b"PLTE", palette[:, :3].tobytes()) + (chunk(b"tRNS", alphas) if alphas else b"")
    return _Form(_Kind.INDEXED, bits, chunks, rows.tobytes())


def encode_color_png(file: BinaryIO, pixels: NDArray[np.uint8], chunks: bytes) -> None:
    """Write (H, W) or (H, W, C) pixels in few bytes."""
    import deflate

    form = _filtered(pixels.reshape(*pixels.shape[:2], -1))
    level = _DEFLATE.levels_of_flat[pixels[..., :1].size > _DEFLATE.large]
    _write_png(file, pixels.shape[1::-1], 8, form.kind, chunks, bytes(deflate.zlib_compress(form.rows, level)))


def roughness(pixels: NDArray[np.uint8]) -> float:
    """Return the mean size of what filters leave of the (H, W, C) samples of an image, in levels."""
    rows = np.frombuffer(_filtered(pixels).rows, np.uint8).reshape(len(pixels), -1)
    return float(_sizes(rows[:, 1:]).sum() / pixels.size)


def _filtered(pixels: NDArray[np.uint8]) -> _Form:
    """Return (H, W, C) colors, each row with the filter that leaves the least differences (specification, 12.7)."""
    n_bands = pixels.shape[2]
    kind = {1: _Kind.GRAY, 2: _Kind.GRAY_AND_ALPHA, 3: _Kind.COLOR, 4: _Kind.COLOR_AND_ALPHA}[n_bands]
    samples = np.ascontiguousarray(pixels).reshape(len(pixels), -1)
    left, above, corner = (np.zeros_like(samples) for _ in range(3))
    left[:, n_bands:] = samples[:, :-n_bands]
    above[1:], corner[1:] = samples[:-1], left[:-1]
    ahead = above.astype(np.int16) - corner
    across, down = np.abs(ahead), np.abs(left.astype(np.int16) - corner)
    diagonal = np.abs(ahead + left - corner)
    nearest = np.where((across <= down) & (across <= diagonal), left, np.where(down <= diagonal, above, corner))
    mean = ((left.astype(np.uint16) + above) // 2).astype(np.uint8)
    ways = np.stack([samples, samples - left, samples - above, samples - mean, samples - nearest])
    best = np.stack([_sizes(way) for way in ways]).argmin(axis=0)
    rows = np.concatenate([best[:, None].astype(np.uint8), ways[best, np.arange(len(best))]], axis=1)
    return _Form(kind, 8, b"", rows.tobytes())


def _write_png(file: BinaryIO, size: tuple[int, int], bits: int, kind: int, chunks: bytes, content: bytes) -> None:
    """Write a PNG of deflated rows; `chunks` precede them."""
    file.write(PNG_MAGIC + chunk(b"IHDR", struct.pack(">IIBBBBB", *size, bits, kind, 0, 0, 0)) + chunks)
    file.write(chunk(b"IDAT", content) + chunk(b"IEND", b""))


def optimized(png: bytes, level: int = 4) -> bytes:
    """Recompress a PNG losslessly with oxipng, at the lowest level that sorts the palette."""
    content: bytes = optional("oxipng", "oxipng", "optimize needs").optimize_from_memory(png, level=level)
    return content


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
    return np.bitwise_or.reduce(padded << np.arange(8 - bits, -1, -bits, dtype=np.uint8), axis=2)
