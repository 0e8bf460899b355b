"""Functions of space that are negative inside, and the regions where they are."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import ENOUGH_SAMPLES, ROUNDING
from cvtimg._shared.checks import check_finite, check_shape, check_that, check_values
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Bools, Floats, Points
from cvtimg.placement.regions import Box, Geometry, Region, low_discrepancy

#: Cells along each axis by which the boundary of a region is traced.
_TRACED = 512


@dataclass(frozen=True, slots=True, eq=False)
class ImplicitFunction:
    """A function that is 0 on a curve or surface within a box, with its gradient; what they return is checked."""

    function: Callable[[Points], Any]
    box: Box
    gradient: Callable[[Points], Any] | None = None

    def __call__(self, points: Points) -> Floats:
        """Compute the values (N,) at (N, D) points."""
        return check_values("function", self.function(points), points, lambda values: ~np.isnan(values), "a number")

    def slopes(self, points: Points) -> Points:
        """Compute the gradients (N, D), by central differences if none was given."""
        if self.gradient is not None:
            slopes = np.asarray(self.gradient(points), np.float64)
            check_shape("gradient", slopes.shape, slopes.shape == points.shape, f"{points.shape}, as the points")
            check_finite("gradient", slopes)
            return slopes
        step = 1e-6 * float(np.linalg.norm(self.box.sides))
        asides = step * np.eye(self.box.n_dims)
        return np.stack([(self(points + aside) - self(points - aside)) / (2 * step) for aside in asides], axis=1)

    def to_zero(self, points: Points, *, slide: bool = False, steps: int = 30, longest: float = 0.25) -> Points:
        """Move points along the gradient to where the function is 0: Newton's method, up to a number of steps.

        Each about doubles the number of right digits; the longest, in diagonals of the box, is for where the gradient
        nearly vanishes.

        Those that come to lie outside of the box are projected to it at the end, where they are nearest; or with
        `slide` at each step, where they are still on the zero set if that leaves the box.
        """
        places, size = points, float(np.linalg.norm(self.box.sides))
        for _ in range(steps):
            values, slopes = self(places), self.slopes(places)
            steep = (slopes**2).sum(axis=1)
            step = np.where(steep > 0, values / np.maximum(steep, 1e-300), 0)[:, None] * slopes
            length = np.linalg.norm(step, axis=1, keepdims=True)
            places = places - step * np.minimum(1, longest * size / np.maximum(length, 1e-300))
            if slide:
                places = self.box.project(places)
            if length.max(initial=0) < ROUNDING * size:
                break
        return self.box.project(places)


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
    >>> from cvtimg.placement import ImplicitRegion
    >>> disk = ImplicitRegion(lambda p: np.hypot(*p.T) - 1, [-1, -1], [1, 1])
    >>> round(disk.measure, 2), disk.project([[3, 4]]).round(6).tolist()
    (3.14, [[0.6, 0.8]])
    """

    function: ImplicitFunction
    box: Box
    _measure: float

    def __init__(self, function: Callable[[Points], Any], lower: ArrayLike, upper: ArrayLike) -> None:
        object.__setattr__(self, "box", Box(lower, upper))
        object.__setattr__(self, "function", ImplicitFunction(function, self.box))
        share = (self.function(self.box.draw(ENOUGH_SAMPLES)) <= 0).mean()
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

    @property
    def is_polygonal(self) -> bool:
        """No: its boundary is curved."""
        return False

    def outline(self) -> Geometry:
        """Trace the boundary on a grid of 512 x 512 cells, and move it to where the function is 0."""
        if self.n_dims != 2:
            return Region.outline(self)
        from skimage.measure import find_contours

        low, sides = self.bounds[0], self.box.sides
        at = (np.arange(_TRACED + 1) / _TRACED)[:, None] * sides + low
        x, y = np.meshgrid(*at.T)
        values = self.function(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(x.shape)
        outside = max(float(np.abs(values).max()), 1e-300)
        whole, rings = shapely.Polygon(), []
        for ring in find_contours(np.pad(values, 1, constant_values=outside), 0.0):  # type: ignore[no-untyped-call]
            places = self.box.project((ring[:-1, ::-1] - 1) / _TRACED * sides + low)
            inner = ((places > self.bounds[0]) & (places < self.bounds[1])).all(axis=1)
            if inner.any():
                places[inner] = self.function.to_zero(places[inner])
            if len(places) > 2:
                rings.append(shapely.Polygon(places))
        # A ring inside of others is a hole, or an island in it.
        for ring in sorted(rings, key=lambda polygon: -polygon.area):
            whole = shapely.symmetric_difference(whole, shapely.make_valid(ring))
        return whole

    def contains(self, points: ArrayLike) -> Bools:
        """Tell where the function is <= 0, within the bounds."""
        places = self._checked(points)
        return (self.function(places) <= 0) & self.box.contains(places)

    def to_boundary(self, points: ArrayLike) -> Points:
        """Move points to where the function is 0, along its slope: nearest if it is a signed distance."""
        return self.function.to_zero(self._checked(points))

    def boundary_points(self, spacing: float) -> Points:
        """Cover the boundary with points that are drawn near to it."""
        n_cells = np.maximum(1, np.ceil(self.box.sides / spacing)).astype(int)
        centers = self.bounds[0] + (np.argwhere(np.ones(n_cells, bool)) + 0.5) / n_cells * self.box.sides
        ends = self.to_boundary(centers)
        return ends[np.linalg.norm(ends - centers, axis=1) < spacing]

    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, D) points, evenly spread."""
        share = max(self._measure / self.box.measure, 1e-3)
        random = np.random.default_rng(rng)
        points = np.empty((0, self.n_dims))
        while len(points) < n:
            n_more = int(1.1 * (n - len(points)) / share) + 16
            candidates = self.bounds[0] + self.box.sides * low_discrepancy(n_more, self.n_dims, random)
            points = np.concatenate([points, candidates[self.function(candidates) <= 0]])
        return points[:n]
