"""JASC palettes (.pal) of Paint Shop Pro, Aseprite, GrafX2 and game engines; RIFF palettes are read as well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette, lines_of
from cvtimg.pictures.formats.opening import UnfitContentError

#: RIFF, size, "PAL data", size, version, number of colors.
_RIFF_HEADER = 24


def read(content: bytes) -> NDArray[np.uint8]:
    """Read ``red green blue`` or ``red green blue alpha`` from each line after the third."""
    if content[:4] == b"RIFF" and content[8:16] == b"PAL data":
        n_colors = int.from_bytes(content[22:24], "little")
        entries = np.frombuffer(content, np.uint8, 4 * n_colors, _RIFF_HEADER).reshape(-1, 4)
        return as_palette(entries[:, :3].tolist())
    lines = lines_of(content)
    if not lines or lines[0].strip() != "JASC-PAL":
        raise UnfitContentError("is not a JASC or RIFF palette: its first line must be 'JASC-PAL'")
    try:
        return as_palette([int(word) for word in line.split()] for line in lines[3:])
    except ValueError as error:
        if isinstance(error, UnfitContentError):
            raise
        raise UnfitContentError("has a line that is not three or four numbers") from None


def write(swatches: Swatches) -> bytes:
    """Write the colors, with alpha as a fourth number if the palette has transparency, as Aseprite does."""
    rows = (" ".join(map(str, color)) for color in swatches.colors.tolist())
    return "\r\n".join(["JASC-PAL", "0100", str(len(swatches.colors)), *rows, ""]).encode()
