"""Densities on the sphere: functions, images of the globe, and caps of finer cells."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import ENOUGH_SAMPLES
from cvtimg._shared.checks import check_in_range, check_picture_density, check_positive, check_shape, check_that
from cvtimg._shared.growth import limit_growth
from cvtimg._shared.types import Array, Floats, Floats32, Points
from cvtimg.placement.densities import FunctionDensity, PictureDensity

#: Share of the largest density to which less is raised, for cells of 100 times the size: with more, fewer are as large.
LEAST_DENSITY = 1e-8
#: Share of the largest density to which black is raised in pictures, as it says nothing of sizes: 10 times the size.
_LEAST_IN_PICTURES = 1e-4
#: Share by which sizes of cells may grow on the way through a cell: with more, fewer points do, and angles are worse.
GROWTH = 0.15
#: Rounds to find how many points that takes: with more, the number that is asked for is met more closely.
_ROUNDS = 6


#: A density on the unit sphere: from (N, 3) unit vectors to (N,) values.
SphereDensity = Callable[[Points], Floats]
#: What `sphere_grid` takes as a density.
SphereDensityLike: TypeAlias = "Callable[[Points], Any] | ArrayLike | Refinement | Sequence[Refinement] | None"


@dataclass(frozen=True, slots=True)
class Refinement:
    """A cap of finer cells.

    Parameters
    ----------
    lon, lat : float
        Its center in degrees.
    radius : float
        In degrees.
    ratio : float
        Size of cells outside by that inside, >= 1.
    width : float, optional
        How wide the transition is, in degrees; by default 0.6 times the radius.

    Notes
    -----
    With distance d from the center, the density is ((1 - g) tanh((radius - d) / (width / 2)) + 1 + g) / 2 for
    g = ratio^-4, since the size of cells goes as density^(-1/4).

    References
    ----------
    T. Ringler, L. Ju, M. Gunzburger, A multiresolution method for climate system modeling: application of spherical
    centroidal Voronoi tessellations, Ocean Dynamics 58 (2008) 475-498, doi 10.1007/s10236-008-0157-2.

    Examples
    --------
    >>> from cvtimg.sphere import Refinement
    >>> europe = Refinement(10, 50, radius=20, ratio=4)
    >>> europe([[-1, 0, 0]]).round(6).tolist()  # far away
    [0.003906]
    """

    lon: float
    lat: float
    radius: float
    ratio: float
    width: float | None = None

    def __post_init__(self) -> None:
        check_center(self.lon, self.lat)
        check_in_range("radius", self.radius, 0 < self.radius <= 180, "in 0..180 degrees, > 0")
        check_in_range("ratio", self.ratio, 1 <= self.ratio <= 100, "in 1..100")
        if self.width is not None:
            check_positive("width", self.width, "in degrees")

    def __call__(self, points: ArrayLike) -> Floats:
        """Return the density at (N, 3) points: 1 inside, and less outside."""
        distance = angles_from(self.lon, self.lat, np.asarray(points))
        width = np.radians(0.6 * self.radius if self.width is None else self.width)
        inside = (1 + np.tanh((np.radians(self.radius) - distance) / (width / 2))) / 2
        least = self.ratio**-4
        return least + (1 - least) * inside


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """Several densities at once: cells are as small as the finest wants them."""

    parts: tuple[SphereDensity, ...]

    def __call__(self, points: Points) -> Floats:
        """Return the largest density at (N, 3) points."""
        return np.max([part(points) for part in self.parts], axis=0)


@dataclass(frozen=True, slots=True, eq=False)
class GlobePicture:
    """An image of the globe as a function on the sphere, interpolated between the centers of its pixels.

    Attributes
    ----------
    picture : (H, 2 H) float32 array
        Equirectangular: longitudes from -180 to 180 degrees along rows, latitudes from 90 to -90 along columns.
    """

    picture: Floats32
    _padded: PictureDensity

    @classmethod
    def of(cls, name: str, picture: ArrayLike) -> GlobePicture:
        """Check an image of densities: finite, >= 0 and not all 0."""
        return cls.padded(check_globe(name, check_picture_density(name, picture)))

    @classmethod
    def padded(cls, picture: Floats32) -> GlobePicture:
        """Add the columns that lie beyond both ends of the date line."""
        return cls(picture, PictureDensity(np.concatenate([picture[:, -1:], picture, picture[:, :1]], axis=1)))

    def __call__(self, points: Points) -> Floats:
        """Return the value at (N, 3) points."""
        lon, lat = to_radians(points)
        height, width = self.picture.shape
        return self._padded(np.stack([(lon / (2 * np.pi) + 0.5) * width + 1, (0.5 - lat / np.pi) * height], axis=1))

    def for_cells(self, n: int) -> GlobePicture:
        """Return a density by which n cells can follow the image: no finer in detail, and not growing too fast."""
        roots = np.sqrt(np.maximum(self.picture / self.picture.max(), _LEAST_IN_PICTURES), dtype=np.float64)
        weights = _row_weights(len(roots))
        spacing = np.sqrt(4 * np.pi * (roots.mean(axis=1) @ weights) / n)
        coarse = self.coarsened(spacing).picture.astype(np.float64)
        roots = np.sqrt(np.maximum(coarse / coarse.max(), _LEAST_IN_PICTURES))
        weights, factor = _row_weights(len(roots)), spacing
        for _ in range(_ROUNDS):
            sizes = factor / np.sqrt(roots)
            limit_on_globe(sizes, GROWTH)
            factor *= np.sqrt(4 * np.pi * ((sizes**-2).mean(axis=1) @ weights) / n)
        return GlobePicture.padded(((sizes.min() / sizes) ** 4).astype(np.float32))

    def coarsened(self, spacing: float) -> GlobePicture:
        """Return means over blocks of pixels that are no larger than `spacing`, an angle in radians."""
        height = self.picture.shape[0]
        block = 1
        while height % (2 * block) == 0 and 2 * block * np.pi / height <= spacing:
            block *= 2
        if block == 1:
            return self
        blocks = self.picture.reshape(height // block, block, -1, block)
        return GlobePicture.padded(blocks.mean(axis=(1, 3), dtype=np.float64).astype(np.float32))


def check_globe(name: str, picture: Array) -> Array:
    """Return an image if it can be one of the globe."""
    height, width = picture.shape[:2]
    check_shape(name, picture.shape, width == 2 * height, "twice as wide as high: an image of the globe")
    return picture


def as_sphere_density(density: SphereDensityLike) -> SphereDensity | None:
    """Return a checked density; None for 1 everywhere."""
    if density is None or isinstance(density, (Refinement, GlobePicture, Refined, FunctionDensity)):
        return density
    if callable(density):
        # Cells of one width are placed by exact moments.
        return None if getattr(density, "is_even", False) else FunctionDensity(density)
    if isinstance(density, (list, tuple)) and density and all(map(callable, density)):
        return Refined(tuple(density))
    if np.ndim(density) == 0:  # type: ignore[arg-type]
        check_positive("density", float(np.asarray(density)), "an image or a function")
        return None
    return GlobePicture.of("density", density)  # type: ignore[arg-type]


def by_spacing(brightness: ArrayLike, ratio: float) -> Floats32:
    """Return the density of cells that are `ratio` times smaller where an image is brightest than where it is black.

    Parameters
    ----------
    brightness : (H, 2 H) array
        An image of the globe: finite, >= 0 and not all 0.
    ratio : float
        In 1..100. Sizes of cells are geometric between the ends.

    Examples
    --------
    >>> from cvtimg.sphere import by_spacing
    >>> by_spacing([[0, 255]], 2).tolist()
    [[0.0625, 1.0]]
    """
    values = check_globe("brightness", check_picture_density("brightness", brightness))
    check_in_range("ratio", ratio, 1 <= ratio <= 100, "in 1..100")
    finest = values / values.max()
    return np.power(float(ratio), -4 * (1 - finest.astype(np.float64))).astype(np.float32)


class Scaled:
    """A density with a floor, at places where a grid needs it."""

    def __init__(self, density: SphereDensity) -> None:
        self._density = density
        values = density(fibonacci(ENOUGH_SAMPLES // 4))
        highest = float(density.picture.max() if isinstance(density, GlobePicture) else values.max())
        check_that("density", highest > 0, "not be 0 everywhere")
        # Squares and products of masses would leave the range of doubles: such densities are divided by this.
        self.unit = 1.0 if 1e-100 < highest < 1e100 else highest
        self.share_of_zeros = float((values == 0).mean())
        self._least = LEAST_DENSITY * (highest / self.unit)

    def __call__(self, points: Points) -> Floats:
        """Return the density at (N, 3) points, at least a small part of the largest."""
        return np.maximum(self._density(points) / self.unit, self._least)

    def for_cells(self, n: int) -> Scaled:
        """Return the density with images that n cells can follow."""
        density = self._density
        if isinstance(density, Refined):
            parts = [part.for_cells(n) if isinstance(part, GlobePicture) else part for part in density.parts]
            return Scaled(Refined(tuple(parts)))
        return Scaled(density.for_cells(n)) if isinstance(density, GlobePicture) else self


def limit_on_globe(sizes: Floats, growth: float) -> None:
    """Lower sizes in an image of the globe until they grow by no more than `growth` for each radian."""
    height, width = sizes.shape
    across = growth * np.pi / height
    around = np.tile(sizes, 3)  # so that what is beyond the date line counts
    limit_growth(around, across, across * np.cos(np.pi * (0.5 - (np.arange(height) + 0.5) / height)))
    sizes[:] = around[:, width : 2 * width]


def _row_weights(height: int) -> Floats:
    """Return the share of the sphere that each row of an image of the globe covers."""
    edges = np.sin(np.pi * (0.5 - np.arange(height + 1) / height))
    return -np.diff(edges) / 2


def from_degrees(lon: ArrayLike, lat: ArrayLike) -> Points:
    """Return unit vectors (N, 3) of longitudes and latitudes in degrees."""
    east, north = np.radians(np.atleast_1d(lon)), np.radians(np.atleast_1d(lat))
    return np.stack([np.cos(north) * np.cos(east), np.cos(north) * np.sin(east), np.sin(north)], axis=1)


def angles_from(lon: float, lat: float, points: Points) -> Floats:
    """Return the angles (N,) in radians between points and a center in degrees."""
    return np.arccos(np.clip(points @ from_degrees(lon, lat)[0], -1, 1))


def check_center(lon: float, lat: float) -> None:
    """Check the center of a part of the sphere, in degrees."""
    check_in_range("lon", lon, -360 <= lon <= 360, "in -360..360 degrees")
    check_in_range("lat", lat, -90 <= lat <= 90, "in -90..90 degrees")


def to_radians(points: Points) -> tuple[Floats, Floats]:
    """Return longitudes and latitudes (N,) of points."""
    return np.arctan2(points[:, 1], points[:, 0]), np.arcsin(np.clip(points[:, 2], -1, 1))


def fibonacci(n: int) -> Points:
    """Return N points that are spread evenly along a spiral."""
    i = np.arange(n) + 0.5
    z = 1 - 2 * i / n
    turn = np.pi * (1 + 5**0.5) * i
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
