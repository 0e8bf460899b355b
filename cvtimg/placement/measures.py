"""How regular cells are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg.placement.cells import cell_rings, voronoi_cells
from cvtimg.placement.samples import SampleMoments
from cvtimg.regions import Box, LpGauge, PictureRegion, PolygonRegion, Region
from cvtimg.regions.polygons import triangle_areas, triangulate

Points = NDArray[np.float64]

#: Samples for each cell, and the fewest and the most of all, where cells are no polygons.
_SAMPLES, _SAMPLE_RANGE = 4000, (1 << 17, 1 << 21)


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
    flat = region.n_dims == 2 and isinstance(region, Box | PolygonRegion | PictureRegion)
    heights, areas, second = (_polygon_cells if flat else _sampled_cells)(points, region)
    gaps = _gaps(points, region)
    traces = np.trace(second, axis1=1, axis2=2)
    deviatoric = second - traces[:, None, None] / region.n_dims * np.eye(region.n_dims)
    return CellMeasures(
        h=float(heights.max()),
        chi=float((2 * heights / gaps).max()) if gaps.min() > 0 else np.inf,
        h_ratio=_ratio(heights),
        gap_ratio=_ratio(gaps) if len(gaps) > 1 else 1.0,
        gap_variation=float(gaps.std() / gaps.mean()) if len(gaps) > 1 else 0.0,
        area_ratio=_ratio(areas),
        tau=float(np.abs(traces - traces.mean()).max()),
        d=float(np.abs(np.linalg.det(deviatoric)).max()),
    )


def _ratio(values: NDArray[np.float64]) -> float:
    return float(values.max() / values.min()) if values.min() > 0 else np.inf


def _gaps(points: Points, region: Region) -> NDArray[np.float64]:
    """Distance of each point to the nearest other one, around a periodic box too."""
    from scipy.spatial import cKDTree

    if len(points) == 1:
        return np.full(1, np.inf)
    sites = points
    if isinstance(region, Box):
        for axis in np.flatnonzero(region.periodic):
            turn = np.eye(region.n_dims)[axis] * region.sides
            sites = np.concatenate([sites, sites - turn, sites + turn])
    gaps: NDArray[np.float64] = cKDTree(sites).query(points, 2)[0][:, 1]
    return gaps


def _polygon_cells(
    points: Points, region: Region
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Heights, areas and second moments by area of cells that are polygons."""
    cells = voronoi_cells(points, region)
    rings, own = cell_rings(cells)
    heights = np.zeros(len(points))
    for ring, cell in zip(rings, own, strict=True):
        farthest = np.linalg.norm(ring - points[cell], axis=1).max()
        heights[cell] = max(heights[cell], farthest)
    return heights, *_second_moments(*triangulate(cells), points)


def _sampled_cells(
    points: Points, region: Region
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Heights, volumes and second moments by volume of cells, estimated by samples of the region."""
    n_points, n_dims = points.shape
    samples = region.sample(int(np.clip(_SAMPLES * n_points, *_SAMPLE_RANGE)))
    moments = SampleMoments(samples, LpGauge(2), region)
    labels = moments.labels(points)
    steps = moments.wrapped(samples.rows - points[labels])
    heights = np.zeros(n_points)
    np.maximum.at(heights, labels, np.linalg.norm(steps, axis=1))
    volumes = sum_by_label(labels, samples.density, n_points)
    products = np.einsum("m,md,me->mde", samples.density, steps, steps).reshape(-1, n_dims**2)
    second = per_mass(sum_by_label(labels, products, n_points), volumes)
    return heights, volumes, second.reshape(-1, n_dims, n_dims)


def _second_moments(
    triangles: NDArray[np.float64], own: NDArray[np.intp], points: Points
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Areas (K,), and second moments (K, 2, 2) by area about the points."""
    steps = triangles - points[own][:, None]
    areas = triangle_areas(triangles)
    total = steps.sum(axis=1)
    # Over a triangle: the outer products of its corners and of their sum, by 12.
    products = np.einsum("tid,tie->tde", steps, steps) + total[:, :, None] * total[:, None, :]
    cells = sum_by_label(own, areas, len(points))
    sums = sum_by_label(own, areas[:, None] * products.reshape(-1, 4) / 12, len(points))
    return cells, (sums / cells[:, None]).reshape(-1, 2, 2)
