"""Plain text with one ``rrggbb`` per line, as on Lospec; ``rrggbbaa`` if the palette has transparency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette, hex_color, lines_of


def read(content: bytes) -> NDArray[np.uint8]:
    """Read a color from each line, with or without a leading ``#``."""
    return as_palette(hex_color(line) for line in lines_of(content))


def write(swatches: Swatches) -> bytes:
    """Write the colors."""
    return "".join(f"{code[1:]}\n" for code in swatches.hexes()).encode()
