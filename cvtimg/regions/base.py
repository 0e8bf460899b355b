"""What every region can tell."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_count, check_places
from cvtimg.engine.samples import WeightedSamples
from cvtimg.regions.densities import DensityLike, as_density

Points = NDArray[np.float64]

#: More samples than this need more memory than a machine has.
_MOST = 1 << 30


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

    @abstractmethod
    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which of (N, D) points lie in the region or on its boundary."""

    @abstractmethod
    def project(self, points: ArrayLike) -> Points:
        """Move those of (N, D) points that lie outside to the nearest point of the region."""

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
        """Draw samples, each weighted by the density there, as `cvtimg.tessellate` takes them.

        Parameters
        ----------
        n : int
            Number of samples.
        density : None, float, picture or callable
            What `as_density` takes.
        rng : int or numpy.random.Generator
            Seed.

        Returns
        -------
        WeightedSamples
            Weights add up to an estimate of the mass of the region.

        Examples
        --------
        >>> from cvtimg import tessellate
        >>> from cvtimg.regions import Box
        >>> samples = Box([0, 0], [2, 1]).sample(4000)
        >>> sorted(tessellate(samples, 2).generators.round(1).tolist())
        [[0.5, 0.5], [1.5, 0.5]]
        """
        check_count("n", n, _MOST, "what memory holds")
        points = self.draw(n, rng)
        weights = as_density(density)(points) * (self.measure / n)
        return WeightedSamples(points, weights, in_order=False)

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
    points: Points = (origin + np.arange(n)[:, None] * steps) % 1.0
    return points
