"""Generators on the boundary of a region.

Three ways: points that are given stay; a number of points is spread along the boundary before the others are placed;
or generators find the boundary themselves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_in_range, check_needs, check_places, check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Points
from cvtimg.placement.densities import Density
from cvtimg.placement.implicit import ImplicitRegion
from cvtimg.placement.regions import Box, Region

#: Distance, in sizes of the region, by which what is called on the boundary may be off.
_NEAR = 1e-6
#: Pixels by which the outline of a mask may be simplified before points are spread along it.
_SIMPLER = 0.75


class ToBoundary:
    """Brings to a corner the generator whose cell holds it, and to the boundary those whose cells meet it.

    There are `per_cell` points of the boundary for each side of a cell. The energy may rise at a move. M. Gunzburger's
    lecture on centroidal Voronoi tessellations has the recipe.
    """

    def __init__(self, region: Region, n_generators: int, per_cell: int = 8) -> None:
        spacing = (region.measure / n_generators) ** (1 / region.n_dims)
        self._region = region
        self._corners = region.corners
        self._boundary = region.boundary_points(spacing / per_cell)
        check_needs("on_boundary='auto'", True, f"a region with a boundary, not {region!r}", len(self._boundary) > 0)

    def __call__(self, there: Points, before: Points) -> Points:
        """Move generators whose cells, before they moved, met the boundary."""
        from scipy.spatial import cKDTree

        tree = cKDTree(before)
        moved = self._region.project(there)
        meets = np.unique(tree.query(self._boundary)[1])
        moved[meets] = self._region.to_boundary(moved[meets])
        if len(self._corners):
            gaps, owner = tree.query(self._corners)
            # The nearest corner last, so that it wins where a cell holds several.
            for corner in np.argsort(-gaps, kind="stable"):
                moved[owner[corner]] = self._corners[corner]
        return moved


def checked_boundary(on_boundary: ArrayLike, region: Region) -> Points:
    """Return points given as (B, D), which must lie on the boundary."""
    points = check_places("on_boundary", on_boundary, region.n_dims)
    off = np.linalg.norm(region.to_boundary(points) - points, axis=1)
    size = float(np.linalg.norm(region.bounds[1] - region.bounds[0]))
    worst = points[off.argmax()].tolist()
    check_in_range("on_boundary", worst, off.max() <= _NEAR * size, f"on the boundary, which is {off.max():g} away")
    return points


def spread_along_boundary(region: Region, n_points: int, density: Density) -> Points:
    """Spread points along the boundary of a region of the plane, as dense as generators inside; corners come first.

    In the plane generators are rho^(-1/4) apart, and so are these.
    """
    if isinstance(region, Box):
        check_that(repr(region), not any(region.periodic), "not be periodic, for on_boundary as a number")
    outline = region.outline(_SIMPLER)
    lines = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(outline))]
    spacing = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines) / (32 * n_points)
    dense_lines, lengths = [], []
    for line in lines:
        dense = shapely.get_coordinates(shapely.segmentize(shapely.linestrings(line), spacing))
        steps = np.linalg.norm(np.diff(dense, axis=0), axis=1)
        weights = steps * density((dense[1:] + dense[:-1]) / 2) ** 0.25
        dense_lines.append(dense)
        lengths.append(np.concatenate([[0.0], np.cumsum(weights)]))
    ends = np.cumsum([0, *(length[-1] for length in lengths)])
    shares = np.diff(np.rint(ends / ends[-1] * n_points).astype(np.intp))
    spread: list[Points] = []
    for dense, length, n in zip(dense_lines, lengths, shares, strict=True):
        corners = np.flatnonzero([(np.abs(region.corners - place).max(axis=1) < 1e-9).any() for place in dense[:-1]])
        first = length[corners[0]] if len(corners) else 0.0
        at = (first + np.arange(n) / max(n, 1) * length[-1]) % length[-1]
        points = np.stack([np.interp(at, length, column) for column in dense.T], axis=1)
        spread.append(_with_corners(points, dense[corners]))
    points = np.concatenate(spread)
    return region.to_boundary(points) if isinstance(region, ImplicitRegion) else points


def _with_corners(points: Points, corners: Points) -> Points:
    """Move the nearest point of a ring to each of its corners."""
    free = np.ones(len(points), bool)
    for corner in corners[: len(points)]:
        gaps = np.where(free, np.linalg.norm(points - corner, axis=1), np.inf)
        points[gaps.argmin()] = corner
        free[gaps.argmin()] = False
    return points
