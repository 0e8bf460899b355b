"""Boxes in any number of dimensions, some of which may be periodic."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_in_range, check_places, check_shape, check_that
from cvtimg.regions.base import Points, Region, low_discrepancy


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class Box(Region):
    """A box with sides along the axes.

    Parameters
    ----------
    lower, upper : (D,) array
        Its least and its greatest corner.
    periodic : bool or sequence of D bools
        Axes along which one side continues at the other: distances wrap around, and there is no boundary.

    Examples
    --------
    >>> from cvtimg.regions import Box
    >>> box = Box([0, 0], [2, 1])
    >>> box.measure, box.contains([[1, 1], [3, 0]]).tolist(), box.project([[3, 0.5]]).tolist()
    (2.0, [True, False], [[2.0, 0.5]])
    """

    _bounds: Points
    periodic: tuple[bool, ...]

    def __init__(self, lower: ArrayLike, upper: ArrayLike, periodic: bool | ArrayLike = False) -> None:
        least, greatest = np.atleast_1d(np.asarray(lower, float)), np.atleast_1d(np.asarray(upper, float))
        check_shape("lower", least.shape, least.ndim == 1 and len(least) > 0, "(D,)")
        check_shape("upper", greatest.shape, greatest.shape == least.shape, f"{least.shape}, as lower")
        bounds = check_places("lower and upper", np.stack([least, greatest]))
        above = f"less than upper={greatest.tolist()} along each axis"
        check_in_range("lower", least.tolist(), (bounds[0] < bounds[1]).all(), above)
        wraps = np.asarray(periodic, bool)
        fits = wraps.shape in ((), least.shape)
        check_shape("periodic", wraps.shape, fits, f"a bool, or {least.shape}, one for each axis")
        bounds.flags.writeable = False
        object.__setattr__(self, "_bounds", bounds)
        object.__setattr__(self, "periodic", tuple(np.broadcast_to(wraps, len(least)).tolist()))

    def __repr__(self) -> str:
        around = ", periodic" if any(self.periodic) else ""
        return f"<Box from {self._bounds[0].tolist()} to {self._bounds[1].tolist()}{around}>"

    @property
    def bounds(self) -> Points:
        """The least and the greatest corner, (2, D)."""
        return self._bounds

    @property
    def sides(self) -> Points:
        """Lengths of its sides, (D,)."""
        sides: Points = self._bounds[1] - self._bounds[0]
        return sides

    @property
    def measure(self) -> float:
        """Length, area or volume."""
        return float(self.sides.prod())

    @property
    def corners(self) -> Points:
        """Its 2^D corners; none if an axis is periodic."""
        if any(self.periodic):
            return np.empty((0, self.n_dims))
        return np.array(list(product(*self._bounds.T)))

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which of (N, D) points lie in it; along a periodic axis all do."""
        places = self._checked(points)
        inside = (places >= self._bounds[0]) & (places <= self._bounds[1]) | np.array(self.periodic)
        return np.asarray(inside.all(axis=1))

    def project(self, points: ArrayLike) -> Points:
        """Move points outside to the nearest side; along a periodic axis, to where they are the same."""
        places, low = self._checked(points), self._bounds[0]
        wrapped = low + (places - low) % self.sides
        return np.where(self.periodic, wrapped, np.clip(places, *self._bounds))

    def to_boundary(self, points: ArrayLike) -> Points:
        """Move points to the nearest side that is not periodic."""
        check_that("periodic", not all(self.periodic), "leave an axis that is not, for the box to have a boundary")
        places = self.project(points)
        gaps = np.stack([places - self._bounds[0], self._bounds[1] - places])
        gaps[:, :, np.array(self.periodic)] = np.inf
        nearest = gaps.transpose(1, 0, 2).reshape(len(places), -1).argmin(axis=1)
        end, axis = np.divmod(nearest, self.n_dims)
        places[np.arange(len(places)), axis] = self._bounds[end, axis]
        return places

    def boundary_points(self, spacing: float) -> Points:
        """Cover each side that is not periodic with a grid of points."""
        sides = []
        for axis, around in enumerate(self.periodic):
            if around:
                continue
            grids = [np.linspace(low, high, max(2, round((high - low) / spacing) + 1)) for low, high in self._bounds.T]
            for end in self._bounds[:, axis]:
                grids[axis] = np.array([end])
                sides.append(np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, self.n_dims))
        return np.concatenate(sides) if sides else np.empty((0, self.n_dims))

    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, D) points, evenly spread."""
        points: Points = self._bounds[0] + low_discrepancy(n, self.n_dims, rng) * self.sides
        return points
