"""Contents of palette files, their order, and parsing of colors given as text."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice
from cvtimg._shared.types import Bytes, Indices
from cvtimg.colors.spaces import to_depth, to_space
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
    pairs = zip(colors, codes, strict=True)
    ours = [len(code) == 9 and code[:7] == f"#{bytes(color[:3]).hex()}" for color, code in pairs]
    return [hex_color(code) for code in codes] if ours and all(ours) else colors


def color_order(
    palette: ArrayLike, by: Literal["share", "lightness", "hue"] = "share", *, density: ArrayLike
) -> Indices:
    """Return the order of the colors of a palette.

    Parameters
    ----------
    palette : (K, C) array
        Gray, RGB or RGBA colors.
    by : {"share", "lightness", "hue"}
        The largest share first; the darkest first; or around the circle of hues, after grays, colors of hardly any
        chroma, of which the hue says nothing.
    density : (K,) array
        Number of pixels of each color.

    Examples
    --------
    >>> from cvtimg.palettes import color_order
    >>> colors = np.array([[250, 10, 10], [128, 128, 128], [0, 0, 90]], np.uint8)
    >>> color_order(colors, "lightness", density=[5, 1, 9]).tolist(), color_order(colors, density=[5, 1, 9]).tolist()
    ([2, 1, 0], [2, 0, 1])
    """
    check_choice("by", by, ("share", "lightness", "hue"))
    if by == "share":
        return np.argsort(-np.asarray(density), kind="stable")
    colors = to_depth(np.asarray(palette), np.dtype(np.uint8))
    lightness, a, b = to_space(colors[:, [0, 0, 0] if colors.shape[1] < 3 else [0, 1, 2]], "oklab").T
    is_gray = np.hypot(a, b) < 0.04  # both are doubled: twice the least chroma that is seen
    hue = np.where(is_gray, -1, np.arctan2(b, a) % (2 * np.pi))
    return np.lexsort((lightness, hue)) if by == "hue" else np.argsort(lightness, kind="stable")
