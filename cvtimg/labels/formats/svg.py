"""Contours as SVG: drawings for browsers, vector editors and plotters."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from cvtimg._shared.checks import check_that
from cvtimg._shared.svg import drawing as svg_drawing
from cvtimg._shared.svg import hexadecimal, numbers
from cvtimg._shared.types import Bytes, Floats
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.contours import Polygon
from cvtimg.labels.formats import PLACE_DIGITS, Drawing


def write(path: StrPath, drawings: Sequence[Drawing], overwrite: bool) -> None:
    """Write the polygons of a drawing in its colors, with one path per label, holes left open; or its lines."""
    check_that(f"{path}: {len(drawings)} pages", len(drawings) == 1, "be one, which .svg holds")
    (drawing,) = drawings
    height, width = drawing.size
    body = _lines(drawing, drawing.chances) if drawing.chances is not None else _body(drawing.polygons, drawing.colors)
    write_text(path, svg_drawing(width, height, body), overwrite=overwrite)


def _lines(drawing: Drawing, chances: Floats) -> Iterator[str]:
    """Draw lines, as dark as people are likely to draw them, the darkest last."""
    yield '<g fill="none" stroke="#000" stroke-linecap="round" stroke-linejoin="round">\n'
    for line, chance in zip(drawing.lines[::-1], numbers(chances[::-1], 4), strict=True):
        yield f'<path data-chance="{chance}" stroke-opacity="{chance}" d="M{_places(line)}"/>\n'
    yield "</g>\n"


def _body(polygons: Iterable[Polygon], colors: Bytes) -> Iterator[str]:
    # Renderers let the background shine through where polygons share a border; a thin stroke covers it.
    yield '<g fill-rule="evenodd" stroke-width="0.3" stroke-linejoin="round">\n'
    for label, pieces in groupby(polygons, key=lambda polygon: polygon.label):
        color = hexadecimal(colors[label])
        rings = "".join(f"M{_places(ring[:-1])}Z" for polygon in pieces for ring in polygon.rings)
        yield f'<path id="segment-{label}" fill="{color}" stroke="{color}" d="{rings}"/>\n'
    yield "</g>\n"


def _places(ring: Floats) -> str:
    return " ".join(map(",".join, zip(*(numbers(axis, PLACE_DIGITS) for axis in ring.T), strict=True)))
