"""Voronoi cells as polygons, their exact moments, and how regular they are."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from cvtimg._shared.budgets import ENOUGH_SAMPLES
from cvtimg._shared.checks import check_in_range, refuse_type
from cvtimg._shared.extras import shapely
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg._shared.types import Array, Floats, Indices, Points
from cvtimg.placement.densities import ConstantDensity, Density
from cvtimg.placement.moments import CellSums, Moments, SampleMoments
from cvtimg.placement.polygons import triangle_areas, triangulate
from cvtimg.placement.regions import Box, Region

#: (K,) shapely polygons; and corners of K convex polygons.
Geometries: TypeAlias = Array
Polygons: TypeAlias = tuple[Points, ...]

#: Points of a triangle and their weights, exact up to the fifth degree.
#: J. Radon, Zur mechanischen Kubatur, Monatshefte fuer Mathematik 52 (1948), doi 10.1007/BF01525334.
_ROOT = 15**0.5
_NEAR, _FAR = (6 - _ROOT) / 21, (6 + _ROOT) / 21
_POINTS = np.array(
    [[1 / 3] * 3] + [np.roll([1 - 2 * at, at, at], turn).tolist() for at in (_NEAR, _FAR) for turn in range(3)]
)
_WEIGHTS = np.array([9 / 40] + [(155 - _ROOT) / 1200] * 3 + [(155 + _ROOT) / 1200] * 3)
#: Mean areas of cells up to which triangles are not divided before a density is integrated: with more, it may vary.
_COARSEST = 0.5
#: Samples for each cell where cells are no polygons: with four times as many, h is half as far below its value.
_SAMPLES = 4000


def voronoi_cells(points: Points, region: Region) -> Geometries:
    """Cut a region of the plane into the Voronoi cells of (K, 2) points: K shapely polygons.

    In a periodic box a cell is around its generator and may reach over the side. Of several generators at one place
    the first has the cell, and the others an empty one.
    """
    check_in_range("region", region, region.n_dims == 2, "in the plane: cells are polygons there")
    if not region.is_polygonal:
        refuse_type("region", type(region).__name__, "a box, polygons or an image, in which cells are polygons")
    sites, first = np.unique(points, axis=0, return_index=True)
    outline = region.outline()
    if isinstance(region, Box) and any(region.periodic):
        turns = [(0, -1, 1) if around else (0,) for around in region.periodic]
        sites = np.concatenate([sites + np.array([x, y]) * region.sides for x in turns[0] for y in turns[1]])
        # Over the periodic sides, as far as a cell may reach.
        over = np.where(region.periodic, region.sides, 0.0)
        outline = shapely.box(*(region.bounds[0] - over), *(region.bounds[1] + over))
    if len(sites) == 1:
        cells = np.array([outline])
    else:
        around = shapely.envelope(outline)
        diagram = shapely.voronoi_polygons(shapely.multipoints(sites), extend_to=around, ordered=True)
        cells = shapely.get_parts(diagram)[: len(first)]
        shapely.prepare(outline)
        cut = ~shapely.contains_properly(outline, cells)
        # Where many cells meet in a point, rounding may let the rings of some cross themselves.
        cells[cut] = shapely.intersection(shapely.make_valid(cells[cut]), outline)
    all_cells = np.full(len(points), shapely.Polygon(), dtype=object)
    all_cells[first] = cells
    return all_cells


@dataclass(frozen=True, slots=True)
class PolygonMoments:
    """Moments of Voronoi cells in a region of the plane: exact for a constant density, else by quadrature.

    Parameters
    ----------
    region : Box, PolygonRegion or PictureRegion
    density : callable
        From (N, 2) points to (N,) densities. On each triangle of each cell it is integrated exactly if it is a
        polynomial of the third degree.
    """

    region: Region
    density: Density

    def __call__(self, generators: Points, /) -> Moments:
        """Compute the moments of the cells of (K, 2) generators."""
        cells = voronoi_cells(generators, self.region)
        if isinstance(self.density, ConstantDensity):
            return polygon_sums(cells, generators).moments(generators, self.density.value)
        triangles, cell = _divided(*triangulate(cells), _COARSEST * self.region.measure / len(cells))
        places = np.einsum("qi,tid->tqd", _POINTS, triangles)
        at = places.reshape(-1, 2)
        if isinstance(self.region, Box):
            at = self.region.project(at)
        weights = self.density(at).reshape(len(triangles), -1) * _WEIGHTS * triangle_areas(triangles)[:, None]
        steps = places - generators[cell][:, None]
        masses = sum_by_label(cell, weights.sum(axis=1), len(cells))
        firsts = sum_by_label(cell, np.einsum("tq,tqd->td", weights, steps), len(cells))
        energy = float((weights * (steps**2).sum(axis=2)).sum())
        return Moments(masses, generators + per_mass(firsts, masses), energy)


def _divided(triangles: Points, cell: Indices, largest: float) -> tuple[Points, Indices]:
    """Divide triangles (T, 3, 2) into four until none has a larger area; also the cells (T,) of those."""
    done, cells = [], []
    while len(triangles):
        large = triangle_areas(triangles) > largest
        done.append(triangles[~large])
        cells.append(cell[~large])
        corners = triangles[large]
        middles = (corners + np.roll(corners, -1, axis=1)) / 2
        parts = [np.stack([corners[:, i], middles[:, i], middles[:, i - 1]], axis=1) for i in range(3)]
        triangles, cell = np.concatenate([*parts, middles]), np.tile(cell[large], 4)
    return np.concatenate(done), np.concatenate(cells)


def polygon_sums(cells: Geometries, points: Points) -> CellSums:
    """Integrate over polygons about (K, 2) points, exactly: over triangles of a point and a side, with signs."""
    pieces, cell_of = oriented_pieces(cells)
    rings, piece = shapely.get_rings(pieces, return_index=True)
    places, ring = shapely.get_coordinates(rings, return_index=True)
    cell = cell_of[piece[ring]]
    steps = places - points[cell]
    reaches = np.zeros(len(points))
    np.maximum.at(reaches, cell, np.linalg.norm(steps, axis=1))
    inside = ring[1:] == ring[:-1]
    start, other = steps[:-1][inside], steps[1:][inside]
    cross, total = start[:, 0] * other[:, 1] - other[:, 0] * start[:, 1], start + other
    products = sum(np.einsum("sd,se->sde", corner, corner) for corner in (start, other, total)).reshape(-1, 4)
    parts = cross[:, None] * np.concatenate([np.full((len(cross), 1), 1 / 2), total / 6, products / 24], axis=1)
    sums = sum_by_label(cell[:-1][inside], parts, len(cells))
    return CellSums(sums[:, 0], sums[:, 1:3], sums[:, 3:].reshape(-1, 2, 2), reaches)


def oriented_pieces(cells: Geometries) -> tuple[Geometries, Indices]:
    """Polygons that cells consist of, outer rings counterclockwise and holes clockwise, and the cell of each."""
    pieces, cell = shapely.get_parts(cells, return_index=True)
    flat = shapely.get_dimensions(pieces) == 2  # a cell may touch its region in a line
    return shapely.orient_polygons(pieces[flat]), cell[flat]


@dataclass(frozen=True, slots=True)
class CellMeasures:
    """Measures of the Voronoi cells of points, clipped to their region. Smaller is more regular.

    They are exact where cells are polygons, in boxes, polygons and images of the plane. In other regions and numbers of
    dimensions they are estimates by some thousand samples of each cell: h is then a little too small.

    Write h_i for the greatest distance from generator i to a point of its cell, and gamma_i for that to the nearest
    other generator.

    Attributes
    ----------
    h : float
        The largest h_i: no place of the region is farther from all generators.
    chi : float
        The largest 2 h_i / gamma_i; 2 / 3^(1/2) = 1.155 for regular hexagons.
    h_ratio : float
        The largest h_i by the smallest; 1 for equal cells.
    gap_ratio : float
        The largest gamma_i by the smallest; 1 for equal gaps.
    gap_variation : float
        Standard deviation of gamma_i by their mean; 0 for equal gaps.
    area_ratio : float
        The largest area (in D dimensions, volume) of a cell by the smallest; 1 for equal cells.
    tau : float
        The largest deviation of the trace of the second moments of a cell about its generator, by its area, from the
        mean of all; 0 for equal cells.
    d : float
        The largest determinant of the deviatoric part of these second moments; 0 for round cells.

    References
    ----------
    V. Romero, J. Burkardt, M. Gunzburger, J. Peterson, Comparison of pure and Latinized centroidal Voronoi
    tessellation against various other statistical sampling methods, Reliability Engineering and System Safety 91
    (2006) 1266-1280, doi 10.1016/j.ress.2005.11.023.
    """

    h: float
    chi: float
    h_ratio: float
    gap_ratio: float
    gap_variation: float
    area_ratio: float
    tau: float
    d: float


def measure_cells(points: Points, region: Region) -> CellMeasures:
    """Measure the Voronoi cells of (K, D) points in a region: as polygons where they are, else by samples."""
    if region.is_polygonal:
        sums = polygon_sums(voronoi_cells(points, region), points)
    else:
        n = int(np.clip(_SAMPLES * len(points), ENOUGH_SAMPLES, 16 * ENOUGH_SAMPLES))
        samples = region.sample(n)
        sums = SampleMoments(samples, 2, region).cells(points)
    gaps = region.nearest(points, points, 2)[0][:, 1]  # infinite for a single point
    return CellMeasures(
        **regularity(sums, gaps),
        h_ratio=_ratio(sums.reaches),
        gap_ratio=_ratio(gaps) if len(gaps) > 1 else 1.0,
        gap_variation=float(gaps.std() / gaps.mean()) if len(gaps) > 1 else 0.0,
        area_ratio=_ratio(sums.volumes),
    )


def regularity(cells: CellSums, gaps: Floats) -> dict[str, float]:
    """Compute h, chi, tau and d of `CellMeasures` from cells and distances gamma_i to the nearest other points."""
    n_dims = cells.firsts.shape[1]
    second = per_mass(cells.seconds.reshape(-1, n_dims**2), cells.volumes).reshape(cells.seconds.shape)
    traces = np.trace(second, axis1=1, axis2=2)
    deviatoric = second - traces[:, None, None] / n_dims * np.eye(n_dims)
    return {
        "h": float(cells.reaches.max()),
        "chi": float((2 * cells.reaches / gaps).max()) if gaps.min() > 0 else np.inf,
        "tau": float(np.abs(traces - traces.mean()).max()),
        "d": float(np.abs(np.linalg.det(deviatoric)).max()),
    }


def _ratio(values: Floats) -> float:
    return float(values.max() / values.min()) if values.min() > 0 else np.inf


def picture_cells(points: Points, shape: tuple[int, int]) -> Polygons:
    """Compute the Voronoi cells of (N, 2) points, cut off at the sides of a picture of a shape (H, W).

    The (M, 2) corners of each cell are in order, clockwise as seen on a screen, with y down. A point without a cell, as
    one of two in the same place, has an empty polygon.
    """
    cells = shapely.orient_polygons(voronoi_cells(points, Box([0, 0], shape[::-1])))
    return tuple(shapely.get_coordinates(cell)[:-1] for cell in cells)
