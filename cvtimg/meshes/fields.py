"""Size fields: how long edges should be at each place, where that comes from an image or is constant in one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np

from cvtimg._shared.growth import limit_growth
from cvtimg._shared.types import Bools, Floats, Floats32, Points
from cvtimg.placement.pictures import draw_along_curve

#: Vertices in an area of 1 where edges have length 1: two triangles each.
PER_AREA = 2 / 3**0.5


class Field(Protocol):
    """Sizes or metrics at all places of a region."""

    isotropic: ClassVar[bool] = True  # Whether edges are as long in all directions

    @property
    def count(self) -> float:
        """About how many vertices a mesh has, but for half of those on its boundary."""

    def metric(self, points: Points) -> Points:
        """Return metrics (N, 3), xx, xy and yy, in which edges should have length 1, at (N, 2) points."""

    def scaled(self, factor: float) -> Field:
        """Return the field with all edges longer by a factor."""

    def limited(self, grade: float, least: float) -> Field:
        """Return the field with sizes >= `least` that grow by no more than `grade` for each unit of length."""

    def lowered(self, points: Points, sizes: Floats, grade: float) -> Field:
        """Return the field with sizes not above those given at some points, and growing by `grade` from there."""

    def seeds(self, n: int, rng: np.random.Generator) -> Points:
        """Draw (n, 2) points, in order along a curve, with about one for each vertex that a mesh has."""


def metric_of(sizes: Floats) -> Points:
    """Return the metrics (N, 3) of (N,) sizes."""
    metric = np.zeros((len(sizes), 3))
    metric[:, 0] = metric[:, 2] = 1 / (sizes * sizes)
    return metric


def lengths_of(metric: Points, steps: Points) -> Floats:
    """Return the lengths (N,) of steps (N, 2) in metrics (N, 3)."""
    (xx, xy, yy), (x, y) = metric.T, steps.T
    return np.sqrt(xx * x * x + 2 * xy * x * y + yy * y * y)


@dataclass(frozen=True, slots=True, eq=False)
class PictureField(Field):
    """Sizes at the centers of pixels."""

    sizes: Floats32  # (H, W)
    inside: Bools  # (H, W): the pixels that are meshed

    @property
    def count(self) -> float:
        return PER_AREA * float((self.sizes[self.inside].astype(np.float64) ** -2.0).sum())

    def metric(self, points: Points) -> Points:
        from scipy.ndimage import map_coordinates

        return metric_of(map_coordinates(self.sizes, points.T[::-1] - 0.5, np.float64, order=1, mode="nearest"))

    def scaled(self, factor: float) -> PictureField:
        return replace(self, sizes=self.sizes * np.float32(factor))

    def limited(self, grade: float, least: float) -> PictureField:
        sizes = np.maximum(self.sizes, np.float32(least))
        limit_growth(sizes, grade, grade)
        return replace(self, sizes=sizes)

    def lowered(self, points: Points, sizes: Floats, grade: float) -> PictureField:
        values = self.sizes.copy()
        x, y = (np.clip(at.astype(np.intp), 0, n - 1) for at, n in zip(points.T, values.shape[::-1], strict=True))
        np.minimum.at(values, (y, x), sizes.astype(np.float32))
        return PictureField(values, self.inside).limited(grade, 0)

    def seeds(self, n: int, rng: np.random.Generator) -> Points:
        density = np.where(self.inside, self.sizes, np.inf).astype(np.float32)
        low = float(density.min())
        return draw_along_curve((density / np.float32(low)) ** np.float32(-4), n, rng)
