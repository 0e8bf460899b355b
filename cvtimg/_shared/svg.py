"""Drawings as SVG: text in pieces, so that large ones need not be held as a whole; and how such text writes numbers."""

import html
from collections.abc import Iterable, Iterator

from cvtimg._shared.types import Bytes, Floats

#: Names of the layers that `layer` writes, for the attributes of a drawing.
LAYERED = ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'


def number(value: float, digits: int) -> str:
    """Format a number with at most `digits` decimals, without trailing zeros."""
    text = f"{value:.{digits}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def numbers(values: Floats, digits: int) -> list[str]:
    """Format many numbers as `number` does."""
    return [number(value, digits) for value in values.tolist()]


def shortest(value: float) -> str:
    """Format a number with as few digits as identify it."""
    return str(int(value)) if value == int(value) else repr(value)


def hexadecimal(color: Bytes) -> str:
    """Write a color as style sheets do; alpha is left out."""
    return "#" + color[:3].tobytes().hex()


def drawing(
    width: float, height: float, body: Iterable[str], *, unit: str = "", digits: int = 4, attributes: str = ""
) -> Iterator[str]:
    """Yield the text of a drawing whose user unit is the unit of its size."""
    w, h = number(width, digits), number(height, digits)
    size = f'width="{w}{unit}" height="{h}{unit}" viewBox="0 0 {w} {h}"'
    yield f'<svg xmlns="http://www.w3.org/2000/svg"{attributes} {size}>\n'
    yield from body
    yield "</svg>\n"


def layer(number: int, name: str, attributes: str, body: Iterable[str]) -> Iterator[str]:
    """Yield a layer as Inkscape, vpype and AxiDraw know them: its number stands before its name."""
    label = f'"{html.escape(f"{number} {name}")}"'
    yield f'<g inkscape:groupmode="layer" inkscape:label={label} id="layer{number}" {attributes}>\n'
    yield from body
    yield "</g>\n"
