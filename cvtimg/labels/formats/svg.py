"""Contours as SVG: drawings for browsers, vector editors and plotters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg._shared.svg import drawing as svg_drawing
from cvtimg._shared.svg import hexadecimal, numbers
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.contours import Polygon
from cvtimg.labels.formats import PLACE_DIGITS, Drawing


def write(path: StrPath, drawings: Sequence[Drawing], overwrite: bool) -> None:
    """Write the polygons of a drawing in its colors."""
    check_that(f"{path}: {len(drawings)} pages", len(drawings) == 1, "be one, which .svg holds")
    (drawing,) = drawings
    write_svg(path, drawing.polygons, drawing.colors, size=drawing.size, overwrite=overwrite)


def write_svg(
    path: StrPath,
    polygons: Iterable[Polygon],
    colors: NDArray[np.uint8],
    *,
    size: tuple[int, int],
    overwrite: bool = False,
) -> None:
    """Write polygons as an SVG drawing with one path per label; holes are left open.

    Parameters
    ----------
    path : str or path-like
        Ends in .svg.
    polygons : iterable of Polygon
        Polygons of `Contours`, by label.
    colors : (max label + 1, 3) uint8 array
        Color of each label.
    size : (int, int)
        Height and width of the image.
    overwrite : bool
        Replace an existing file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from cvtimg import find_contours
    >>> polygons = find_contours([[1, 1], [1, 1]]).polygons
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_svg(f"{folder}/a.svg", polygons, np.array([[0, 0, 0], [255, 128, 0]], np.uint8), size=(2, 2))
    ...     print(Path(folder, "a.svg").read_text().splitlines()[2])
    <path id="segment-1" fill="#ff8000" stroke="#ff8000" d="M0,0 2,0 2,2 0,2Z"/>
    """
    height, width = size
    write_text(path, svg_drawing(width, height, _body(polygons, colors)), overwrite=overwrite)


def _body(polygons: Iterable[Polygon], colors: NDArray[np.uint8]) -> Iterator[str]:
    # Renderers let the background shine through where polygons share a border; a thin stroke covers it.
    yield '<g fill-rule="evenodd" stroke-width="0.3" stroke-linejoin="round">\n'
    for label, pieces in groupby(polygons, key=lambda polygon: polygon.label):
        color = hexadecimal(colors[label])
        rings = "".join(f"M{_places(ring[:-1])}Z" for polygon in pieces for ring in polygon.rings)
        yield f'<path id="segment-{label}" fill="{color}" stroke="{color}" d="{rings}"/>\n'
    yield "</g>\n"


def _places(ring: NDArray[np.float64]) -> str:
    return " ".join(map(",".join, zip(*(numbers(axis, PLACE_DIGITS) for axis in ring.T), strict=True)))
