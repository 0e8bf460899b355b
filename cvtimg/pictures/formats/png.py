"""PNG beyond Pillow: color with 16 bits per band, and files of fewer bytes."""

import struct
import zlib
from collections.abc import Sequence
from functools import lru_cache
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFile
from PIL.PngImagePlugin import PngImageFile

from cvtimg._shared.types import Array, Bytes, Ints64
from cvtimg.pictures.formats.arrays import upright
from cvtimg.pictures.formats.opening import orientation
from cvtimg.pictures.formats.png_chunks import PNG_MAGIC, chunk, chunks_of, described
from cvtimg.pictures.profiles import convert_deep


class _Deflate(NamedTuple):
    # Unfiltered indexed pixels: bytes relative to pngquant 2.17 with the same number of colors, mean of four
    # photographs of 0.4 megapixels, first without dithering at 256 colors, then with Floyd-Steinberg at 64; and time.
    #   zlib level 6       0.94, 1.03, 16 ms    level 9   0.93, 1.02, 31 ms
    #   libdeflate level 6 0.94, 1.04, 6 ms     level 10  0.86, 0.96, 50 to 75 ms    level 12 0.88, 0.96, 100 ms
    # For 12 megapixels level 6 takes 0.15 s, and level 10 over a second: long, as all else takes 0.5 s.
    # Flat areas are an exception: there the output of level 10 is larger than that of 9, and 12 gives the smallest.
    levels: tuple[int, int] = (10, 6)  # of small and of large images
    levels_of_flat: tuple[int, int] = (12, 9)
    large: int = 1 << 21
    likely: float = 1.2  # times the bytes of another form at level 6: such a form is not the smallest
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


class _Form(NamedTuple):
    """A way to store an image, as Pillow does: all chunks before the pixels, and rows that begin with their filters."""

    head: list[tuple[bytes, bytes]]
    rows: bytes

    @classmethod
    def of(cls, image: Image.Image, **options: Any) -> Self:
        """Let Pillow filter an image, and describe it by the options of its `save`."""
        buffer = BytesIO()
        image.save(buffer, "PNG", compress_level=0, **options)
        chunks = chunks_of(buffer.getvalue())
        pixels = b"".join(data for name, data in chunks if name == b"IDAT")
        return cls(chunks[: [name for name, _ in chunks].index(b"IDAT")], zlib.decompress(pixels))

    def png(self, pixels: bytes) -> bytes:
        """Return the file, of deflated rows."""
        chunks = *self.head, (b"IDAT", pixels), (b"IEND", b"")
        return PNG_MAGIC + b"".join(chunk(name, data) for name, data in chunks)

    def of_indices(self, image: Image.Image) -> list[Self]:
        """Return the forms of an indexed image: the same without filters, and with them, which suits fine texture."""
        n_bits, packed = self.head[0][1][8], np.asarray(image)
        if n_bits < 8:
            bits = np.unpackbits(packed[..., None], axis=2)[..., -n_bits:]
            packed = np.packbits(bits.reshape(image.height, -1), axis=1)
        plain = self._replace(rows=np.pad(packed, ((0, 0), (1, 0))).tobytes())
        few = n_bits < 8 or packed.size <= _DEFLATE.large
        return [plain, self._replace(rows=self.of(Image.fromarray(packed)).rows)] if few else [plain]


def deep_png(values: NDArray[np.uint16], **options: Any) -> bytes:
    """Encode uint16 (H, W, 3) or (H, W, 4), described by the options of Pillow's `save`."""
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
    (name, header), *others = _Form.of(Image.fromarray(values[:1, :1].astype(np.uint8)), **options).head
    head = [(name, struct.pack(">IIB", width, height, 16) + header[9:]), *others]
    return _Form(head, b"").png(bytes(deflate.zlib_compress(rows.tobytes(), _DEFLATE.level_of_deep)))


def _sizes(differences: Bytes) -> Ints64:
    """Return the sum of the absolute differences of each row, which small files keep small."""
    return np.minimum(differences, -differences).sum(axis=1, dtype=np.int64)


def small_png(images: Sequence[Image.Image], **options: Any) -> bytes:
    """Encode the one of images of equal colors that takes the fewest bytes, and describe it as Pillow's `save` does."""
    import deflate

    large, forms = images[0].width * images[0].height > _DEFLATE.large, list[_Form]()
    for image in images:
        form = _Form.of(image, **options)
        forms += form.of_indices(image) if image.mode == "P" else [form]
    # Level 1 misses the long repetitions of filtered drawings, and tells too little of their size.
    sizes = [0]
    if forms[1:]:
        sizes = [sum(len(data) for _, data in form.head) + len(deflate.zlib_compress(form.rows, 6)) for form in forms]
    first = forms[sizes.index(min(sizes))]
    if len(deflate.zlib_compress(first.rows, 1)) < _DEFLATE.flat * len(first.rows):
        level, likely = _DEFLATE.levels_of_flat[large], [first]  # this takes long
    else:
        level = _DEFLATE.levels[large]
        likely = [form for form, size in zip(forms, sizes, strict=True) if size <= _DEFLATE.likely * min(sizes)]
    return min((form.png(_deflated(form.rows, level)) for form in likely), key=len)


@lru_cache(maxsize=3)  # a search that compares sizes writes one of its last candidates
def _deflated(rows: bytes, level: int) -> bytes:
    import deflate

    return bytes(deflate.zlib_compress(rows, level))


def indexed(indices: Array, palette: Bytes) -> Image.Image:
    """Return (H, W) indices into a (K, 3) or (K, 4) palette, of which Pillow stores the fewest bits."""
    alphas = palette[:, 3:].tobytes().rstrip(b"\xff")
    if alphas.endswith(b"\0\n"):  # Pillow takes an alpha of 10 at the end for the end of a line
        if len(alphas) == len(palette):
            palette, indices = palette[::-1], len(palette) - 1 - indices.astype(np.intp)
        alphas = palette[: len(alphas) + 1, 3].tobytes()
    image = Image.fromarray(np.ascontiguousarray(indices, np.uint8))
    image.putpalette(palette[:, :3].tobytes())
    if alphas:
        image.info["transparency"] = alphas
    return image


def roughness(pixels: Bytes) -> float:
    """Return the mean size of what filters leave of the (H, W, C) samples of an image, in levels."""
    rows = np.frombuffer(_Form.of(Image.fromarray(pixels.squeeze())).rows, np.uint8).reshape(len(pixels), -1)
    return float(_sizes(rows[:, 1:]).sum() / pixels.size)
