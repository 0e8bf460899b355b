"""Outlines in degrees, meshed in km: an equal-area projection about their middle.

J. P. Snyder, Map Projections: A Working Manual, U.S. Geological Survey Professional Paper 1395 (1987), 182-190,
doi 10.3133/pp1395: Lambert's azimuthal equal-area projection of a sphere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvtimg._shared.checks import check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Points
from cvtimg.placement import PolygonRegion

#: Radius, in km, of the sphere with the area of the earth.
_RADIUS = 6371.0072
#: Edges are divided to at most this many degrees first, since they are straight on maps of degrees.
_LONGEST = 1.0
#: How far from the middle outlines may reach, in degrees: lengths are off by a tenth at 50, by a fifth at 70.
_FARTHEST = 120.0


@dataclass(frozen=True, slots=True)
class LocalProjection:
    """From longitude and latitude in degrees to km around a middle, and back; areas are kept.

    Parameters
    ----------
    lon, lat : float
        The middle, in degrees.

    Examples
    --------
    >>> from cvtimg.meshes import LocalProjection
    >>> local = LocalProjection(179, 60)
    >>> places = local.to_km(np.array([[-179.0, 60.0], [177.0, 60.0]]))
    >>> (abs(places[:, 0]) / 111.2).round(2).tolist(), local.to_degrees(places).round(6).tolist()
    ([1.0, 1.0], [[181.0, 60.0], [177.0, 60.0]])
    """

    lon: float
    lat: float

    @classmethod
    def about(cls, polygons: object) -> LocalProjection:
        """Return that about the middle of polygons of shapely, which may be cut by the date line."""
        lon, lat = np.radians(shapely.get_coordinates(shapely.segmentize(polygons, _LONGEST))).T
        x, y, z = (float(part.mean()) for part in (np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)))
        return cls(float(np.degrees(np.arctan2(y, x))), float(np.degrees(np.arctan2(z, np.hypot(x, y)))))

    def to_km(self, places: Points) -> Points:
        """Project places (N, 2) in degrees."""
        lon, lat = np.radians(places[:, 0] - self.lon), np.radians(places[:, 1])
        sine, cosine = np.sin(np.radians(self.lat)), np.cos(np.radians(self.lat))
        along = sine * np.sin(lat) + cosine * np.cos(lat) * np.cos(lon)
        check_that("outlines", bool((along > np.cos(np.radians(_FARTHEST))).all()), "reach less far around the globe")
        scale = _RADIUS * np.sqrt(2 / (1 + along))
        up = cosine * np.sin(lat) - sine * np.cos(lat) * np.cos(lon)
        return np.stack([scale * np.cos(lat) * np.sin(lon), scale * up], axis=1)

    def to_degrees(self, places: Points) -> Points:
        """Return the longitudes, at most 180 degrees from the middle, and latitudes of places (N, 2) in km."""
        far = np.maximum(np.hypot(*places.T), 1e-12)
        angle = 2 * np.arcsin(np.minimum(far / (2 * _RADIUS), 1))
        (x, y), middle = places.T / far * np.sin(angle), np.radians(self.lat)
        sine, cosine = np.sin(middle), np.cos(middle)
        lat = np.arcsin(np.clip(np.cos(angle) * sine + y * cosine, -1, 1))
        lon = np.arctan2(x, cosine * np.cos(angle) - y * sine)
        return np.stack([self.lon + np.degrees(lon), np.degrees(lat)], axis=1)

    def region(self, polygons: object) -> PolygonRegion:
        """Project polygons of shapely; those cut by the date line are joined."""
        parts = shapely.get_parts(shapely.segmentize(polygons, _LONGEST))
        # Points a millimeter apart are one where polygons were cut along the date line.
        return PolygonRegion(shapely.union_all(shapely.transform(parts, self.to_km), grid_size=1e-6))


def looks_like_degrees(places: Points) -> bool:
    """Tell whether places (N, 2) are likely to be longitudes and latitudes."""
    most = np.abs(places).max(axis=0)
    return bool(10 < most[0] <= 360 and 10 < most[1] <= 90)
