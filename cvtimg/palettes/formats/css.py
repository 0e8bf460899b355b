"""Custom properties of CSS: ``--name-1: #rrggbb;`` and so on, for a style sheet."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette, hex_color

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_PROPERTY = re.compile(r"--[\w-]+\s*:\s*(#[0-9a-fA-F]+)\s*(?=[;}]|$)")


def read(content: bytes) -> NDArray[np.uint8]:
    """Read the custom properties that are colors as ``#rrggbb``, whatever rule they are in."""
    text = _COMMENT.sub("", content.decode("utf-8-sig", "replace"))
    return as_palette(hex_color(code) for code in _PROPERTY.findall(text))


def write(swatches: Swatches) -> bytes:
    """Write one rule, ``:root``."""
    name = re.sub(r"[^a-z0-9]+", "-", swatches.name.lower()).strip("-") or "color"
    rows = (f"  --{name}-{number}: {code};\n" for number, code in enumerate(swatches.hexes(), 1))
    return f":root {{\n{''.join(rows)}}}\n".encode()
