"""Frames of a GIF as browsers show them: on a clear canvas, to which what a frame disposes of returns.

Pillow, which decodes each frame, would fill what frames do not cover with a color of the palette.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO, NamedTuple

import numpy as np
from PIL.GifImagePlugin import GifImageFile

from cvtimg._shared.types import Bytes

_EXTENSION, _IMAGE, _CONTROL, _END = 0x21, 0x2C, 0xF9, 0x3B
_CLEARED, _RESTORED = 2, 3  # ways to dispose of a frame before the next


class _Part(NamedTuple):
    """A frame as a file of its own, its place on the canvas, and what follows it."""

    file: bytes
    left: int
    top: int
    disposal: int


def composed(file: BinaryIO) -> Iterator[Bytes]:
    """Yield the canvas (H, W, 4) of each frame of an open GIF."""
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
    """Yield each frame of a file."""
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
