"""How far each point is among the p nearest, exactly, in the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.supports import _plane
from cvtimg.supports.rows import Rows, as_rows
from cvtimg.supports.sight import Outline

_Floats = NDArray[np.float64]

#: Neighbors that are looked at first: so many, and so many for each unit of the order.
_FEW, _FEW_PER_ORDER = 16, 8
#: By how much more than twice the reach neighbors are looked for.
_FARTHER = 1.05


def find_reaches(points: _Floats, outline: Outline, order: int) -> _Floats:
    """Find the greatest distance at which each of (n, 2) points is among the `order` nearest that see a place.

    Points are compared with their neighbors in a window. If a point is still among the nearest at its sides, the
    window was too small, and is enlarged.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    n_first = min(len(points), 1 + _FEW + _FEW_PER_ORDER * order)
    extents = tree.query(points, n_first)[0][:, -1]
    widest = 2.1 * outline.size  # sees the whole region from anywhere
    if n_first == len(points):
        extents[:] = widest
    reaches = np.zeros(len(points))
    left = np.arange(len(points))
    while len(left):
        reaches[left] = _in_windows(points, outline, order, left, extents[left] / 2, tree)
        again = (reaches[left] >= extents[left] / 2 * (1 - 1e-9)) & (extents[left] < widest)
        left = left[again]
        extents[left] = np.minimum(np.maximum(2 * extents[left], 2 * _FARTHER * reaches[left]), widest)
    return reaches


def _in_windows(
    points: _Floats, outline: Outline, order: int, who: NDArray[np.intp], halves: _Floats, tree: object
) -> _Floats:
    """Find the reaches of some points, each in a square around it with sides of two times `halves`."""
    low, high = outline.region.bounds
    centers = points[who]
    windows = np.concatenate(
        [np.maximum(centers - halves[:, None], low), np.minimum(centers + halves[:, None], high)], axis=1
    )
    others = _neighbors(points, who, 2 * halves, tree)
    diagonals = halves * 2**0.5
    near = outline.around(centers, diagonals)
    tips = _within(outline.tips, centers, 2 * halves)
    n_lines = 4 + int((near.lengths() + (others.lengths() + 1) * (1 + tips.lengths())).max())
    reaches = np.empty(len(who))
    _plane.find_reaches(
        points,
        who.astype(np.int32),
        order,
        windows,
        np.ascontiguousarray(outline.region.bounds).reshape(4),
        *others,
        outline.barriers,
        outline.n_boundary,
        *near,
        outline.tips,
        *tips,
        outline.blocking,
        outline.tolerance,
        outline.slack,
        np.empty((n_lines, 6)),
        reaches,
    )
    return reaches


def _neighbors(points: _Floats, who: NDArray[np.intp], extents: _Floats, tree: object) -> Rows:
    """Other points within some distance of each, the nearest first."""
    found = tree.query_ball_point(points[who], extents)  # type: ignore[attr-defined]
    own = np.repeat(np.arange(len(who)), [len(row) for row in found])
    other = np.concatenate([np.asarray(row, np.intp) for row in found])
    own, other = own[other != who[own]], other[other != who[own]]
    order = np.lexsort((np.linalg.norm(points[who[own]] - points[other], axis=1), own))
    return as_rows(own[order], other[order], len(who))


def _within(tips: _Floats, centers: _Floats, extents: _Floats) -> Rows:
    apart = np.linalg.norm(centers[:, None] - tips, axis=2) <= extents[:, None]
    own, items = np.nonzero(apart)
    return as_rows(own, items, len(centers))
