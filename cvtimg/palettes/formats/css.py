"""Custom properties of CSS: ``--name-1: #rrggbb;`` and so on, for a style sheet."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette, css_color
from cvtimg.pictures.formats.opening import UnfitContentError

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_PROPERTY = re.compile(r"--[\w-]+\s*:\s*(#[0-9a-fA-F]+|[a-zA-Z]+)\s*(?=[;}]|$)")


def read(content: bytes) -> NDArray[np.uint8]:
    """Read the custom properties that are colors, as ``#rrggbb`` or by name, whatever rule they are in."""
    text = _COMMENT.sub("", content.decode("utf-8-sig", "replace"))
    return as_palette(color for code in _PROPERTY.findall(text) if (color := _color(code)))


def _color(code: str) -> tuple[int, ...] | None:
    """Read a color; None for another word, such as ``auto``."""
    try:
        return css_color(code)
    except UnfitContentError:
        if code.startswith("#"):
            raise
        return None


def write(swatches: Swatches) -> bytes:
    """Write one rule, ``:root``."""
    name = re.sub(r"[^a-z0-9]+", "-", swatches.name.lower()).strip("-") or "color"
    rows = (f"  --{name}-{number}: {code};\n" for number, code in enumerate(swatches.hexes(), 1))
    return f":root {{\n{''.join(rows)}}}\n".encode()
