"""Palettes of Aseprite sprites (.aseprite, .ase); a palette is written as a sprite with one transparent pixel."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette
from cvtimg.pictures.formats.opening import UnfitContentError

#: Size of the file, magic number, frames, width, height, bits per pixel, flags, speed, number of colors, and padding.
_HEADER = struct.Struct("<IHHHHHIH8xB3xHBBhhHH84x")
#: Size of the frame, magic number, old number of chunks, duration, number of chunks.
_FRAME = struct.Struct("<IHHH2xI")
_CHUNK = struct.Struct("<IH")
_MAGIC, _FRAME_MAGIC = 0xA5E0, 0xF1FA
_OLD_PALETTE, _LAYER, _PALETTE = 0x0004, 0x2004, 0x2019


def is_sprite(content: bytes) -> bool:
    """Return whether a file is a sprite, not an Adobe Swatch Exchange file, which has the same suffix .ase."""
    return content[4:6] == _MAGIC.to_bytes(2, "little")


def read_aseprite(content: bytes) -> NDArray[np.uint8]:
    """Read the palette of the first frame, with alpha unless all colors are opaque."""
    if not is_sprite(content):
        raise UnfitContentError("is not an Aseprite sprite: it has the wrong magic number")
    chunks = dict(_chunks(content))
    if _PALETTE in chunks:
        colors = list(_entries(chunks[_PALETTE]))
    elif _OLD_PALETTE in chunks:
        colors = list(_old_entries(chunks[_OLD_PALETTE]))
    else:
        raise UnfitContentError("has no palette")
    opaque = all(color[3] == 255 for color in colors)
    return as_palette(color[:3] if opaque else color for color in colors)


def _chunks(content: bytes) -> Iterator[tuple[int, bytes]]:
    at = _HEADER.size
    size, magic, old_count, _, count = _FRAME.unpack_from(content, at)
    if magic != _FRAME_MAGIC or at + size > len(content):
        raise EOFError("the first frame is cut off")
    at += _FRAME.size
    for _ in range(count or old_count):
        size, kind = _CHUNK.unpack_from(content, at)
        if size < _CHUNK.size:
            raise UnfitContentError("has a chunk without content")
        yield kind, content[at + _CHUNK.size : at + size]
        at += size


def _entries(chunk: bytes) -> Iterator[tuple[int, ...]]:
    _, first, last = struct.unpack_from("<III", chunk)
    at = 20
    for _ in range(first, last + 1):
        has_name, *color = struct.unpack_from("<HBBBB", chunk, at)
        at += 6
        if has_name & 1:
            at += 2 + int.from_bytes(chunk[at : at + 2], "little")
        yield tuple(color)


def _old_entries(chunk: bytes) -> Iterator[tuple[int, ...]]:
    at = 2
    for _ in range(int.from_bytes(chunk[:2], "little")):
        count = chunk[at + 1] or 256
        rows = np.frombuffer(chunk, np.uint8, 3 * count, at + 2).reshape(-1, 3)
        yield from ((*row, 255) for row in rows.tolist())
        at += 2 + 3 * count


def write_aseprite(swatches: Swatches) -> bytes:
    """Write a sprite with one transparent pixel and the palette."""
    n_colors = len(swatches.colors)
    rgba = ((*color, 255)[:4] for color in swatches.colors.tolist())
    palette = struct.pack("<III8x", n_colors, 0, n_colors - 1) + b"".join(struct.pack("<H4B", 0, *one) for one in rgba)
    name = swatches.name.encode("utf-8", "replace")
    layer = struct.pack("<HHHHHHB3x", 3, 0, 0, 0, 0, 0, 255) + struct.pack("<H", len(name)) + name
    chunks = b"".join(
        _CHUNK.pack(_CHUNK.size + len(chunk), kind) + chunk for kind, chunk in ((_PALETTE, palette), (_LAYER, layer))
    )
    frame = _FRAME.pack(_FRAME.size + len(chunks), _FRAME_MAGIC, 2, 100, 2) + chunks
    size = _HEADER.size + len(frame)
    # Indexed color holds 256 colors.
    bits = 8 if n_colors <= 256 else 32
    counted = min(n_colors, 256)
    return _HEADER.pack(size, _MAGIC, 1, 1, 1, bits, 1, 100, 0, counted, 1, 1, 0, 0, 16, 16) + frame
