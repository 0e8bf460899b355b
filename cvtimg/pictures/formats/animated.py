"""Assemble GIF, APNG and WebP animations from frames with their own durations and pixels; and read frames of GIF.

Pillow compresses the frames but does not assemble them, because it would merge equal frames and choose its own
palettes; and it would fill what frames do not cover with a color of the palette.
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from io import BytesIO
from typing import BinaryIO, NamedTuple

import numpy as np
from PIL import GifImagePlugin, Image
from PIL.GifImagePlugin import GifImageFile

from cvtimg._shared.choices import Arguments
from cvtimg._shared.types import Array, Bools, Bytes
from cvtimg.pictures.formats.encoding import encode_image
from cvtimg.pictures.formats.metadata import Metadata
from cvtimg.pictures.formats.png_chunks import PNG_MAGIC, chunk, chunks_of

_MOST = 0xFFFF  # of two bytes
# Of GIF: what begins a block, and ways to dispose of a frame before the next.
_EXTENSION, _IMAGE, _CONTROL, _END = 0x21, 0x2C, 0xF9, 0x3B
_CLEARED, _RESTORED = 2, 3


class Cel(NamedTuple):
    """One frame: (H, W) palette indices, or (H, W), (H, W, 3) or (H, W, 4) pixels without a palette."""

    pixels: Array
    palette: Bytes | None

    @property
    def image(self) -> Array:
        """Pixels of the frame, (H, W, ...)."""
        return self.pixels if self.palette is None else self.palette[self.pixels]


class _Box(NamedTuple):
    place: tuple[slice, slice]
    left: int
    top: int
    size: tuple[int, int]


def _box(wanted: Bools, step: int = 1) -> _Box:
    """Return the bounding box of the true pixels, or one pixel; left and top are multiples of `step`."""
    ranges = [np.flatnonzero(wanted.any(axis=axis)) if wanted.any() else np.zeros(1, int) for axis in (1, 0)]
    (top, bottom), (left, right) = ((int(ends[0]) // step * step, int(ends[-1]) + 1) for ends in ranges)
    return _Box((slice(top, bottom), slice(left, right)), left, top, (right - left, bottom - top))


def _changes(cels: Sequence[Cel]) -> Iterator[Bools]:
    before: Array | None = None
    for cel in cels:
        image = cel.image
        moved = np.ones(image.shape, bool) if before is None else np.asarray(image != before, bool)
        yield np.any(moved.reshape(*image.shape[:2], -1), axis=2)
        before = image


def write_gif(file: BinaryIO, cels: Sequence[Cel], durations: Sequence[float], plays: int, _: Metadata) -> None:
    """Write frames with at most 256 colors each, without partial transparency."""
    palettes = [cel.palette for cel in cels if cel.palette is not None]
    if len(palettes) < len(cels):
        raise ValueError(".gif holds frames of at most 256 colors, each an index into a palette")
    if any(((palette[:, 3:] > 0) & (palette[:, 3:] < 255)).any() for palette in palettes):
        raise ValueError(".gif cannot hold half transparency; use one of .png, .webp")
    height, width = cels[0].pixels.shape
    shared = all(palette is palettes[0] for palette in palettes)
    table = _gif_table(palettes[0]) if shared else b""
    packed = 0x70 | (0x80 | (len(table) // 3).bit_length() - 2 if shared else 0)
    file.write(b"GIF89a" + struct.pack("<HHBBB", width, height, packed, 0, 0) + table)
    if plays != 1:
        file.write(b"!\xff\x0bNETSCAPE2.0\x03\x01" + struct.pack("<H", min(max(plays - 1, 0), _MOST)) + b"\0")
    clears = any((cel.image[..., 3:] == 0).any() for cel in cels)
    disposal = 2 if clears else 1  # to clear a frame before drawing the next, or to keep it
    for cel, changed, length in zip(cels, _changes(cels), _whole(durations, 10, _MOST), strict=True):
        options = {"duration": 10 * length, "disposal": disposal, "include_color_table": not shared}
        file.write(b"".join(_gif_frame(cel, changed, clears, options)))
    file.write(b";")


def _gif_table(palette: Bytes) -> bytes:
    """Return the color table, with a spare entry for unchanged pixels if there is room, padded to a power of two."""
    n_entries = min(len(palette) + 1, 256)
    return palette[:, :3].tobytes().ljust(3 << (n_entries - 1).bit_length(), b"\0")


def _gif_frame(cel: Cel, changed: Bools, clears: bool, options: Arguments) -> list[bytes]:
    """Encode a frame: the pixels that changed, or all visible pixels if the animation has transparency."""
    palette = np.empty((0, 3), np.uint8) if cel.palette is None else cel.palette
    box = _box(cel.image[..., 3] > 0 if clears else changed)
    shown, moved = cel.pixels[box.place], changed[box.place]
    clear = np.flatnonzero(palette[:, 3] == 0) if clears else np.empty(0, int)
    if len(clear):
        shown, options["transparency"] = np.where(np.isin(shown, clear), clear[0], shown), int(clear[0])
    forms = [(shown, options)]
    if not clears and len(palette) < 256 and not moved.all():
        # Marking unchanged pixels as transparent compresses better than repeating their colors, unless they are few.
        forms.append((np.where(moved, shown, len(palette)), {**options, "transparency": len(palette)}))
    frames = []
    for pixels, told in forms:
        picture = Image.fromarray(np.ascontiguousarray(pixels, np.uint8))
        picture.putpalette(_gif_table(palette))
        frames.append(GifImagePlugin.getdata(picture, (box.left, box.top), **told))
    return min(frames, key=lambda parts: sum(map(len, parts)))


def write_apng(file: BinaryIO, cels: Sequence[Cel], durations: Sequence[float], plays: int, metadata: Metadata) -> None:
    """Write frames that share one palette, or have none."""
    height, width = cels[0].pixels.shape[:2]
    number = 0
    for cel, changed, duration in zip(cels, _changes(cels), durations, strict=True):
        box = _box(changed if number else np.ones((height, width), bool))
        chunks = chunks_of(encode_image(".png", cel.pixels[box.place], palette=cel.palette, metadata=metadata))
        if not number:
            file.write(PNG_MAGIC)
            for name, data in chunks[: [name for name, _ in chunks].index(b"IDAT")]:
                file.write(chunk(name, data))
            file.write(chunk(b"acTL", struct.pack(">II", len(cels), plays)))
        control = struct.pack(">IIIII", number, *box.size, box.left, box.top)
        file.write(chunk(b"fcTL", control + struct.pack(">HHBB", *_seconds(duration), 0, 0)))
        pixels = b"".join(data for name, data in chunks if name == b"IDAT")
        if number:
            number += 1
            file.write(chunk(b"fdAT", struct.pack(">I", number) + pixels))
        else:
            file.write(chunk(b"IDAT", pixels))
        number += 1
    file.write(chunk(b"IEND", b""))


def _seconds(duration: float) -> tuple[int, int]:
    """Return a duration in milliseconds as a fraction of seconds, with 16-bit numerator and denominator."""
    seconds = Fraction(duration) / 1000
    near = seconds.limit_denominator(_MOST if seconds <= 1 else max(1, int(_MOST / seconds)))
    return min(near.numerator, _MOST), near.denominator


def write_webp(file: BinaryIO, cels: Sequence[Cel], durations: Sequence[float], plays: int, metadata: Metadata) -> None:
    """Write frames with any colors, losslessly."""
    height, width = cels[0].pixels.shape[:2]
    alpha = any(cel.image.ndim == 3 and cel.image.shape[2] == 4 for cel in cels)
    kept = metadata.options("WEBP", "RGB", ("icc_profile", "exif"))
    flags = 0x02 | 0x10 * alpha | 0x20 * ("icc_profile" in kept) | 0x08 * ("exif" in kept)
    body = _riff(b"VP8X", bytes([flags, 0, 0, 0]) + _three(width - 1) + _three(height - 1))
    if "icc_profile" in kept:
        body += _riff(b"ICCP", kept["icc_profile"])
    body += _riff(b"ANIM", struct.pack("<IH", 0, min(plays, _MOST)))
    for cel, changed, length in zip(cels, _changes(cels), _whole(durations, 1, (1 << 24) - 1), strict=True):
        box = _box(changed, step=2)
        picture = encode_image(".webp", np.ascontiguousarray(cel.image[box.place]))
        frame = b"".join(map(_three, (box.left // 2, box.top // 2, box.size[0] - 1, box.size[1] - 1, length)))
        replaces = b"\x02"  # replace the pixels below instead of blending
        body += _riff(b"ANMF", frame + replaces + picture[12:])
    if "exif" in kept:
        body += _riff(b"EXIF", kept["exif"].removeprefix(b"Exif\0\0"))
    file.write(b"RIFF" + struct.pack("<I", 4 + len(body)) + b"WEBP" + body)


def _riff(name: bytes, data: bytes) -> bytes:
    return name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)


def _three(value: int) -> bytes:
    return value.to_bytes(3, "little")


def _whole(durations: Sequence[float], unit: float, most: int) -> list[int]:
    """Round durations to whole units such that rounding errors do not accumulate."""
    ends = np.rint(np.cumsum(durations) / unit)
    return [min(int(length), most) for length in np.diff(ends, prepend=0)]


#: Writers by suffix.
FRAME_WRITERS: dict[str, Callable[[BinaryIO, Sequence[Cel], Sequence[float], int, Metadata], None]] = {
    ".gif": write_gif,
    ".png": write_apng,
    ".webp": write_webp,
}


class _Part(NamedTuple):
    """A frame as a file of its own, its place on the canvas, and what follows it."""

    file: bytes
    left: int
    top: int
    disposal: int


def composed(file: BinaryIO) -> Iterator[Bytes]:
    """Yield each frame of an open GIF as browsers show it: the clear canvas (H, W, 4) with all frames so far."""
    file.seek(0)
    content = file.read()
    width, height = (int.from_bytes(content[at : at + 2], "little") for at in (6, 8))
    canvas = np.zeros((height, width, 4), np.uint8)
    for part in _parts(content):
        with GifImageFile(BytesIO(part.file)) as image:
            shown = np.asarray(image.convert("RGBA"))
        shown = shown[: max(height - part.top, 0), : max(width - part.left, 0)]  # browsers cut frames at the canvas
        place = np.s_[part.top : part.top + shown.shape[0], part.left : part.left + shown.shape[1]]
        before = canvas
        canvas = canvas.copy()
        canvas[place] = np.where(shown[..., 3:] > 0, shown, canvas[place])
        yield canvas
        if part.disposal == _RESTORED:
            canvas = before
        elif part.disposal == _CLEARED:
            canvas = canvas.copy()
            canvas[place] = 0


def _parts(content: bytes) -> Iterator[_Part]:
    table_end = 13 + _table_size(content[10])
    at, control = table_end, b""
    while at < len(content) and content[at] != _END:
        if content[at] == _EXTENSION:
            stop = _after_blocks(content, at + 2)
            control = content[at:stop] if content[at + 1 : at + 2] == bytes([_CONTROL]) else control
        elif content[at] == _IMAGE:
            stop = _after_blocks(content, at + 11 + _table_size(content[at + 9]))
            left, top = (int.from_bytes(content[place : place + 2], "little") for place in (at + 1, at + 3))
            head = b"GIF89a" + content[at + 5 : at + 9] + content[10:table_end]
            body = content[at : at + 1] + bytes(4) + content[at + 5 : stop]
            yield _Part(head + control + body + bytes([_END]), left, top, control[3] >> 2 & 7 if control else 0)
            control = b""
        else:
            stop = at + 1  # as decoders do, go on to what is known
        at = stop


def _table_size(flags: int) -> int:
    """Return the bytes of the color table that flags tell of."""
    return 3 << (flags & 7) + 1 if flags & 0x80 else 0


def _after_blocks(content: bytes, at: int) -> int:
    """Return the place behind blocks of data, of which the last is empty."""
    while at < len(content) and content[at]:
        at += 1 + content[at]
    return at + 1
