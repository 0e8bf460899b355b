"""Voronoi cells as polygons, and their exact moments."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_in_range, refuse_type
from cvtimg._shared.extras import optional
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg.placement.moments import Moments
from cvtimg.regions import Box, ConstantDensity, Density, PictureRegion, PolygonRegion, Region
from cvtimg.regions.polygons import triangle_areas, triangulate

Points = NDArray[np.float64]
#: (K,) shapely polygons.
Polygons: TypeAlias = NDArray[Any]

#: Points of a triangle and their weights, exact up to the fifth degree.
#: J. Radon, Zur mechanischen Kubatur, Monatshefte fuer Mathematik 52 (1948), doi 10.1007/BF01525334.
_ROOT = 15**0.5
_NEAR, _FAR = (6 - _ROOT) / 21, (6 + _ROOT) / 21
_POINTS = np.array(
    [[1 / 3] * 3] + [np.roll([1 - 2 * at, at, at], turn).tolist() for at in (_NEAR, _FAR) for turn in range(3)]
)
_WEIGHTS = np.array([9 / 40] + [(155 - _ROOT) / 1200] * 3 + [(155 + _ROOT) / 1200] * 3)


def voronoi_cells(points: Points, region: Region) -> Polygons:
    """Cut a region of the plane into the Voronoi cells of (K, 2) points: K shapely polygons.

    In a periodic box a cell is around its generator and may reach over the side. Of several generators at one place
    the first has the cell, and the others an empty one.
    """
    shapely = optional("shapely", "regions")

    check_in_range("region", region, region.n_dims == 2, "in the plane: cells are polygons there")
    periodic = isinstance(region, Box) and any(region.periodic)
    sites, own, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    inverse = inverse.reshape(-1)
    if periodic:
        assert isinstance(region, Box)
        sites = _with_copies(sites, region)
    outline = _outline(region, grown=periodic)
    if len(sites) == 1:
        cells = np.array([outline])
    else:
        found = shapely.voronoi_polygons(shapely.multipoints(sites), extend_to=shapely.envelope(outline), ordered=True)
        cells = shapely.get_parts(found)[: len(own)]
        shapely.prepare(outline)
        cut = ~shapely.contains_properly(outline, cells)
        # Where many cells meet in a point, rounding may let the rings of some cross themselves.
        cells[cut] = shapely.intersection(shapely.make_valid(cells[cut]), outline)
    all_cells = np.full(len(points), shapely.Polygon(), dtype=object)
    all_cells[own] = cells
    return all_cells


def _with_copies(sites: Points, box: Box) -> Points:
    """Append copies of points on the other sides of a periodic box."""
    turns = [(0, -1, 1) if around else (0,) for around in box.periodic]
    return np.concatenate([sites + np.array([x, y]) * box.sides for x in turns[0] for y in turns[1]])


def _outline(region: Region, grown: bool = False) -> Any:
    shapely = optional("shapely", "regions")

    if isinstance(region, PolygonRegion):
        return region.geometry
    if isinstance(region, PictureRegion):
        return shapely.box(*region.bounds.ravel()) if region.mask.all() else region.polygons().geometry
    if not isinstance(region, Box):
        refuse_type("region", type(region).__name__, "a box, polygons or an image, in which cells are polygons")
    # Over the periodic sides, as far as a cell may reach.
    over = np.where(region.periodic, region.sides, 0.0) if grown else np.zeros(2)
    return shapely.box(*(region.bounds[0] - over), *(region.bounds[1] + over))


class PolygonMoments:
    """Moments of Voronoi cells in a region of the plane: exact for a constant density, else by quadrature.

    Parameters
    ----------
    region : Box, PolygonRegion or PictureRegion
    density : callable
        From (N, 2) points to (N,) densities. On each triangle of each cell it is integrated exactly if it is a
        polynomial of the third degree.
    """

    __slots__ = ("_density", "_region")

    def __init__(self, region: Region, density: Density) -> None:
        self._region = region
        self._density = density

    def __call__(self, generators: Points, /) -> Moments:
        """Compute the moments of the cells of (K, 2) generators."""
        cells = voronoi_cells(generators, self._region)
        exact = isinstance(self._density, ConstantDensity)
        sums = _exact_sums(cells, generators) if exact else self._sums(cells, generators)
        if isinstance(self._density, ConstantDensity):
            sums *= self._density.value
        masses = sums[:, 0].copy()
        return Moments(masses, generators + per_mass(sums[:, 1:3], masses), float(sums[:, 3].sum()))

    def _sums(self, cells: Polygons, generators: Points) -> NDArray[np.float64]:
        triangles, own = triangulate(cells)
        places = np.einsum("qi,tid->tqd", _POINTS, triangles)
        at = places.reshape(-1, 2)
        if isinstance(self._region, Box):
            at = self._region.project(at)
        weights = self._density(at).reshape(len(triangles), -1) * _WEIGHTS * triangle_areas(triangles)[:, None]
        steps = places - generators[own][:, None]
        parts = [weights, weights * steps[..., 0], weights * steps[..., 1], weights * (steps**2).sum(axis=2)]
        return sum_by_label(own, np.stack([part.sum(axis=1) for part in parts], axis=1), len(cells))


def _exact_sums(cells: Polygons, generators: Points) -> NDArray[np.float64]:
    """Area, first moments and polar second moment of polygons about their generators, by Green's theorem."""
    shapely = optional("shapely", "regions")

    rings, own = _oriented_rings(cells)
    places, ring = shapely.get_coordinates(rings, return_index=True)
    places = places - generators[own[ring]]
    inside = ring[1:] == ring[:-1]
    (x1, y1), (x2, y2) = places[:-1][inside].T, places[1:][inside].T
    cross = x1 * y2 - x2 * y1
    squares = x1 * x1 + x1 * x2 + x2 * x2 + y1 * y1 + y1 * y2 + y2 * y2
    parts = (cross / 2, cross * (x1 + x2) / 6, cross * (y1 + y2) / 6, cross * squares / 12)
    cell = own[ring[:-1][inside]]
    return sum_by_label(cell, np.stack(parts, axis=1), len(cells))


def _oriented_rings(cells: Polygons) -> tuple[Polygons, NDArray[np.intp]]:
    """Rings of polygons, outer ones counter-clockwise and holes clockwise, and the polygon of each."""
    shapely = optional("shapely", "regions")

    pieces, own = shapely.get_parts(cells, return_index=True)
    flat = shapely.get_dimensions(pieces) == 2  # a cell may touch its region in a line
    rings, piece = shapely.get_rings(shapely.orient_polygons(pieces[flat]), return_index=True)
    return rings, own[flat][piece]


def cell_rings(cells: Polygons) -> tuple[list[Points], NDArray[np.intp]]:
    """Coordinates of the rings of polygons, as of `_oriented_rings`, and the polygon of each."""
    shapely = optional("shapely", "regions")

    rings, own = _oriented_rings(cells)
    return [shapely.get_coordinates(ring) for ring in rings], own
