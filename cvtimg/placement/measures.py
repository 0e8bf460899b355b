"""How regular cells are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.placement.cells import cell_rings, voronoi_cells
from cvtimg.placement.sums import sum_by_cell
from cvtimg.regions import Region
from cvtimg.regions.polygons import triangle_areas, triangulate

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CellMeasures:
    """Measures of the Voronoi cells of points of the plane, clipped to their region. Smaller is more regular.

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
        The largest area of a cell by the smallest; 1 for equal cells.
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
    """Measure the Voronoi cells of (K, 2) points in a region of the plane, each of area 1 a unit."""
    from scipy.spatial import cKDTree

    n = len(points)
    cells = voronoi_cells(points, region)
    rings, own = cell_rings(cells)
    heights = np.zeros(n)
    for ring, cell in zip(rings, own, strict=True):
        farthest = np.linalg.norm(ring - points[cell], axis=1).max()
        heights[cell] = max(heights[cell], farthest)
    triangles, cell_of = triangulate(cells)
    areas, second = _second_moments(triangles, cell_of, points)
    gaps = cKDTree(points).query(points, 2)[0][:, 1] if n > 1 else np.full(1, np.inf)
    traces = np.trace(second, axis1=1, axis2=2)
    deviatoric = second - traces[:, None, None] / 2 * np.eye(2)
    return CellMeasures(
        h=float(heights.max()),
        chi=float((2 * heights / gaps).max()),
        h_ratio=float(heights.max() / heights.min()),
        gap_ratio=float(gaps.max() / gaps.min()) if n > 1 else 1.0,
        gap_variation=float(gaps.std() / gaps.mean()) if n > 1 else 0.0,
        area_ratio=float(areas.max() / areas.min()),
        tau=float(np.abs(traces - traces.mean()).max()),
        d=float(np.abs(np.linalg.det(deviatoric)).max()),
    )


def _second_moments(
    triangles: NDArray[np.float64], own: NDArray[np.intp], points: Points
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Areas (K,), and second moments (K, 2, 2) by area about the points."""
    steps = triangles - points[own][:, None]
    areas = triangle_areas(triangles)
    total = steps.sum(axis=1)
    # Over a triangle: the outer products of its corners and of their sum, by 12.
    products = np.einsum("tid,tie->tde", steps, steps) + total[:, :, None] * total[:, None, :]
    cells = sum_by_cell(own, areas, len(points))
    sums = sum_by_cell(own, areas[:, None] * products.reshape(-1, 4) / 12, len(points))
    return cells, (sums / cells[:, None]).reshape(-1, 2, 2)
