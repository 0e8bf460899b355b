"""JSON palettes: ``{"name": ..., "colors": [{"hex": "#rrggbb", "rgb": [r, g, b], "share": ...}, ...]}``."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.swatches import Swatches, as_palette, hex_color
from cvtimg.pictures.formats.opening import UnfitContentError


def read(content: bytes) -> NDArray[np.uint8]:
    """Read files written by cvtimg, and lists of ``"#rrggbb"`` or ``[r, g, b]``."""
    value = json.loads(content)
    entries = value.get("colors") if isinstance(value, dict) else value
    if not isinstance(entries, list):
        raise UnfitContentError("must have a list of colors, or one called 'colors'")
    return as_palette(_color(entry) for entry in entries)


def _color(entry: Any) -> tuple[int, ...]:
    if isinstance(entry, dict):
        entry = (
            entry["hex"] if "hex" in entry else [*entry.get("rgb", ()), *([entry["alpha"]] if "alpha" in entry else [])]
        )
    if isinstance(entry, str):
        return hex_color(entry)
    if not isinstance(entry, list) or not all(isinstance(one, int) for one in entry):
        raise UnfitContentError(f"has a color {str(entry)[:40]}, which must be like '#rrggbb' or [r, g, b]")
    return tuple(entry)


def write(swatches: Swatches) -> bytes:
    """Write the colors, and the share of each if it is known."""
    entries: list[dict[str, Any]] = []
    for number, (color, code) in enumerate(zip(swatches.colors.tolist(), swatches.hexes(), strict=True)):
        entry: dict[str, Any] = {"hex": code, "rgb": color[:3]}
        if len(color) == 4:
            entry["alpha"] = color[3]
        if swatches.shares is not None:
            entry["share"] = swatches.shares[number]
        entries.append(entry)
    # One line per color is easy to read and to diff.
    lines = ",\n".join("    " + json.dumps(entry) for entry in entries)
    return f'{{\n  "name": {json.dumps(swatches.name)},\n  "colors": [\n{lines}\n  ]\n}}\n'.encode()
