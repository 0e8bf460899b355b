"""Drawings as SVG: text in pieces, so that large ones need not be held as a whole."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray


def number(value: float, digits: int) -> str:
    """Word a number in as few characters as hold it to so many digits after the point."""
    text = f"{value:.{digits}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def numbers(values: NDArray[np.float64], digits: int) -> list[str]:
    """Word many numbers."""
    return [number(value, digits) for value in values.tolist()]


def hexadecimal(color: NDArray[np.uint8]) -> str:
    """Word a color as style sheets do; alpha is left out."""
    return "#" + color[:3].tobytes().hex()


def drawing(
    width: float, height: float, *, unit: str = "", digits: int = 4, attributes: str = "", body: Iterable[str]
) -> Iterator[str]:
    """Give the text of a drawing whose user unit is the unit of its size."""
    w, h = number(width, digits), number(height, digits)
    yield (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        f'width="{w}{unit}" height="{h}{unit}" viewBox="0 0 {w} {h}"{attributes}>\n'
    )
    yield from body
    yield "</svg>\n"


def layer(number: int, name: str, attributes: str, body: Iterable[str]) -> Iterator[str]:
    """Give a layer as Inkscape, vpype and AxiDraw know them: its number stands before its name."""
    label = quoteattr(f"{number} {name}")
    yield f'<g inkscape:groupmode="layer" inkscape:label={label} id="layer{number}" {attributes}>\n'
    yield from body
    yield "</g>\n"
