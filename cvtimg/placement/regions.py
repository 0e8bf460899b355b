"""Regions of space that generators are placed in; and boxes, some of whose sides may be periodic."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MOST_POINTS
from cvtimg._shared.checks import check_count, check_in_range, check_places, check_shape, check_that, refuse
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Array, Bools, Points
from cvtimg.engine.samples import WeightedSamples
from cvtimg.placement.densities import DensityLike, as_density

#: shapely has no types that a checker could use.
Geometry: TypeAlias = Any


class Region(ABC):
    """A bounded part of space of D dimensions.

    Points are (N, D) float64 arrays. A region of pixels has (x, y) in pixels, x to the right and y down, the first
    pixel covering [0, 1] x [0, 1]; every other region has coordinates of its own.
    """

    __slots__ = ()

    @property
    @abstractmethod
    def bounds(self) -> Points:
        """The least and the greatest coordinates, (2, D)."""

    @property
    @abstractmethod
    def measure(self) -> float:
        """Length, area or volume."""

    @property
    def n_dims(self) -> int:
        """Number of dimensions, D."""
        return int(self.bounds.shape[1])

    @property
    def corners(self) -> Points:
        """Points (C, D) where the boundary has a corner; none where it is smooth."""
        return np.empty((0, self.n_dims))

    @property
    def is_polygonal(self) -> bool:
        """Whether it is a part of the plane with straight sides, where Voronoi cells are polygons."""
        return self.n_dims == 2

    def outline(self) -> Geometry:
        """Return a region of the plane as a shapely geometry."""
        raise ValueError(f"region={self!r} must be in the plane and have a boundary")

    @abstractmethod
    def contains(self, points: ArrayLike) -> Bools:
        """Tell which of (N, D) points lie in the region or on its boundary."""

    def project(self, points: ArrayLike) -> Points:
        """Move those of (N, D) points that lie outside to the nearest point of the region."""
        places = self._checked(points).copy()
        outside = ~self.contains(places)
        if outside.any():
            places[outside] = self.to_boundary(places[outside])
        return places

    @abstractmethod
    def to_boundary(self, points: ArrayLike) -> Points:
        """Move (N, D) points to the nearest point of the boundary."""

    @abstractmethod
    def boundary_points(self, spacing: float) -> Points:
        """Cover the boundary with (B, D) points, about `spacing` apart."""

    @abstractmethod
    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, D) points that are spread uniformly over the region."""

    def sample(self, n: int, *, density: DensityLike = None, rng: int | np.random.Generator = 0) -> WeightedSamples:
        """Draw n samples, each weighted by the density there (what `as_density` takes), as for `cvtimg.tessellate`.

        Weights add up to an estimate of the mass of the region.

        Examples
        --------
        >>> from cvtimg import tessellate
        >>> from cvtimg.placement import Box
        >>> samples = Box([0, 0], [2, 1]).sample(4000)
        >>> sorted(tessellate(samples, 2).generators.round(1).tolist())
        [[0.5, 0.5], [1.5, 0.5]]
        """
        n = check_count("n", n, MOST_POINTS, "what memory holds")
        points = self.draw(n, rng)
        weights = as_density(density)(points) * (self.measure / n)
        return WeightedSamples(points, weights, in_order=False)

    def nearest(self, points: Points, places: Points, n: int = 1, p: float = 2) -> tuple[Array, Array]:
        """Find the n nearest (K, D) points by the p-norm for each of (M, D) places: distances and indices."""
        from scipy.spatial import cKDTree

        return cKDTree(points).query(places, n, p=p)

    def shortest(self, steps: Points) -> Points:
        """Take (M, D) steps the short way."""
        return steps

    def _checked(self, points: ArrayLike) -> Points:
        return check_places("points", points, self.n_dims)


def low_discrepancy(n: int, n_dims: int, rng: int | np.random.Generator) -> Points:
    """Draw (n, D) points of the unit cube, spread more evenly than chance does.

    Multiples of powers of 1 / phi, for phi the root of x^(D + 1) = x + 1, from an origin that is drawn.
    """
    phi = 2.0
    for _ in range(64):
        phi = (1 + phi) ** (1 / (n_dims + 1))
    steps = (1 / phi) ** np.arange(1, n_dims + 1)
    origin = np.random.default_rng(rng).random(n_dims)
    return (origin + np.arange(n)[:, None] * steps) % 1.0


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
    >>> from cvtimg.placement import Box
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
        sides = bounds[1] - bounds[0]
        with np.errstate(over="ignore", under="ignore"):
            energies = sides.prod() * np.array([sides.min(), sides.max()]) ** 2
        if not np.finfo(np.float64).tiny < energies[0] <= energies[1] < np.inf:
            refuse("upper - lower", sides.tolist(), "such that energies of cells are numbers")
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
        return self._bounds[1] - self._bounds[0]

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

    def outline(self) -> Geometry:
        """Return a box of the plane as a shapely polygon."""
        if self.n_dims != 2:
            return Region.outline(self)
        (left, low), (right, high) = self._bounds
        return shapely.Polygon([[left, low], [right, low], [right, high], [left, high]])

    def contains(self, points: ArrayLike) -> Bools:
        """Tell which of (N, D) points lie in it; along a periodic axis all do."""
        places = self._checked(points)
        inside = (places >= self._bounds[0]) & (places <= self._bounds[1]) | np.array(self.periodic)
        return inside.all(axis=1)

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

    def nearest(self, points: Points, places: Points, n: int = 1, p: float = 2) -> tuple[Array, Array]:
        """Find the n nearest points, around periodic axes too."""
        from scipy.spatial import cKDTree

        if not any(self.periodic):
            return Region.nearest(self, points, places, n, p)
        # A tree takes what is below the side, not the side itself.
        tree, queries = (
            np.where(self.periodic, np.minimum(self.project(at) - self._bounds[0], np.nextafter(self.sides, 0)), at)
            for at in (points, places)
        )
        return cKDTree(tree, boxsize=np.where(self.periodic, self.sides, 0)).query(queries, n, p=p)

    def shortest(self, steps: Points) -> Points:
        """Take (M, D) steps the short way around periodic axes."""
        turns = np.rint(steps * np.where(self.periodic, 1 / self.sides, 0.0)) if any(self.periodic) else 0.0
        return steps - turns * self.sides

    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, D) points, evenly spread."""
        return self._bounds[0] + low_discrepancy(n, self.n_dims, rng) * self.sides
