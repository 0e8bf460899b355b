"""Regions that are polygons with holes, by shapely, or pixels and voxels; and what can be taken for a region."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import GIVEN
from cvtimg._shared.checks import check_finite, check_in_range, check_numbers, check_shape, check_that, refuse_type
from cvtimg._shared.extras import shapely
from cvtimg._shared.geojson import shapes_of
from cvtimg._shared.types import Array, Bools, Floats, Indices, Points
from cvtimg.labels.contours import find_contours
from cvtimg.labels.files import one_band
from cvtimg.placement.regions import Geometry, Region

#: Degrees that a boundary turns by at a corner at least: with more, fewer are kept.
SMOOTH = 30.0
#: Part of the extent within which corners are one that rounding has doubled: with more, small polygons vanish.
_ONE = 1e-13
#: Pixels that a point may be from the center of its own along an axis: at one half it would be in the next.
_TO_SIDE = 0.5 - 1e-7


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class PolygonRegion(Region):
    """One or more polygons, with holes or without.

    Parameters
    ----------
    shape : (N, 2) array, sequence of (N, 2) arrays, GeoJSON or shapely geometry
        Coordinates of a ring; of an outer ring and its holes; a GeoJSON mapping, its geometries taken together; or a
        shapely Polygon or MultiPolygon.

    Examples
    --------
    >>> from cvtimg.placement import PolygonRegion
    >>> frame = PolygonRegion([[[0, 0], [4, 0], [4, 4], [0, 4]], [[1, 1], [3, 1], [3, 3], [1, 3]]])
    >>> frame.measure, frame.contains([[2, 2], [0.5, 2]]).tolist(), len(frame.corners)
    (12.0, [False, True], 8)
    """

    geometry: Geometry

    def __init__(self, shape: object) -> None:
        geometry = shape if isinstance(shape, shapely.Geometry) else _as_geometry(shape)
        # A ring that crosses itself may have no area, and not be flat.
        is_flat = geometry.area == 0 and shapely.get_dimensions(geometry.convex_hull) < 2
        has_area = shapely.get_dimensions(geometry) == 2 and not is_flat
        check_that(f"a {geometry.geom_type} of area {geometry.area:g}", has_area, "be a polygon with area > 0")
        if not shapely.is_valid(geometry):
            mended = shapely.make_valid(geometry, method="structure", keep_collapsed=False)
            # Lines that double back and enclose next to nothing come from digitizing; others may mean anything.
            is_near = abs(mended.area - geometry.area) <= GIVEN * geometry.area
            what = f"not cross themselves or each other, and have holes inside: {shapely.is_valid_reason(geometry)}"
            check_that("polygons", is_near, what)
            geometry = mended
        shapely.prepare(geometry)
        object.__setattr__(self, "geometry", geometry)

    def __repr__(self) -> str:
        n = len(shapely.get_parts(self.geometry))
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
        corners = []
        for ring in shapely.get_rings(shapely.get_parts(self.geometry)):
            places = shapely.get_coordinates(ring)[:-1]
            before, after = places - np.roll(places, 1, axis=0), np.roll(places, -1, axis=0) - places
            turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
            corners.append(places[np.abs(turn) > np.radians(SMOOTH)])
        return np.concatenate(corners)

    def outline(self) -> Geometry:
        """Return its geometry."""
        return self.geometry

    def contains(self, points: ArrayLike) -> Bools:
        """Tell which of (N, 2) points lie in it or on its boundary."""
        places = self._checked(points)
        return shapely.intersects_xy(self.geometry, *places.T)

    def to_boundary(self, points: ArrayLike) -> Points:
        """Move points to the nearest point of the boundary."""
        lines = shapely.shortest_line(shapely.boundary(self.geometry), shapely.points(self._checked(points)))
        return shapely.get_coordinates(lines)[::2]

    def boundary_points(self, spacing: float) -> Points:
        """Cover the boundary with points, all corners among them."""
        dense = shapely.segmentize(shapely.boundary(self.geometry), spacing)
        return np.unique(shapely.get_coordinates(dense), axis=0)

    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, 2) points, from triangles by their areas."""
        random = np.random.default_rng(rng)
        triangles = triangulate(np.array([self.geometry]))[0]
        areas = np.cumsum(triangle_areas(triangles))
        # Evenly spaced along the areas, so that each triangle has its share.
        chosen = np.searchsorted(areas, (np.arange(n) + random.random()) / n * areas[-1])
        first, second, third = triangles[np.minimum(chosen, len(areas) - 1)].transpose(1, 0, 2)
        u, v = random.random((2, n, 1))
        over = u + v > 1
        u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
        return first + u * (second - first) + v * (third - first)


def triangulate(polygons: Array) -> tuple[Floats, Indices]:
    """Cut polygons into triangles (T, 3, 2) without new points; also the polygon (T,) of each."""
    try:
        cut = shapely.constrained_delaunay_triangles(polygons)
    except shapely.GEOSException:  # corners that are apart by rounding only
        extent = float(np.nanmax(np.abs(shapely.bounds(polygons))))
        cut = shapely.constrained_delaunay_triangles(shapely.remove_repeated_points(polygons, _ONE * extent))
    parts, part = shapely.get_parts(cut, return_index=True)
    return shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3], part


def triangle_areas(triangles: Floats) -> Floats:
    """Compute the areas (T,) of (T, 3, 2) triangles."""
    (x1, y1), (x2, y2) = ((triangles[:, i] - triangles[:, 0]).T for i in (1, 2))
    return 0.5 * np.abs(x1 * y2 - x2 * y1)


def _as_geometry(shape: Any) -> Geometry:
    if isinstance(shape, Mapping):
        parts = shapes_of(shape)
        check_finite("GeoJSON coordinates", shapely.get_coordinates(parts))
        kinds = [part.geom_type for part in parts]
        check_in_range("GeoJSON types", sorted({*kinds}), {*kinds} == {"Polygon"}, "Polygon or MultiPolygon")
        return shapely.union_all(parts)
    rings = [shape] if np.ndim(shape[0]) == 1 else list(shape)
    arrays = [np.asarray(ring, np.float64) for ring in rings]
    for ring in arrays:
        is_ring = ring.ndim == 2 and ring.shape[1] == 2 and len(ring) >= 3
        check_shape("a ring", ring.shape, is_ring, "(N, 2) coordinates, N >= 3")
        check_finite("a ring", ring)
    return shapely.Polygon(arrays[0], arrays[1:])


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class PictureRegion(Region):
    """The pixels of a mask, or the voxels of one in three dimensions.

    Parameters
    ----------
    mask : (H, W) or (L, H, W) bool array
        True inside. Points are (x, y) or (x, y, z), in pixels; the first pixel covers [0, 1] along each axis.

    Examples
    --------
    >>> from cvtimg.placement import PictureRegion
    >>> region = PictureRegion([[True, True, False]])
    >>> region.measure, region.project([[2.7, 0.5]]).round(6).tolist()
    (2.0, [[2.0, 0.5]])
    """

    mask: Bools

    def __init__(self, mask: ArrayLike) -> None:
        array = np.asarray(mask)
        if array.dtype != np.bool_:
            refuse_type("mask", array.dtype, "bool")
        check_shape("mask", array.shape, array.ndim in (2, 3) and array.size > 0, "(H, W) or (L, H, W)")
        check_that("mask", array.any(), "be True somewhere: the region is empty")
        object.__setattr__(self, "mask", array)

    def __repr__(self) -> str:
        kind = "pixels" if self.mask.ndim == 2 else "voxels"
        return f"<PictureRegion of {int(self.measure)} {kind} in {' x '.join(map(str, self.mask.shape))}>"

    @property
    def bounds(self) -> Points:
        """The least and the greatest coordinates of the image, (2, D)."""
        size = np.array(self.mask.shape[::-1], np.float64)
        return np.stack([np.zeros_like(size), size])

    @property
    def measure(self) -> float:
        """How many pixels."""
        return float(np.count_nonzero(self.mask))

    @property
    def corners(self) -> Points:
        """The corners of the image that it holds: those along pixels are none."""
        ends = np.array(list(np.ndindex(*(2,) * self.n_dims)))
        inside = self.mask[tuple(ends[:, ::-1].T * (np.array(self.mask.shape)[:, None] - 1))]
        return self.bounds[ends, np.arange(self.n_dims)][inside]

    def outline(self) -> Geometry:
        """Return polygons along the sides of pixels."""
        check_shape("mask", self.mask.shape, self.mask.ndim == 2, "(H, W) to have polygons")
        if self.mask.all():
            return shapely.box(*self.bounds.ravel())
        contours = find_contours(self.mask.astype(np.int32)).polygons
        return shapely.union_all([shapely.Polygon(each.rings[0], each.rings[1:]) for each in contours])

    def contains(self, points: ArrayLike) -> Bools:
        """Tell which of (N, D) points lie in a pixel of the mask."""
        places = self._checked(points)
        size = np.array(self.mask.shape[::-1])
        at = np.clip(places.astype(np.intp), 0, size - 1)
        inside = ((places >= 0) & (places <= size)).all(axis=1)
        return inside & self.mask[tuple(at[:, ::-1].T)]

    def project(self, points: ArrayLike) -> Points:
        """Move points outside to the nearest point of a pixel of the mask."""
        places = self._checked(points).copy()
        outside = ~self.contains(places)
        if outside.any():
            places[outside] = NearestPixel.of(self.mask)(places[outside])
        return places

    def to_boundary(self, points: ArrayLike) -> Points:
        """Move points to the nearest side between a pixel of the mask and another."""
        sides, axes = self._sides()
        # A side has no extent along its own axis.
        half = np.where(np.arange(self.n_dims) == axes[:, None], 0, 0.5)
        return NearestPixel(sides, half)(self._checked(points))

    def boundary_points(self, spacing: float) -> Points:
        """Return the middles of the sides between pixels of the mask and others, thinned to `spacing`."""
        sides = self._sides()[0]
        if spacing <= 1:
            return sides
        blocks = np.floor(sides / spacing)
        return sides[np.unique(blocks, axis=0, return_index=True)[1]]

    def draw(self, n: int, rng: int | np.random.Generator = 0) -> Points:
        """Draw (n, D) points, equally many in each pixel, to within one."""
        random = np.random.default_rng(rng)
        inside = np.flatnonzero(self.mask)
        chosen = inside[((np.arange(n) + random.random()) / n * len(inside)).astype(np.intp)]
        corners = np.stack(np.unravel_index(chosen, self.mask.shape)[::-1], axis=1)
        return corners + random.random((n, self.n_dims))

    def _sides(self) -> tuple[Points, Indices]:
        """Middles (S, D) of the sides between inside and outside, and the axis (S,) that each stands across."""
        middles, axes = [], []
        padded = np.pad(self.mask, 1)
        for axis in range(self.mask.ndim):
            places = np.argwhere(np.diff(padded, axis=axis)) - 0.5
            places[:, axis] += 0.5
            middles.append(places[:, ::-1])
            axes.append(np.full(len(places), self.mask.ndim - 1 - axis))
        return np.concatenate(middles), np.concatenate(axes)


class NearestPixel:
    """Finds the nearest point of pixels, or of their sides, for points outside of them, any number of times.

    They have centers (M, D) and reach so far from them along each axis: half, (M, D).
    """

    def __init__(self, centers: Points, half: Points) -> None:
        from scipy.spatial import cKDTree

        self._centers, self._half = centers, half
        self._tree = cKDTree(centers, compact_nodes=False, balanced_tree=False)  # few points are looked for

    @classmethod
    def of(cls, mask: Bools) -> NearestPixel:
        """Make it of the pixels of a mask: of those with a neighbor outside."""
        from scipy.ndimage import binary_erosion

        centers = np.argwhere(mask & ~binary_erosion(mask))[:, ::-1] + np.float64(0.5)
        return cls(centers, np.full(centers.shape, _TO_SIDE))

    def __call__(self, points: Points) -> Points:
        """Move (N, D) points."""
        n = min(8, len(self._centers))
        near = self._tree.query(points, n)[1].reshape(len(points), n)
        centers, half = self._centers[near], self._half[near]
        ends = np.clip(points[:, None], centers - half, centers + half)
        best = ((ends - points[:, None]) ** 2).sum(axis=2).argmin(axis=1)
        return ends[np.arange(len(points)), best]


def _as_mask(image: Array) -> Bools:
    """Return where an image of 0 and one more value, perhaps in equal bands, is not 0."""
    if image.dtype == np.bool_:
        return image
    check_numbers("region", image.dtype)
    has_bands = image.ndim == 3 and image.shape[2] in (3, 4)
    plain = one_band(image) if has_bands and (image[..., :3] == image[..., :1]).all() else image
    values = np.unique(plain)
    is_mask = (len(values) == 2 and values[0] == 0) or (len(values) == 1 and values[0] > 0)
    allowed = "0 and one more value to be a mask; give labels to mesh_labels, and a mask as region > limit"
    check_that(f"region of shape {image.shape} and values from {values[0]} to {values[-1]}", is_mask, f"have {allowed}")
    return np.asarray(plain != 0)


def as_region(region: object) -> Region:
    """Make a region of what stands for one.

    Parameters
    ----------
    region : Region, mask, coordinates, GeoJSON or shapely geometry
        A Region as it is; a mask: a bool array (H, W) or (L, H, W), or an image of 0 and one more value, perhaps in
        three or four equal bands; (N, 2) coordinates of a polygon,
        or a sequence of such rings, the outer one first; a GeoJSON mapping; a shapely Polygon or MultiPolygon.

    Returns
    -------
    Region

    Examples
    --------
    >>> from cvtimg.placement import as_region
    >>> as_region(np.ones((2, 3), bool))
    <PictureRegion of 6 pixels in 2 x 3>
    >>> as_region([[0, 0], [2, 0], [0, 2]])
    <PolygonRegion of 1 polygon, area 2>
    """
    if isinstance(region, Region):
        return region
    if isinstance(region, Mapping) or hasattr(region, "geom_type"):
        return PolygonRegion(region)
    if isinstance(region, np.ndarray) and (region.dtype == np.bool_ or (region.ndim > 1 and region.shape[-1] > 2)):
        return PictureRegion(_as_mask(region))
    if not isinstance(region, (list, tuple, np.ndarray)) or not len(region):
        allowed = "a Region, a bool array, polygon coordinates, GeoJSON or a shapely geometry"
        refuse_type("region", type(region).__name__, allowed)
    return PolygonRegion(region)
