"""The content that formats of contours draw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg.labels.contours import Polygon


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """Contours, and what formats can tell about them.

    Attributes
    ----------
    polygons : tuple of Polygon
        Those of `Contours`, by label.
    size : (int, int)
        Height and width of the image.
    colors : (max label + 1, 3) uint8 array
        Color of each label.
    properties : mapping of int to mapping
        Properties of each label.
    transform : (2, 3) array, optional
        Maps (x, y, 1) in pixels to coordinates on a map.
    epsg : int, optional
        Code of the coordinate system of that map.
    """

    polygons: tuple[Polygon, ...]
    size: tuple[int, int]
    colors: NDArray[np.uint8]
    properties: Mapping[int, Mapping[str, Any]]
    transform: ArrayLike | None = None
    epsg: int | None = None
