"""Small drawings of results for notebooks, as SVG inside HTML."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.svg import captioned

_Floats = NDArray[np.float64]

_SIZE, _MARGIN = 400.0, 4.0
#: Notebooks with more shapes than this are slow to open.
MOST_SHAPES = 20_000
_MOST_AXES = 4


def draw_lines(caption: str, lines: _Floats, *, y_down: bool = False) -> str:
    """Draw line segments (S, 2, 2), each from (x, y) to (x, y)."""
    placed, height = _placed(lines.reshape(-1, 2), _SIZE, y_down)
    path = "".join(f"M{x:.1f} {y:.1f}L{u:.1f} {v:.1f}" for x, y, u, v in placed.reshape(-1, 4).tolist())
    return captioned(caption, _SIZE, height, f"<path d='{path}' stroke='currentColor' stroke-width='0.5'/>")


def draw_dots(caption: str, points: _Floats, *, y_down: bool = False) -> str:
    """Draw points (N, D), which are thinned if there are very many, in each pair of the first axes."""
    some = points[:: 1 + len(points) // MOST_SHAPES]
    n_dims = min(some.shape[1], _MOST_AXES)
    if n_dims == 1:
        some, n_dims = np.column_stack([some, np.zeros(len(some))]), 2
    size = _SIZE / (n_dims - 1)
    parts, lowest = [], 0.0
    for across, down in combinations(range(n_dims), 2):
        placed, height = _placed(some[:, [across, down]], size, y_down or n_dims > 2)
        left, top = across * size, (down - 1) * size
        path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in (placed + np.array([left, top])).tolist())
        parts.append(f"<path d='{path}' stroke='currentColor' stroke-width='3' stroke-linecap='round'/>")
        frame = f"<rect x='{left:.1f}' y='{top:.1f}' width='{size:.1f}' height='{height:.1f}' stroke='#bbb'/>"
        parts.append(frame)
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


def edges_of(triangles: NDArray[np.integer]) -> NDArray[np.integer]:
    """List the edges (E, 2) of triangles (T, 3), each once."""
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(pairs, axis=0)


def seen_from(direction: Sequence[float]) -> _Floats:
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
