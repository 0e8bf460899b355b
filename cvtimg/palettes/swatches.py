"""Contents of palette files, and parsing of colors given as text."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cvtimg._shared.types import Bytes
from cvtimg.pictures.formats.opening import UnfitContentError


@dataclass(frozen=True, slots=True, eq=False)
class Swatches:
    """(K, 3) or (K, 4) uint8 colors, with the fraction of pixels of each where it is known."""

    name: str
    colors: Bytes
    shares: list[float] | None

    def hexes(self) -> list[str]:
        """Return each color as ``#rrggbb``, or as ``#rrggbbaa`` if the palette has transparency."""
        return [f"#{color.tobytes().hex()}" for color in self.colors]


def as_palette(rows: Iterable[Iterable[int]]) -> Bytes:
    """Return (K, 3) uint8, or (K, 4) if any color has alpha; colors without alpha are then opaque."""
    colors = [tuple(row) for row in rows]
    if not colors:
        raise UnfitContentError("has no colors")
    for color in colors:
        if len(color) not in (3, 4) or not all(0 <= value <= 255 for value in color):
            raise UnfitContentError(f"has a color {color}, which must be three or four numbers in 0..255")
    if any(len(color) == 4 for color in colors):
        colors = [(*color, 255)[:4] for color in colors]
    return np.array(colors, np.uint8)


def hex_color(text: str) -> tuple[int, ...]:
    """Parse ``rrggbb``, ``rrggbbaa``, ``rgb`` or ``rgba``, with or without a leading ``#``."""
    digits = text.strip().removeprefix("#")
    if len(digits) in (3, 4):
        digits = "".join(2 * digit for digit in digits)
    if len(digits) not in (6, 8) or not all(digit in "0123456789abcdefABCDEF" for digit in digits):
        raise UnfitContentError(f"has a color {text.strip()[:40]!r}, which must be like #rrggbb or #rrggbbaa")
    return tuple(bytes.fromhex(digits))


def lines_of(content: bytes) -> list[str]:
    """Return the nonempty lines of a text file; invalid UTF-8 is replaced."""
    return [line for line in content.decode("utf-8-sig", "replace").splitlines() if line.strip()]


def with_named_alpha(colors: list[tuple[int, ...]], names: Iterable[str]) -> list[tuple[int, ...]]:
    """Read alpha from color names ``#rrggbbaa``, where `write_palette` stores it in formats without transparency."""
    codes = [name.strip().lower() for name in names]
    ours = [
        len(code) == 9 and code[:7] == f"#{bytes(color[:3]).hex()}" for color, code in zip(colors, codes, strict=True)
    ]
    return [hex_color(code) for code in codes] if ours and all(ours) else colors
