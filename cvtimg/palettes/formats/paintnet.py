"""Palettes of paint.net (.txt): one ``aarrggbb`` per line, and comments after a semicolon."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette, hex_color, lines_of


def read(content: bytes) -> NDArray[np.uint8]:
    """Read the colors, with alpha unless all are opaque."""
    codes = [line.partition(";")[0].strip() for line in lines_of(content)]
    colors = [hex_color(code[2:] + code[:2] if len(code) == 8 else code) for code in codes if code]
    opaque = all(len(color) == 3 or color[3] == 255 for color in colors)
    return as_palette(color[:3] if opaque else color for color in colors)


def write(swatches: Swatches) -> bytes:
    """Write the colors. paint.net reads only the first 96."""
    rows = (f"{code[7:] or 'ff'}{code[1:7]}".upper() for code in swatches.hexes())
    return "\r\n".join(["; paint.net Palette File", f"; Palette Name: {swatches.name}", *rows, ""]).encode(
        "utf-8", "replace"
    )
