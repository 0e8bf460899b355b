"""Gauges: how far a place is from a generator, in other metrics than the Euclidean."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_finite, check_in_range, check_shape, check_that
from cvtimg.placement.densities import Points


class Gauge(ABC):
    """A distance that scales: g(t y) = t g(y) for t >= 0, for the step y from a generator to a place."""

    __slots__ = ()

    @abstractmethod
    def lengths(self, steps: Points) -> NDArray[np.float64]:
        """Compute the (N,) lengths of (N, D) steps."""

    @abstractmethod
    def slopes(self, steps: Points) -> Points:
        """Compute the (N, D) gradients of the lengths by the steps."""

    @abstractmethod
    def least(self, n_dims: int) -> float:
        """Return the greatest a such that a |y| <= g(y)."""


@dataclass(frozen=True, slots=True)
class LpGauge(Gauge):
    """The p-norm, 1 <= p <= infinity.

    Attributes
    ----------
    p : float
        1 for the sum of the coordinates, 2 for the Euclidean length, infinity for the largest coordinate.
    """

    p: float

    def __post_init__(self) -> None:
        check_in_range("metric", self.p, self.p >= 1, ">= 1, the power of a p-norm")

    def lengths(self, steps: Points) -> NDArray[np.float64]:
        """Compute the (N,) lengths of (N, D) steps."""
        sizes = np.abs(steps)
        largest = sizes.max(axis=1)
        if np.isinf(self.p):
            return largest
        shares = sizes / np.maximum(largest, 1e-300)[:, None]
        return largest * (shares**self.p).sum(axis=1) ** (1 / self.p)

    def slopes(self, steps: Points) -> Points:
        """Compute the (N, D) gradients of the lengths by the steps."""
        sizes = np.abs(steps)
        if np.isinf(self.p):
            first = sizes.argmax(axis=1)[:, None] == np.arange(steps.shape[1])
            return np.where(first, np.sign(steps), 0.0)
        shares = sizes / np.maximum(self.lengths(steps), 1e-300)[:, None]
        return np.sign(steps) * shares ** (self.p - 1)

    def least(self, n_dims: int) -> float:
        """Return the greatest a such that a |y| <= g(y)."""
        return min(1.0, float(n_dims ** ((0 if np.isinf(self.p) else 1 / self.p) - 0.5)))


@dataclass(frozen=True, slots=True, eq=False, init=False)
class PolygonGauge(Gauge):
    """The gauge of a convex polygon around the origin: 1 on its sides. It need not be symmetric.

    Parameters
    ----------
    corners : (M, 2) array
        In either direction of turning.
    """

    normals: Points
    _least: float

    def __init__(self, corners: ArrayLike) -> None:
        places = np.asarray(corners, np.float64)
        fits = places.ndim == 2 and places.shape[1] == 2 and len(places) >= 3
        check_shape("metric", places.shape, fits, "the (M, 2) corners of a convex polygon, M >= 3")
        check_finite("metric", places)
        x, y = places.T
        if (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() < 0:
            places = places[::-1]
        sides = np.roll(places, -1, axis=0) - places
        turns = sides[:, 0] * np.roll(sides[:, 1], -1) - sides[:, 1] * np.roll(sides[:, 0], -1)
        outward = np.stack([sides[:, 1], -sides[:, 0]], axis=1)
        offsets = (outward * places).sum(axis=1)
        convex = (turns > 0).all() and (offsets > 0).all()
        check_that("metric", convex, "be the corners of a convex polygon around the origin")
        object.__setattr__(self, "normals", outward / offsets[:, None])
        object.__setattr__(self, "_least", 1 / float(np.linalg.norm(places, axis=1).max()))

    def lengths(self, steps: Points) -> NDArray[np.float64]:
        """Compute the (N,) lengths of (N, 2) steps."""
        return (steps @ self.normals.T).max(axis=1)

    def slopes(self, steps: Points) -> Points:
        """Compute the (N, 2) gradients of the lengths by the steps."""
        return self.normals[(steps @ self.normals.T).argmax(axis=1)]

    def least(self, n_dims: int) -> float:
        """Return the greatest a such that a |y| <= g(y): they are equal in the farthest corner."""
        return self._least


#: Names for `metric`.
GAUGES: dict[str, Gauge] = {
    "euclidean": LpGauge(2),
    "taxicab": LpGauge(1),
    "maximum": LpGauge(np.inf),
    "triangle": PolygonGauge(np.array([[0, -1], [0.75**0.5, 0.5], [-(0.75**0.5), 0.5]])),
}
#: What `as_gauge` takes.
MetricLike: TypeAlias = str | float | ArrayLike | Gauge


def as_gauge(metric: MetricLike) -> Gauge:
    """Make a gauge of a name, of the power p of a p-norm, or of the corners of a convex polygon.

    Examples
    --------
    >>> from cvtimg.placement import as_gauge
    >>> [as_gauge(p).lengths(np.array([[3.0, -4.0]])).item() for p in (1, 2, np.inf)]
    [7.0, 5.0, 4.0]
    """
    if isinstance(metric, Gauge):
        return metric
    if isinstance(metric, str):
        named = f"one of {', '.join(GAUGES)}, a power p >= 1, or a polygon"
        check_in_range("metric", metric, metric in GAUGES, named)
        return GAUGES[metric]
    return LpGauge(float(np.asarray(metric))) if np.ndim(metric) == 0 else PolygonGauge(metric)
