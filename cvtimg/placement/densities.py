"""Densities: how much each place of a region counts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_picture_density, check_positive, check_values, refuse_type
from cvtimg._shared.types import Floats, Floats32, Points

#: From (N, D) points to their (N,) densities.
Density: TypeAlias = Callable[[Points], Floats]
#: What `as_density` takes.
DensityLike: TypeAlias = float | ArrayLike | Callable[[Points], ArrayLike] | None


@dataclass(frozen=True, slots=True)
class ConstantDensity:
    """The same density everywhere."""

    value: float = 1.0

    def __call__(self, points: Points) -> Floats:
        """Return the density at (N, D) points."""
        return np.full(len(points), self.value)


@dataclass(frozen=True, slots=True, eq=False)
class PictureDensity:
    """The values of an image, interpolated from the centers of its pixels; beyond the outermost they stay the same.

    Attributes
    ----------
    picture : (H, W) float32 array
    """

    picture: Floats32

    def __call__(self, points: Points) -> Floats:
        """Return the density at (N, 2) points (x, y) in pixels."""
        from scipy.ndimage import map_coordinates

        at = points.T[::-1] - 0.5
        return map_coordinates(self.picture, at, np.float64, order=1, mode="nearest")


@dataclass(frozen=True, slots=True, eq=False)
class FunctionDensity:
    """A function of (N, D) points, checked at each call."""

    function: Callable[[Points], Any]

    def __call__(self, points: Points) -> Floats:
        """Return the density at (N, D) points."""
        holds = "finite and >= 0"
        return check_values("density", self.function(points), points, lambda at: (at >= 0) & (at < np.inf), holds)


def as_density(density: DensityLike) -> Density:
    """Make a density of a number, an image or a function.

    Parameters
    ----------
    density : None, float, (H, W) array or callable
        None for 1 everywhere; a number > 0; an image, interpolated bilinearly, at places (x, y) in pixels; or a
        function from (N, D) points to (N,) values >= 0.

    Returns
    -------
    callable
        From (N, D) points to (N,) densities.

    Examples
    --------
    >>> from cvtimg.placement import as_density
    >>> as_density([[0, 1], [0, 1]])(np.array([[1.0, 1.0], [2.0, 0.0]])).tolist()
    [0.5, 1.0]
    """
    if density is None:
        return ConstantDensity()
    if isinstance(density, (ConstantDensity, PictureDensity, FunctionDensity)):
        return density
    if callable(density):
        return FunctionDensity(density)
    if isinstance(density, (str, bytes)):
        refuse_type("density", type(density).__name__, "a number, an image or a function")
    if np.ndim(density) == 0:
        return ConstantDensity(check_positive("density", float(np.asarray(density)), "an image or a function"))
    return PictureDensity(check_picture_density("density", density))
