"""Regions of pixels and of voxels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_shape, check_that, refuse_type
from cvtimg.regions.base import Points, Region

if TYPE_CHECKING:
    from cvtimg.regions.polygons import PolygonRegion


#: How far a point may be from the center of its pixel along an axis: at one half it would be in the next.
_TO_SIDE = 0.5 - 1e-7


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class PictureRegion(Region):
    """The pixels of a mask, or the voxels of one in three dimensions.

    Parameters
    ----------
    mask : (H, W) or (L, H, W) bool array
        True inside. Points are (x, y) or (x, y, z), in pixels; the first pixel covers [0, 1] along each axis.

    Examples
    --------
    >>> from cvtimg.regions import PictureRegion
    >>> region = PictureRegion([[True, True, False]])
    >>> region.measure, region.project([[2.7, 0.5]]).round(6).tolist()
    (2.0, [[2.0, 0.5]])
    """

    mask: NDArray[np.bool_]

    def __init__(self, mask: ArrayLike) -> None:
        array = np.asarray(mask)
        if array.dtype != np.bool_:
            refuse_type("mask", array.dtype, "bool")
        check_shape("mask", array.shape, array.ndim in (2, 3) and array.size > 0, "(H, W) or (L, H, W)")
        check_that("mask", array.any(), "be True somewhere: the region is empty")
        object.__setattr__(self, "mask", array)

    def __repr__(self) -> str:
        kind = "pixels" if self.mask.ndim == 2 else "voxels"
        return f"<PictureRegion of {int(self.measure)} {kind} in {' x '.join(map(str, self.mask.shape))}>"

    @property
    def bounds(self) -> Points:
        """The least and the greatest coordinates of the picture, (2, D)."""
        size = np.array(self.mask.shape[::-1], np.float64)
        return np.stack([np.zeros_like(size), size])

    @property
    def measure(self) -> float:
        """How many pixels."""
        return float(np.count_nonzero(self.mask))

    @property
    def corners(self) -> Points:
        """The corners of the picture that it holds: those along pixels are none."""
        ends = np.array(list(np.ndindex(*(2,) * self.n_dims)))
        own = self.mask[tuple(ends[:, ::-1].T * (np.array(self.mask.shape)[:, None] - 1))]
        places: Points = self.bounds[ends, np.arange(self.n_dims)][own]
        return places

    def polygons(self, tolerance: float = 0) -> PolygonRegion:
        """Return the same region as polygons along the sides of pixels, or simpler ones by `tolerance` pixels."""
        from cvtimg.regions.polygons import PolygonRegion

        check_shape("mask", self.mask.shape, self.mask.ndim == 2, "(H, W) to have polygons")
        return PolygonRegion.from_labels(self.mask, tolerance=tolerance)

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which of (N, D) points lie in a pixel of the mask."""
        places = self._checked(points)
        size = np.array(self.mask.shape[::-1])
        at = np.clip(places.astype(np.intp), 0, size - 1)
        inside = ((places >= 0) & (places <= size)).all(axis=1)
        return np.asarray(inside & self.mask[tuple(at[:, ::-1].T)])

    def project(self, points: ArrayLike) -> Points:
        """Move points outside to the nearest point of a pixel of the mask."""
        places = self._checked(points).copy()
        outside = ~self.contains(places)
        if outside.any():
            places[outside] = NearestPixel(self.mask)(places[outside])
        return places

    def to_boundary(self, points: ArrayLike) -> Points:
        """Move points to the nearest side between a pixel of the mask and another."""
        from scipy.spatial import cKDTree

        places = self._checked(points)
        sides, axes = self._sides()
        near = cKDTree(sides).query(places, min(8, len(sides)))[1].reshape(len(places), -1)
        # The nearest point of each of the nearest sides: a side has no extent along its own axis.
        half = np.where(np.arange(self.n_dims) == axes[near][..., None], 0, 0.5)
        ends = np.clip(places[:, None], sides[near] - half, sides[near] + half)
        best = ((ends - places[:, None]) ** 2).sum(axis=2).argmin(axis=1)
        found: Points = ends[np.arange(len(places)), best]
        return found

    def boundary_points(self, spacing: float) -> Points:
        """Return the middles of the sides between pixels of the mask and others, thinned to `spacing`."""
        sides = self._sides()[0]
        if spacing <= 1:
            return sides
        blocks = np.floor(sides / spacing)
        return sides[np.unique(blocks, axis=0, return_index=True)[1]]

    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, D) points, as many in each pixel as nearly as may be."""
        random = np.random.default_rng(rng)
        inside = np.flatnonzero(self.mask)
        own = inside[((np.arange(n) + random.random()) / n * len(inside)).astype(np.intp)]
        corners = np.stack(np.unravel_index(own, self.mask.shape)[::-1], axis=1)
        return np.asarray(corners + random.random((n, self.n_dims)))

    def _sides(self) -> tuple[Points, NDArray[np.intp]]:
        """Middles (S, D) of the sides between inside and outside, and the axis (S,) that each stands across."""
        middles, axes = [], []
        padded = np.pad(self.mask, 1)
        for axis in range(self.mask.ndim):
            places = np.argwhere(np.diff(padded, axis=axis)) - 0.5
            places[:, axis] += 0.5
            middles.append(places[:, ::-1])
            axes.append(np.full(len(places), self.mask.ndim - 1 - axis))
        return np.concatenate(middles), np.concatenate(axes)


class NearestPixel:
    """Finds the nearest point of the pixels of a mask, for points outside of it, any number of times.

    Parameters
    ----------
    mask : (H, W) or (L, H, W) bool array
    """

    def __init__(self, mask: NDArray[np.bool_]) -> None:
        from scipy.spatial import cKDTree

        self._centers = _border(mask)
        self._tree = cKDTree(self._centers)

    def __call__(self, points: Points) -> Points:
        """Move (N, D) points."""
        n = min(8, len(self._centers))
        near = self._tree.query(points, n)[1].reshape(len(points), n)
        ends = np.clip(points[:, None], self._centers[near] - _TO_SIDE, self._centers[near] + _TO_SIDE)
        best = ((ends - points[:, None]) ** 2).sum(axis=2).argmin(axis=1)
        found: Points = ends[np.arange(len(points)), best]
        return found


def _border(mask: NDArray[np.bool_]) -> Points:
    """Centers of the pixels of a mask that have a neighbor outside."""
    padded = np.pad(mask, 1)
    inner = np.ones_like(mask)
    middle = tuple(slice(1, -1) for _ in range(mask.ndim))
    for axis in range(mask.ndim):
        for step in (-1, 1):
            inner &= np.roll(padded, step, axis)[middle]
    return np.argwhere(mask & ~inner)[:, ::-1].astype(np.float64) + 0.5
