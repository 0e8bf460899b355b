"""A region of the plane as its boundary, the barriers that block sight in it, and what is near to what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_shape, check_that
from cvtimg._shared.extras import optional
from cvtimg.placement import Box, PolygonRegion, Region
from cvtimg.placement.regions import Geometry
from cvtimg.supports import _supports

_Ints = NDArray[np.int32]
_Floats = NDArray[np.float64]
#: Shares of the size of the region: what counts as on a barrier, and by how much barriers are longer than they are.
_TOLERANCE, _SLACK = 1e-12, 1e-8
#: Distances that are computed at a time.
_AT_ONCE = 1 << 22


class Rows(NamedTuple):
    """Row i holds ``items[starts[i] : starts[i + 1]]``."""

    starts: _Ints
    items: _Ints

    def lengths(self) -> _Ints:
        """(n,) how many items each row has."""
        return np.diff(self.starts)

    def spread(self, own: NDArray[np.intp]) -> tuple[NDArray[np.intp], _Ints]:
        """Repeat indices of rows for each item that the row has: positions in `own`, and the items."""
        counts = self.lengths()[own]
        at = np.repeat(np.arange(len(own)), counts)
        within = np.arange(len(at)) - np.repeat(np.cumsum(counts) - counts, counts)
        return at, self.items[self.starts[own][at] + within]


def as_rows(own: NDArray[np.integer], items: NDArray[np.integer], n_rows: int) -> Rows:
    """Collect items by their rows, which rise."""
    starts = np.concatenate([[0], np.cumsum(np.bincount(own, minlength=n_rows))])
    return Rows(starts.astype(np.int32), np.ascontiguousarray(items, np.int32))


def empty_rows(n_rows: int) -> Rows:
    """Rows without items."""
    return Rows(np.zeros(n_rows + 1, np.int32), np.zeros(0, np.int32))


def lies_in(region: Region, places: _Floats, tolerance: float) -> NDArray[np.bool_]:
    """Tell which places lie in a region, or no farther than a tolerance from it."""
    inside = region.contains(places)
    outside = np.flatnonzero(~inside)
    if len(outside):
        inside[outside] = np.linalg.norm(region.project(places[outside]) - places[outside], axis=1) <= tolerance
    return inside


def overlaps(points: NDArray[np.float64], radii: NDArray[np.float64]) -> Rows:
    """Balls that each ball meets, itself among them."""
    from scipy.spatial import cKDTree

    # Of two balls that meet, the center of one lies within twice the radius of the larger one.
    found = cKDTree(points).query_ball_point(points, 2 * radii)
    own = np.repeat(np.arange(len(points)), [len(row) for row in found])
    other = np.concatenate([np.asarray(row, np.intp) for row in found])
    meet = np.linalg.norm(points[own] - points[other], axis=1) < radii[own] + radii[other]
    meet |= own == other
    both = np.unique(
        np.concatenate([np.stack([own, other], axis=1)[meet], np.stack([other, own], axis=1)[meet]]), axis=0
    )
    return as_rows(both[:, 0], both[:, 1], len(points))


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """A region of the plane, and what blocks sight in it."""

    region: Region
    barriers: _Floats  # (S, 4) segments x1, y1, x2, y2: the boundary, then the slits
    n_boundary: int  # how many barriers are of the boundary
    tips: _Floats  # (T, 2) ends that cast shadows, reflex corners and ends of slits; none if not blocking
    blocking: bool  # whether barriers block sight

    @property
    def size(self) -> float:
        """Diameter of the bounding box."""
        return float(np.linalg.norm(np.ptp(self.region.bounds, axis=0)))

    @property
    def tolerance(self) -> float:
        """Distance up to which a place is on a barrier."""
        return _TOLERANCE * self.size

    @property
    def slack(self) -> float:
        """By how much barriers are longer where what passes their ends is in doubt."""
        return _SLACK * self.size

    def near(self, points: _Floats, extents: _Floats) -> Rows:
        """Barriers within some distance of each point; none if nothing blocks sight."""
        return self.around(points, extents) if self.blocking else empty_rows(len(points))

    def around(self, points: _Floats, extents: _Floats) -> Rows:
        """Barriers within some distance of each point."""
        own, items = [], []
        step = max(1, _AT_ONCE // len(self.barriers))
        for start in range(0, len(points), step):
            part = slice(start, start + step)
            meets = _distances(points[part], self.barriers) <= extents[part, None] + self.tolerance
            rows, columns = np.nonzero(meets)
            own.append(rows + start)
            items.append(columns)
        return as_rows(np.concatenate(own), np.concatenate(items), len(points))

    def sees(self, points: _Floats, own: NDArray[np.integer], places: _Floats, slack: float = 0) -> NDArray[np.bool_]:
        """Tell which of (m, 2) places is seen by the point that looks there, of (n, 2) points."""
        if not self.blocking or not len(own):
            return np.ones(len(own), bool)
        looks = np.asarray(own, np.int32)
        extents = np.zeros(len(points))
        np.maximum.at(extents, looks, np.linalg.norm(places - points[looks], axis=1))
        near, targets = self.near(points, extents), np.ascontiguousarray(places)
        return _supports.see(points, looks, targets, self.barriers, *near, self.tolerance, slack)


def sight_in(region: Region, slits: ArrayLike | None) -> Sight | None:
    """Return what blocks sight in a region of the plane whose boundary is made of segments; None for another region.

    Its boundary and the slits, (S, 2, 2) ends of segments, block sight if `slits` is not None.
    """
    if not region.is_polygonal:
        return None
    if not isinstance(region, Box):
        region = PolygonRegion(region.outline())
    rings = _rings(region.outline())
    reflex = np.concatenate([ring[_turns(ring) < 0] for ring in rings])
    boundary = np.concatenate([np.concatenate([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])
    cuts = np.empty((0, 4)) if slits is None else _checked_slits(slits)
    barriers = np.ascontiguousarray(np.concatenate([boundary, cuts]))
    tips = np.unique(np.concatenate([reflex, cuts.reshape(-1, 2)]), axis=0)
    return Sight(region, barriers, len(boundary), tips if slits is not None else tips[:0], slits is not None)


def _checked_slits(slits: ArrayLike) -> _Floats:
    array = np.asarray(slits, dtype=np.float64)
    if array.size == 0:
        return np.empty((0, 4))
    fits = array.ndim == 3 and array.shape[1:] == (2, 2)
    check_shape("visible", array.shape, fits, "(S, 2, 2), the ends of S slits, or a function")
    long = np.isfinite(array).all() and (array[:, 0] != array[:, 1]).any(axis=1).all()
    check_that("visible", long, "have slits that are finite and longer than 0")
    return array.reshape(-1, 4)


def _rings(outline: Geometry) -> list[_Floats]:
    """Corners of the rings of polygons, the region to the left of each."""
    shapely = optional("shapely", "regions")

    rings = []
    for part in shapely.get_parts(outline):
        for number, ring in enumerate([part.exterior, *part.interiors]):
            corners = shapely.get_coordinates(ring)[:-1]
            corners = corners[(corners != np.roll(corners, 1, axis=0)).any(axis=1)]
            rings.append(corners if shapely.is_ccw(ring) == (number == 0) else corners[::-1])
    return rings


def _turns(ring: _Floats) -> NDArray[np.float64]:
    """How a ring turns at each corner: > 0 to the left, < 0 to the right."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]


def _distances(points: _Floats, segments: _Floats) -> _Floats:
    """(n, S) distances of points to segments."""
    starts, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    steps = points[:, None] - starts
    shares = np.clip((steps * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    return np.linalg.norm(steps - shares[..., None] * along, axis=2)
