"""Radii in any number of dimensions, by boxes: a ball that reaches the middle of a box by half its diagonal holds it.

Boxes that too few balls hold as a whole are halved along each axis, until the radii are as small as samples show, or
until there are too many boxes. So every place of the region is covered, however coarse the boxes are; the margin is
what the radii are too large by.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_returned, refuse
from cvtimg.placement import Region
from cvtimg.supports import _supports
from cvtimg.supports.sight import as_rows, lies_in

_Floats = NDArray[np.float64]
#: From (m, d) places and (m, d) points to (m,) booleans.
Visible = Callable[[_Floats, _Floats], NDArray[np.bool_]]

#: Radii may be larger than samples show by this share before boxes are halved.
_MARGIN = 0.02
#: Boxes at first, for each point; and all that are made.
_BOXES_PER_POINT, _MOST_BOXES = 16, 1 << 20
#: Times that boxes are halved at most.
_HALVINGS = 8
#: Points that each box sees the nearest of: so many, and so many per unit of the order.
_FEW, _FEW_PER_ORDER = 12, 4
#: Parts of what they can spare that balls give up in turn.
_PARTS = (0.3, 0.3, 0.5, 0.5, 1.0)


class Boxes(NamedTuple):
    """Middles of boxes (m, d), half their diagonals (m,), and the (m, k) nearest points with their distances."""

    middles: _Floats
    halves: _Floats
    points: NDArray[np.intp]
    distances: _Floats

    def only(self, chosen: NDArray[np.bool_]) -> Boxes:
        """Leave some."""
        return Boxes(self.middles[chosen], self.halves[chosen], self.points[chosen], self.distances[chosen])


def radii_by_boxes(points: _Floats, region: Region, order: int, tightened: bool, visible: Visible | None) -> _Floats:
    """Find radii of balls around (n, d) points that cover a region `order` times."""
    # Boxes along each axis at first.
    n_side = max(2, round(float((_BOXES_PER_POINT * len(points)) ** (1 / points.shape[1]))))
    sides = (1 / n_side) * np.ptp(region.bounds, axis=0)
    axes = [low + (np.arange(n_side) + 0.5) * (1 / n_side) * (high - low) for low, high in region.bounds.T]
    middles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(sides))
    done, left = _looked_up(middles, sides, points, region, order, visible), None
    radii = np.zeros(len(points))
    finished: list[Boxes] = []
    for _ in range(_HALVINGS):
        _reach(radii, done, order, beyond=False, inside=region.contains(done.middles))
        held = _depths(done, (1 + _MARGIN) * radii) >= order
        finished.append(done.only(held))
        left = done.only(~held)
        n_made = len(left.middles) * 2 ** points.shape[1]
        if not len(left.middles) or n_made + sum(len(each.middles) for each in finished) > _MOST_BOXES:
            break
        sides = sides / 2
        done = _looked_up(_halved(left.middles, sides), sides, points, region, order, visible)
        left = None
    radii = (1 + _MARGIN) * radii
    if left is None:
        left = done
    boxes = Boxes(*(np.concatenate(parts) for parts in zip(*finished, left, strict=True)))
    _reach(radii, left.only(_depths(left, radii) < order), order, beyond=True)
    return _tightened(points, radii, boxes, order) if tightened and order > 1 else radii


def _halved(middles: _Floats, sides: _Floats) -> _Floats:
    corners = np.array(list(np.ndindex(*(2,) * len(sides)))) - 0.5
    return (middles[:, None] + corners * sides).reshape(-1, len(sides))


def _looked_up(
    middles: _Floats, sides: _Floats, points: _Floats, region: Region, order: int, visible: Visible | None
) -> Boxes:
    """Leave boxes that meet the region, and find the points nearest to each."""
    from scipy.spatial import cKDTree

    half = float(np.linalg.norm(sides)) / 2
    middles = middles[lies_in(region, middles, half * (1 + 1e-9))]
    n_near = min(len(points), _FEW + _FEW_PER_ORDER * order)
    distances, near = cKDTree(points).query(middles, n_near)
    distances, near = distances.reshape(len(middles), n_near), near.reshape(len(middles), n_near)
    if visible is not None:
        distances, near = _seen(middles, distances, near, points, order, visible)
    return Boxes(middles, np.full(len(middles), half), near, distances)


def _seen(
    middles: _Floats, distances: _Floats, near: NDArray[np.intp], points: _Floats, order: int, visible: Visible
) -> tuple[_Floats, NDArray[np.intp]]:
    """Put points that do not see a box behind the others; look at all points where too few are left."""
    n_near = near.shape[1]
    seen = _look(middles, near, points, visible)
    few = np.flatnonzero(seen.sum(axis=1) < order)
    distances = np.where(seen, distances, np.inf)
    for part in np.array_split(few, -(-len(few) * len(points) // (1 << 21))) if len(few) else ():
        every = np.tile(np.arange(len(points)), (len(part), 1))
        all_distances = np.linalg.norm(middles[part, None] - points, axis=2)
        all_distances[~_look(middles[part], every, points, visible)] = np.inf
        best = np.argsort(all_distances, axis=1)[:, :n_near]
        near[part], distances[part] = best, np.take_along_axis(all_distances, best, axis=1)
    behind = np.argsort(distances, axis=1, kind="stable")
    distances, near = np.take_along_axis(distances, behind, axis=1), np.take_along_axis(near, behind, axis=1)
    unseen = np.flatnonzero(np.isinf(distances[:, order - 1]))
    if len(unseen):
        refuse(
            "cover",
            order,
            f"at most the number of points that see each place; {middles[unseen[0]].tolist()} is seen by fewer",
        )
    return distances, near


def _look(middles: _Floats, near: NDArray[np.intp], points: _Floats, visible: Visible) -> NDArray[np.bool_]:
    places = np.repeat(middles, near.shape[1], axis=0)
    seen = np.asarray(visible(places, points[near.ravel()]))
    check_returned("visible", seen, len(places))
    return seen.astype(bool).reshape(near.shape)


def _reach(radii: _Floats, boxes: Boxes, order: int, *, beyond: bool, inside: NDArray[np.bool_] | None = None) -> None:
    """Let the nearest balls reach the middles of boxes, or beyond them, so that they hold them as a whole."""
    chosen = slice(None) if inside is None else inside
    distances = boxes.distances[chosen, :order] + (boxes.halves[chosen, None] if beyond else 0)
    np.maximum.at(radii, boxes.points[chosen, :order].ravel(), distances.ravel())


def _depths(boxes: Boxes, radii: _Floats) -> NDArray[np.intp]:
    """How many balls hold each box as a whole."""
    return (boxes.distances + boxes.halves[:, None] <= radii[boxes.points]).sum(axis=1)


def _tightened(points: _Floats, radii: _Floats, boxes: Boxes, order: int) -> _Floats:
    """Let balls shrink as long as enough of them hold each box; none below what it holds as the nearest."""
    radii = radii.copy()
    floors = np.zeros(len(points))
    _reach(floors, boxes, 1, beyond=True)
    floors = np.minimum(floors, radii)
    needed = boxes.distances + boxes.halves[:, None]
    held = needed <= radii[boxes.points]
    own, at = np.nonzero(held)
    balls, reaches = boxes.points[own, at], needed[own, at]
    sort = np.lexsort((reaches, balls))
    rows = as_rows(balls[sort], own[sort], len(points))
    taken, depths = rows.lengths().astype(np.int32), held.sum(axis=1).astype(np.int32)
    for part in _PARTS:
        turns = np.argsort(-radii).astype(np.int32)
        _supports.shrink_over_samples(turns, part, floors, *rows, reaches[sort], order, taken, radii, depths)
    return radii
