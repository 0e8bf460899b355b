"""Regions where a function is negative."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_in_range, check_returned, check_that
from cvtimg.regions.base import Points, Region, low_discrepancy
from cvtimg.regions.boxes import Box

#: Steps to the boundary at most; each brings about twice as many digits.
_STEPS = 30
#: Points that its measure is counted with.
_COUNTED = 1 << 17


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class ImplicitRegion(Region):
    """Where a function is <= 0, within bounds.

    Parameters
    ----------
    function : callable
        From (N, D) points to (N,) values: <= 0 inside, > 0 outside, continuous, and best with a slope that nowhere
        vanishes on the boundary, as a signed distance has.
    lower, upper : (D,) array
        Corners of a box that holds the region.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.regions import ImplicitRegion
    >>> disk = ImplicitRegion(lambda p: np.hypot(*p.T) - 1, [-1, -1], [1, 1])
    >>> round(disk.measure, 2), disk.project([[3, 4]]).round(6).tolist()
    (3.14, [[0.6, 0.8]])
    """

    function: Callable[[Points], Any]
    box: Box
    _measure: float

    def __init__(self, function: Callable[[Points], Any], lower: ArrayLike, upper: ArrayLike) -> None:
        object.__setattr__(self, "function", function)
        object.__setattr__(self, "box", Box(lower, upper))
        share = (self._values(self.box.draw(_COUNTED)) <= 0).mean()
        check_that("function", share > 0, "be <= 0 somewhere within lower and upper: the region is empty")
        object.__setattr__(self, "_measure", float(share) * self.box.measure)

    def __repr__(self) -> str:
        return f"<ImplicitRegion in {self.box!r}>"

    @property
    def bounds(self) -> Points:
        """The corners that it was made with, (2, D)."""
        return self.box.bounds

    @property
    def measure(self) -> float:
        """Length, area or volume, right to about 1e-4 of that of the box."""
        return self._measure

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell where the function is <= 0, within the bounds."""
        places = self._checked(points)
        return np.asarray((self._values(places) <= 0) & self.box.contains(places))

    def project(self, points: ArrayLike) -> Points:
        """Move points outside to the boundary, along the slope of the function."""
        places = self._checked(points).copy()
        outside = ~self.contains(places)
        if outside.any():
            places[outside] = self.to_boundary(places[outside])
        return places

    def to_boundary(self, points: ArrayLike) -> Points:
        """Move points to where the function is 0, along its slope: nearest if it is a signed distance."""
        places = self._checked(points).copy()
        size = float(np.linalg.norm(self.box.sides))
        for _ in range(_STEPS):
            values, slopes = self._values(places), self._slopes(places, 1e-6 * size)
            steep = (slopes**2).sum(axis=1)
            step = np.where(steep > 0, values / np.maximum(steep, 1e-300), 0)[:, None] * slopes
            # No farther than a part of the region at a time: a slope may be next to nothing.
            length = np.linalg.norm(step, axis=1, keepdims=True)
            places -= step * np.minimum(1, 0.25 * size / np.maximum(length, 1e-300))
            if length.max() < 1e-12 * size:
                break
        return self.box.project(places)

    def boundary_points(self, spacing: float) -> Points:
        """Cover the boundary with points that are drawn near to it."""
        n_cells = np.maximum(1, np.ceil(self.box.sides / spacing)).astype(int)
        grids = [
            low + (np.arange(n) + 0.5) * side / n
            for n, low, side in zip(n_cells, self.bounds[0], self.box.sides, strict=True)
        ]
        centers = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, self.n_dims)
        ends = self.to_boundary(centers)
        near: Points = ends[np.linalg.norm(ends - centers, axis=1) < spacing]
        return near

    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, D) points, evenly spread."""
        share = max(self._measure / self.box.measure, 1e-3)
        random = np.random.default_rng(rng)
        found = np.empty((0, self.n_dims))
        while len(found) < n:
            candidates = self.bounds[0] + self.box.sides * low_discrepancy(
                int(1.1 * (n - len(found)) / share) + 16, self.n_dims, random
            )
            found = np.concatenate([found, candidates[self._values(candidates) <= 0]])
        return found[:n]

    def _values(self, points: Points) -> NDArray[np.float64]:
        values = np.asarray(self.function(points), np.float64)
        check_returned("function", values, len(points))
        unknown = np.isnan(values)
        if unknown.any():
            check_in_range(f"function at {points[unknown][0].tolist()}", np.nan, False, "a number")
        return values

    def _slopes(self, points: Points, step: float) -> Points:
        slopes = np.empty_like(points)
        for axis in range(self.n_dims):
            aside = np.zeros(self.n_dims)
            aside[axis] = step
            slopes[:, axis] = (self._values(points + aside) - self._values(points - aside)) / (2 * step)
        return slopes
