"""GIMP palettes (.gpl), also read by Inkscape, Krita and Aseprite. Alpha is stored only in color names."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette, lines_of, with_named_alpha
from cvtimg.pictures.formats.opening import UnfitContentError


def read(content: bytes) -> NDArray[np.uint8]:
    """Read the colors of a palette."""
    lines = lines_of(content)
    if not lines or lines[0].strip() != "GIMP Palette":
        raise UnfitContentError("is not a GIMP palette: its first line must be 'GIMP Palette'")
    n_bands = 4 if any(line.replace(" ", "") == "Channels:RGBA" for line in lines[:6]) else 3  # as in Aseprite
    colors, names = [], []
    for line in lines[1:]:
        if line.startswith(("#", "Name:", "Columns:", "Channels:")):
            continue
        words = line.split(maxsplit=n_bands)
        try:
            colors.append(tuple(int(word) for word in words[:n_bands]))
        except ValueError:
            raise UnfitContentError(f"has a line {line[:40]!r}, which must begin with {n_bands} numbers") from None
        names.append(words[n_bands] if len(words) > n_bands else "")
    return as_palette(with_named_alpha(colors, names))


def write(swatches: Swatches) -> bytes:
    """Write a named palette."""
    rows = (
        f"{red:3} {green:3} {blue:3}\t{code}"
        for (red, green, blue), code in zip(swatches.colors[:, :3].tolist(), swatches.hexes(), strict=True)
    )
    return "\n".join(["GIMP Palette", f"Name: {swatches.name}", "Columns: 16", "#", *rows, ""]).encode(
        "utf-8", "replace"
    )
