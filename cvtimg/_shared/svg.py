"""Drawings as SVG: text in pieces, so that large ones need not be held as a whole; and how such text writes numbers.

Small drawings of results, for notebooks, are SVG inside HTML.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Floats = NDArray[np.float64]

#: Names of the layers that `layer` writes, for the attributes of a drawing.
LAYERED = ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
#: Size and margin of drawings for notebooks.
_SIZE, _MARGIN = 400.0, 4.0
#: Notebooks with more shapes than this are slow to open.
MOST_SHAPES = 20_000


def number(value: float, digits: int) -> str:
    """Format a number with at most `digits` decimals, without trailing zeros."""
    text = f"{value:.{digits}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def numbers(values: NDArray[np.float64], digits: int) -> list[str]:
    """Format many numbers as `number` does."""
    return [number(value, digits) for value in values.tolist()]


def shortest(value: float) -> str:
    """Format a number with as few digits as identify it."""
    return str(int(value)) if value == int(value) else repr(value)


def hexadecimal(color: NDArray[np.uint8]) -> str:
    """Write a color as style sheets do; alpha is left out."""
    return "#" + color[:3].tobytes().hex()


def drawing(
    width: float, height: float, body: Iterable[str], *, unit: str = "", digits: int = 4, attributes: str = ""
) -> Iterator[str]:
    """Yield the text of a drawing whose user unit is the unit of its size."""
    w, h = number(width, digits), number(height, digits)
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg"{attributes} '
        f'width="{w}{unit}" height="{h}{unit}" viewBox="0 0 {w} {h}">\n'
    )
    yield from body
    yield "</svg>\n"


def layer(number: int, name: str, attributes: str, body: Iterable[str]) -> Iterator[str]:
    """Yield a layer as Inkscape, vpype and AxiDraw know them: its number stands before its name."""
    label = f'"{html.escape(f"{number} {name}")}"'
    yield f'<g inkscape:groupmode="layer" inkscape:label={label} id="layer{number}" {attributes}>\n'
    yield from body
    yield "</g>\n"


def captioned(caption: str, width: float, height: float, body: str) -> str:
    """Give a drawing with a caption as a part of a page, for notebooks."""
    return f"<p>{html.escape(caption)}</p><svg width='{width:.0f}' height='{height:.0f}' fill='none'>{body}</svg>"


def draw_lines(caption: str, lines: _Floats, *, y_down: bool = False) -> str:
    """Draw line segments (S, 2, 2), each from (x, y) to (x, y)."""
    placed, height = _placed(lines.reshape(-1, 2), _SIZE, y_down)
    path = "".join(f"M{x:.1f} {y:.1f}L{u:.1f} {v:.1f}" for x, y, u, v in placed.reshape(-1, 4).tolist())
    return captioned(caption, _SIZE, height, f"<path d='{path}' stroke='currentColor' stroke-width='0.5'/>")


def draw_dots(caption: str, points: _Floats, *, y_down: bool = False, most_axes: int = 4) -> str:
    """Draw points (N, D), which are thinned if there are very many, in each pair of the first axes."""
    some = points[:: 1 + len(points) // MOST_SHAPES]
    n_dims = min(some.shape[1], most_axes)
    if n_dims == 1:
        some, n_dims = np.column_stack([some, np.zeros(len(some))]), 2
    size = _SIZE / (n_dims - 1)
    parts, lowest = [], 0.0
    for across, down in combinations(range(n_dims), 2):
        placed, height = _placed(some[:, [across, down]], size, y_down or n_dims > 2)
        left, top = across * size, (down - 1) * size
        path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in (placed + np.array([left, top])).tolist())
        parts.append(f"<path d='{path}' stroke='currentColor' stroke-width='3' stroke-linecap='round'/>")
        parts.append(f"<rect x='{left:.1f}' y='{top:.1f}' width='{size:.1f}' height='{height:.1f}' stroke='#bbb'/>")
        lowest = max(lowest, top + height)
    return captioned(caption, _SIZE, lowest, "".join(parts))


def draw_solid(caption: str, points: _Floats, triangles: NDArray[np.integer], view: Sequence[float]) -> str:
    """Draw the triangles (T, 3) of points in space that face the viewer, who looks from the direction `view`."""
    turned = points @ seen_from(view).T
    corners = turned[triangles]
    first, second = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    facing = corners[first[:, 0] * second[:, 1] > first[:, 1] * second[:, 0]]
    if not 0 < len(facing) <= MOST_SHAPES:
        return draw_dots(caption, turned[:, :2])
    nearest_last = facing[np.argsort(facing[..., 2].mean(axis=1))]
    placed, height = _placed(nearest_last[..., :2].reshape(-1, 2), _SIZE, y_down=False)
    shape = "<path d='M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} {:.1f}Z'/>"
    shapes = "".join(shape.format(*six) for six in placed.reshape(-1, 6).tolist())
    return captioned(caption, _SIZE, height, f"<g fill='white' stroke='#333' stroke-width='0.5'>{shapes}</g>")


def seen_from(direction: ArrayLike) -> _Floats:
    """Return the axes of a view, as rows: right, up, and toward the viewer."""
    toward = np.asarray(direction, float) / np.linalg.norm(direction)
    right = np.cross([0.0, 0.0, 1.0], toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])


def _placed(points: _Floats, size: float, y_down: bool) -> tuple[_Floats, float]:
    """Scale points to a width of `size`, and to no more height; return them and the height."""
    if not len(points):
        return points, 2 * _MARGIN
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (size - 2 * _MARGIN) / max(*(high - low), 1e-300)
    placed = (points - low) * scale
    height = float((high - low)[1] * scale)
    if not y_down:
        placed[:, 1] = height - placed[:, 1]
    return placed + _MARGIN, height + 2 * _MARGIN
