"""Parts of the sphere: caps, boxes, the land of the earth, and what else tells points inside from others."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_in_range, check_picture_density, check_returned, check_that
from cvtimg._shared.choices import Options
from cvtimg._shared.types import Bools, Floats, Points
from cvtimg.sphere.densities import GlobePicture, angles_from, check_center, check_globe, to_radians

#: A part of the globe: a function from (N, 3) unit vectors to booleans, polygons in degrees (GeoJSON or shapely), or a
#: map of the globe, white inside.
PartLike: TypeAlias = "Callable[[Points], Any] | Options | ArrayLike | Any"


@dataclass(frozen=True, slots=True)
class Cap:
    """A round part of the sphere.

    Parameters
    ----------
    lon, lat : float
        Its center in degrees.
    radius : float
        In degrees.

    Examples
    --------
    >>> from cvtimg.sphere import Cap
    >>> Cap(0, 90, 10)([[0, 0, 1], [1, 0, 0]]).tolist()
    [True, False]
    """

    lon: float
    lat: float
    radius: float

    def __post_init__(self) -> None:
        check_center(self.lon, self.lat)
        check_in_range("radius", self.radius, 0 < self.radius < 180, "in 0..180 degrees")

    def __call__(self, points: ArrayLike) -> Bools:
        """Tell which of (N, 3) points are inside."""
        return self.depth(np.asarray(points, np.float64)) > 0

    def depth(self, points: Points) -> Floats:
        """Return how far (N, 3) points are inside of the border, in radians; negative outside."""
        return np.radians(self.radius) - angles_from(self.lon, self.lat, points)


@dataclass(frozen=True, slots=True)
class Box:
    """A part of the sphere between two meridians and two parallels.

    Parameters
    ----------
    west, south, east, north : float
        In degrees. It leads from west to east, across the antimeridian where east is less than west.

    Examples
    --------
    >>> from cvtimg.sphere import Box
    >>> Box(170, -10, -170, 10)([[-1, 0, 0], [1, 0, 0]]).tolist()
    [True, False]
    """

    west: float
    south: float
    east: float
    north: float

    def __post_init__(self) -> None:
        for name, value in (("west", self.west), ("east", self.east)):
            check_in_range(name, value, -360 <= value <= 360, "in -360..360 degrees")
        check_in_range("south", self.south, -90 <= self.south <= 90, "in -90..90 degrees")
        check_in_range("north", self.north, self.south < self.north <= 90, "above south and at most 90 degrees")

    def __call__(self, points: ArrayLike) -> Bools:
        """Tell which of (N, 3) points are inside."""
        lon, lat = (np.degrees(angles) for angles in to_radians(np.asarray(points, np.float64)))
        span = (self.east - self.west) % 360 or 360.0
        return ((lon - self.west) % 360 <= span) & (lat >= self.south) & (lat <= self.north)


def inside_of(name: str, part: PartLike, points: Points) -> Bools:
    """Tell which points are in a part."""
    if callable(part):
        inside = np.asarray(part(points))
        check_returned(name, inside, len(points))
        check_that(name, inside.dtype == np.bool_, "return booleans")
        return inside
    if isinstance(part, Mapping) or hasattr(part, "geom_type"):
        from cvtimg.placement import PolygonRegion

        region, (lon, lat) = PolygonRegion(part), (np.degrees(angles) for angles in to_radians(points))
        turns = (-360, 0, 360)  # polygons may go beyond the antimeridian
        return np.logical_or.reduce([region.contains(np.stack([lon + turn, lat], axis=1)) for turn in turns])
    mask = check_globe(name, check_picture_density(name, part))
    return np.asarray(GlobePicture.padded(mask / mask.max())(points) > 0.5)


@cache
def _land() -> dict[str, Any]:
    """Read the land of Natural Earth, 1:110 million, in the public domain."""
    outlines: dict[str, Any] = json.loads((files("cvtimg.sphere") / "land.geojson").read_text())
    return outlines


def earth_land() -> dict[str, Any]:
    """Return the land of the earth as polygons of longitudes and latitudes in degrees.

    They are those of Natural Earth at a scale of 1:110 million, right to some 20 km: for cells from about 50 km on.
    Eurasia goes on beyond 180 degrees.

    Returns
    -------
    dict
        A GeoJSON MultiPolygon.

    Examples
    --------
    >>> from cvtimg import sphere_grid
    >>> from cvtimg.sphere import cull_land, earth_land
    >>> sea = cull_land(sphere_grid(642), earth_land())
    >>> bool(0.65 < sea.areas.sum() / sea.whole.areas.sum() < 0.75)
    True
    """
    return {**_land()}


def earth_coasts() -> list[Floats]:
    """Return the coasts of the earth as lines of longitudes and latitudes in degrees, for charts.

    Returns
    -------
    list of (M, 2) arrays
        The boundaries of `earth_land`, which are closed but for that around the south pole.
    """
    rings = [np.array(ring) for polygon in _land()["coordinates"] for ring in polygon]
    return [np.split(ring, np.flatnonzero(ring[:, 1] == -90))[0] for ring in rings]
