"""Parts of the sphere, such as caps, boxes and the land of the earth; and of grids: the sea, and limited areas."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import (
    check_at_least,
    check_in_range,
    check_picture_density,
    check_returned,
    check_shape,
    check_that,
)
from cvtimg._shared.choices import Options
from cvtimg._shared.records import Claims
from cvtimg._shared.types import Bools, Floats, Ints, Points
from cvtimg.halfedges import connected_parts
from cvtimg.sphere.densities import GlobePicture, angles_from, check_center, check_globe, from_degrees, to_radians
from cvtimg.sphere.formats import CulledContent, GridContent
from cvtimg.sphere.result import SavedGrid, SphereGrid
from cvtimg.sphere.triangulation import unit

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


@dataclass(frozen=True, slots=True, eq=False)
class PartialGrid(SavedGrid):
    """Some cells of a grid of the sphere, in the order that they had.

    Files have edges and vertices of kept cells; beyond the boundary there is no cell: 0 in meshes of MPAS, which have
    boundaryCell, boundaryEdge and boundaryVertex (1 at the boundary) and, with layers, bdyMaskCell, bdyMaskEdge and
    bdyMaskVertex. Their parent_id begins with the file_id of the whole grid.

    Attributes
    ----------
    whole : SphereGrid
        The grid that it is a part of.
    kept : (N,) bool array
        Which of its cells.
    layers : (K,) int32 array
        Of the kept cells: 0 inside; 1, 2, ... outward in the layers along the boundary of a limited area.
    """

    whole: SphereGrid
    kept: Bools
    layers: Ints

    def _claims(self) -> Claims:
        yield "each cell that is kept has a layer", len(self.layers) == np.count_nonzero(self.kept)

    @property
    def points(self) -> Points:
        """Unit vectors (K, 3) of the kept cells."""
        return self.whole.points[self.kept]

    @property
    def areas(self) -> Floats:
        """Areas (K,) of the kept cells on the unit sphere."""
        return self.whole.areas[self.kept]

    def _content(self, radius: float = 1.0, attributes: Mapping[str, str] | None = None) -> CulledContent:
        grid = self.whole
        whole = GridContent(grid.points, grid.triangles, grid.density, radius, attributes=attributes or {})
        return CulledContent.of(whole, self.kept, {"boundary_layer": self.layers} if self.layers.any() else {})

    def __repr__(self) -> str:
        return f"PartialGrid({int(self.kept.sum())} of {len(self.kept)} cells)"


def cull_land(
    grid: SphereGrid, land: PartLike, *, straits: Sequence[ArrayLike] = (), largest: bool = True, fill_bays: bool = True
) -> PartialGrid:
    """Remove the cells whose points are on land.

    Parameters
    ----------
    grid : SphereGrid
    land : callable, GeoJSON, shapely geometry or (H, 2 H) array
        A function from (N, 3) unit vectors to booleans; polygons in degrees; or a mask of the globe, as
        `cvtimg.sphere.coastal_grid` takes it.
    straits : sequence of (M, 2) arrays
        Points and lines of longitudes and latitudes in degrees, whose cells stay sea.
    largest : bool
        Keep the largest connected sea only.
    fill_bays : bool
        Remove cells that open to one other cell of the sea or none, and those that are such then.

    Returns
    -------
    PartialGrid

    Examples
    --------
    >>> from cvtimg import sphere_grid
    >>> from cvtimg.sphere import cull_land
    >>> cull_land(sphere_grid(642), lambda points: points[:, 2] > 0.33)
    PartialGrid(427 of 642 cells)
    """
    sea = ~inside_of("land", land, grid.points)
    held = _along(grid, straits)
    sea |= held
    starts, ends = grid.triangles.ravel(), np.roll(grid.triangles, -1, axis=1).ravel()
    n = len(sea)
    while fill_bays:
        bays = sea & ~held & (np.bincount(starts, sea[ends], n) <= 1)
        if not bays.any():
            break
        sea &= ~bays
    if largest and sea.any():
        both = sea[starts] & sea[ends]
        _, parts = connected_parts((starts[both], ends[both]), n)
        sea &= parts == np.bincount(parts, grid.areas * sea).argmax()
    check_that("land", bool(sea.any()), "leave a cell of the sea")
    return PartialGrid(grid, sea, np.zeros(int(sea.sum()), np.int32))


def limit_area(grid: SphereGrid | PartialGrid, within: PartLike, *, layers: int = 7) -> PartialGrid:
    """Keep the cells whose points are in a part of the globe, and layers of cells around them.

    Parameters
    ----------
    grid : SphereGrid or PartialGrid
        Of a partial one, such as the sea, cells that it lacks stay away.
    within : callable, GeoJSON, shapely geometry or (H, 2 H) array
        The part: a `Cap`, a `Box`, or what `cull_land` takes as land.
    layers : int
        Number of layers, >= 0. MPAS-Atmosphere has 7: in the first five values relax to those given at the boundary,
        which the last two are set to.

    Returns
    -------
    PartialGrid

    Examples
    --------
    >>> from cvtimg import sphere_grid
    >>> from cvtimg.sphere import Cap, limit_area
    >>> area = limit_area(sphere_grid(2562), Cap(10, 50, 20))
    >>> np.unique(area.layers).tolist()
    [0, 1, 2, 3, 4, 5, 6, 7]
    """
    layers = check_at_least("layers", layers, 0, "the number of layers of cells around")
    whole, there = (grid.whole, grid.kept) if isinstance(grid, PartialGrid) else (grid, np.ones(len(grid.points), bool))
    kept = there & inside_of("within", within, whole.points)
    check_that("within", bool(kept.any()), "hold a point of the grid")
    numbers = np.where(kept, 0, -1)
    for layer in range(1, layers + 1):
        near = np.unique(whole.triangles[(numbers[whole.triangles] >= 0).any(axis=1)])
        numbers[near[(numbers[near] < 0) & there[near]]] = layer
    kept = numbers >= 0
    return PartialGrid(whole, kept, numbers[kept].astype(np.int32))


def _along(grid: SphereGrid, lines: Sequence[ArrayLike]) -> Bools:
    """Tell which cells points and lines go through."""
    from scipy.spatial import cKDTree

    held = np.zeros(len(grid.points), bool)
    # With longer steps, cells that lines cut at a corner are missed.
    tree, step = cKDTree(grid.points), 0.2 * float(np.sqrt(grid.areas.min()))
    for line in lines:
        table = np.atleast_2d(np.asarray(line, np.float64))
        check_shape("straits", table.shape, table.ndim == 2 and table.shape[1] == 2, "(M, 2), longitudes and latitudes")
        check_that("straits", bool((np.isfinite(table).all()) and (np.abs(table[:, 1]) <= 90).all()), "be in degrees")
        corners = from_degrees(*table.T)
        for start, end in pairwise(np.concatenate([corners[:1], corners])):
            parts = np.linspace(0, 1, int(np.linalg.norm(end - start) / step) + 2)[:, None]
            held[tree.query(unit(start + parts * (end - start)))[1]] = True
    return held
