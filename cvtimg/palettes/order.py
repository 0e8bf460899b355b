"""The order of colors in a palette."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice
from cvtimg._shared.types import Indices
from cvtimg.colors.spaces import to_depth, to_space

_RULES = ("share", "lightness", "hue")


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
    check_choice("by", by, _RULES)
    if by == "share":
        return np.argsort(-np.asarray(density), kind="stable")
    colors = to_depth(np.asarray(palette), np.dtype(np.uint8))
    lightness, a, b = to_space(colors[:, [0, 0, 0] if colors.shape[1] < 3 else [0, 1, 2]], "oklab").T
    is_gray = np.hypot(a, b) < 0.04  # both are doubled: twice the least chroma that is seen
    hue = np.where(is_gray, -1, np.arctan2(b, a) % (2 * np.pi))
    return np.lexsort((lightness, hue)) if by == "hue" else np.argsort(lightness, kind="stable")
