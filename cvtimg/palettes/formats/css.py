"""CSS custom properties for style sheets: ``--name-1: #rrggbb;`` and so on."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette, css_color
from cvtimg.pictures.formats.opening import UnfitContentError

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_PROPERTY = re.compile(r"--[\w-]+\s*:\s*(#[0-9a-fA-F]+|[a-zA-Z]+)\s*(?=[;}]|$)")


def read(content: bytes) -> NDArray[np.uint8]:
    """Read the custom properties of any rule that are colors, as ``#rrggbb`` or by name."""
    text = _COMMENT.sub("", content.decode("utf-8-sig", "replace"))
    return as_palette(color for code in _PROPERTY.findall(text) if (color := _color(code)))


def _color(code: str) -> tuple[int, ...] | None:
    """Parse a color; None for other keywords, such as ``auto``."""
    try:
        return css_color(code)
    except UnfitContentError:
        if code.startswith("#"):
            raise
        return None


def write(swatches: Swatches) -> bytes:
    """Write the colors in one ``:root`` rule."""
    name = re.sub(r"[^a-z0-9]+", "-", swatches.name.lower()).strip("-") or "color"
    rows = (f"  --{name}-{number}: {code};\n" for number, code in enumerate(swatches.hexes(), 1))
    return f":root {{\n{''.join(rows)}}}\n".encode()
