"""Adobe color tables (.act): 256 RGB triples, then the number of colors in use and the transparent index."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches
from cvtimg.pictures.formats.opening import UnfitContentError

_ENTRIES = 256
_TABLE = 3 * _ENTRIES
_TAIL = struct.Struct(">HH")
_NONE_CLEAR = 0xFFFF


def read(content: bytes) -> NDArray[np.uint8]:
    """Read the colors in use."""
    if len(content) not in (_TABLE, _TABLE + _TAIL.size):
        raise UnfitContentError(f"has {len(content)} bytes; a color table must have 768 or 772")
    table = np.frombuffer(content[:_TABLE], np.uint8).reshape(-1, 3)
    n_colors, clear = _TAIL.unpack(content[_TABLE:]) if len(content) > _TABLE else (_ENTRIES, _NONE_CLEAR)
    n_colors = n_colors or _ENTRIES  # some programs write 0 for all
    if n_colors > _ENTRIES:
        raise UnfitContentError(f"declares {n_colors} colors; a color table has at most 256")
    if clear >= n_colors:
        return table[:n_colors].copy()
    alpha = np.where(np.arange(n_colors) == clear, 0, 255).astype(np.uint8)
    return np.column_stack([table[:n_colors], alpha])


def write(swatches: Swatches) -> bytes:
    """Write at most 256 colors, at most one fully transparent and none partially transparent."""
    colors = swatches.colors
    if len(colors) > _ENTRIES:
        raise ValueError(f".act holds at most 256 colors, and these are {len(colors)}")
    clear = np.flatnonzero(colors[:, 3] < 255) if colors.shape[1] == 4 else np.empty(0, int)
    if len(clear) > 1 or (len(clear) and colors[clear[0], 3]):
        raise ValueError(".act holds one clear color, and no half transparent ones")
    table = np.zeros((_ENTRIES, 3), np.uint8)
    table[: len(colors)] = colors[:, :3]
    return table.tobytes() + _TAIL.pack(len(colors), clear[0] if len(clear) else _NONE_CLEAR)
