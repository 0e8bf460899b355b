"""Polygons with holes, by shapely."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_finite, check_in_range, check_shape, check_that
from cvtimg._shared.extras import needs
from cvtimg.labels.contours import find_contours
from cvtimg.regions.base import Points, Region

# shapely has no types that a checker could use.
Geometry: TypeAlias = Any

#: Where a boundary turns by less, in degrees, it has no corner.
_SMOOTH = 30.0
#: Corners that are nearer to each other than this part of the extent are one, which rounding has doubled.
_ONE = 1e-13


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class PolygonRegion(Region):
    """One or more polygons, with holes or without.

    Parameters
    ----------
    shape : (N, 2) array, sequence of (N, 2) arrays, GeoJSON or shapely geometry
        Coordinates of a ring; of an outer ring and its holes; a GeoJSON mapping, its geometries taken together; or a
        shapely Polygon or MultiPolygon.

    Notes
    -----
    Needs shapely: ``pip install 'cvtimg[regions]'``.

    Examples
    --------
    >>> from cvtimg.regions import PolygonRegion
    >>> frame = PolygonRegion([[[0, 0], [4, 0], [4, 4], [0, 4]], [[1, 1], [3, 1], [3, 3], [1, 3]]])
    >>> frame.measure, frame.contains([[2, 2], [0.5, 2]]).tolist(), len(frame.corners)
    (12.0, [False, True], 8)
    """

    geometry: Geometry

    def __init__(self, shape: Any) -> None:
        shapely = _shapely()
        geometry = shape if isinstance(shape, shapely.Geometry) else _as_geometry(shape)
        has_area = shapely.get_dimensions(geometry) == 2 and (geometry.area > 0 or not _is_flat(geometry))
        check_that(f"a {geometry.geom_type} of area {geometry.area:g}", has_area, "be a polygon with area > 0")
        if not shapely.is_valid(geometry):
            _refuse_invalid(shapely.is_valid_reason(geometry))
        shapely.prepare(geometry)
        object.__setattr__(self, "geometry", geometry)

    @classmethod
    def from_labels(cls, labels: ArrayLike, label: int | None = None, *, tolerance: float = 0) -> PolygonRegion:
        """Make it of the contours of a mask or of a segment.

        Parameters
        ----------
        labels : (H, W) array
            A mask, or segments of a picture.
        label : int, optional
            The segment; by default all that are not 0.
        tolerance : float
            How far contours may be moved to make them simpler, in pixels.
        """
        segments = np.asarray(labels)
        inside = segments == label if label is not None else segments != 0
        check_in_range("label", label, inside.any(), "that of a pixel: the region is empty")
        found = find_contours(inside.astype(np.int32), tolerance=tolerance)
        shapely = _shapely()
        return cls(shapely.union_all([shapely.Polygon(each.rings[0], each.rings[1:]) for each in found.polygons]))

    def __repr__(self) -> str:
        n = len(_shapely().get_parts(self.geometry))
        return f"<PolygonRegion of {n} polygon{'s' if n > 1 else ''}, area {self.measure:g}>"

    @property
    def bounds(self) -> Points:
        """The least and the greatest coordinates, (2, 2)."""
        return np.array(self.geometry.bounds).reshape(2, 2)

    @property
    def measure(self) -> float:
        """Area."""
        return float(self.geometry.area)

    @property
    def corners(self) -> Points:
        """Points where the boundary turns by more than 30 degrees."""
        shapely = _shapely()
        found = []
        for ring in shapely.get_rings(shapely.get_parts(self.geometry)):
            places = shapely.get_coordinates(ring)[:-1]
            before, after = places - np.roll(places, 1, axis=0), np.roll(places, -1, axis=0) - places
            turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
            found.append(places[np.abs(turn) > np.radians(_SMOOTH)])
        return np.concatenate(found)

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which of (N, 2) points lie in it or on its boundary."""
        places = self._checked(points)
        return np.asarray(_shapely().intersects_xy(self.geometry, *places.T))

    def project(self, points: ArrayLike) -> Points:
        """Move points outside to the nearest point of the boundary."""
        places = self._checked(points).copy()
        outside = ~self.contains(places)
        if outside.any():
            places[outside] = self.to_boundary(places[outside])
        return places

    def to_boundary(self, points: ArrayLike) -> Points:
        """Move points to the nearest point of the boundary."""
        shapely = _shapely()
        lines = shapely.shortest_line(shapely.boundary(self.geometry), shapely.points(self._checked(points)))
        ends: Points = shapely.get_coordinates(lines)[::2]
        return ends

    def boundary_points(self, spacing: float) -> Points:
        """Cover the boundary with points, all corners among them."""
        shapely = _shapely()
        dense = shapely.segmentize(shapely.boundary(self.geometry), spacing)
        return np.unique(shapely.get_coordinates(dense), axis=0)

    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, 2) points, from triangles by their areas."""
        random = np.random.default_rng(rng)
        triangles = triangulate(np.array([self.geometry]))[0]
        areas = np.cumsum(triangle_areas(triangles))
        # Evenly spaced along the areas, so that each triangle has its share.
        own = np.searchsorted(areas, (np.arange(n) + random.random()) / n * areas[-1])
        first, second, third = triangles[np.minimum(own, len(areas) - 1)].transpose(1, 0, 2)
        u, v = random.random((2, n, 1))
        over = u + v > 1
        u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
        points: Points = first + u * (second - first) + v * (third - first)
        return points


def triangulate(polygons: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Cut polygons into triangles (T, 3, 2) without new points; also the polygon (T,) of each."""
    shapely = _shapely()
    try:
        cut = shapely.constrained_delaunay_triangles(polygons)
    except shapely.GEOSException:  # corners that are apart by rounding only
        extent = float(np.nanmax(np.abs(shapely.bounds(polygons))))
        cut = shapely.constrained_delaunay_triangles(shapely.remove_repeated_points(polygons, _ONE * extent))
    parts, own = shapely.get_parts(cut, return_index=True)
    return shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3], own


def triangle_areas(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the areas (T,) of (T, 3, 2) triangles."""
    (x1, y1), (x2, y2) = ((triangles[:, i] - triangles[:, 0]).T for i in (1, 2))
    areas: NDArray[np.float64] = 0.5 * np.abs(x1 * y2 - x2 * y1)
    return areas


def _as_geometry(shape: Any) -> Geometry:
    shapely = _shapely()
    if isinstance(shape, Mapping):
        return shapely.union_all(_geojson(shape))
    rings = [shape] if np.ndim(shape[0]) == 1 else list(shape)
    arrays = [np.asarray(ring, np.float64) for ring in rings]
    for ring in arrays:
        is_ring = ring.ndim == 2 and ring.shape[1] == 2 and len(ring) >= 3
        check_shape("a ring", ring.shape, is_ring, "(N, 2) coordinates, N >= 3")
        check_finite("a ring", ring)
    return shapely.Polygon(arrays[0], arrays[1:])


def _geojson(shape: Mapping[str, Any]) -> list[Geometry]:
    """Read all polygons of a GeoJSON object."""
    from shapely.geometry import shape as read

    kind = shape.get("type")
    if kind == "FeatureCollection":
        return [each for feature in shape["features"] for each in _geojson(feature)]
    if kind == "Feature":
        return _geojson(shape["geometry"])
    if kind == "GeometryCollection":
        return [each for geometry in shape["geometries"] for each in _geojson(geometry)]
    allowed = "Polygon, MultiPolygon, Feature or FeatureCollection"
    check_in_range("GeoJSON type", kind, kind in ("Polygon", "MultiPolygon"), allowed)
    return [read(shape)]


def _is_flat(geometry: Geometry) -> bool:
    """Tell whether all points are on one line: a ring that crosses itself may have no area, too."""
    return bool(_shapely().get_dimensions(geometry.convex_hull) < 2)


def _refuse_invalid(reason: str) -> None:
    """Say what is wrong with polygons, from what GEOS says: a reason and a place in brackets."""
    what, _, place = reason.rstrip("]").partition("[")
    at = f"({', '.join(place.split())})"
    if what in ("Hole lies outside shell", "Nested holes", "Holes are nested"):
        check_that(f"a hole at {at}", False, "lie inside of its polygon, and not in another hole")
    if "elf-intersection" in what:
        check_that("polygons", False, f"not cross themselves or each other, as they do at {at}")
    check_that("polygons", False, f"be valid: {what} at {at}")


def _shapely() -> Any:
    try:
        import shapely
    except ImportError as error:
        raise ImportError(f"polygons need {needs('shapely', 'regions')}") from error
    return shapely
