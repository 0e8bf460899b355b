"""Generators on the boundary of a region.

Points that are given stay, or generators find the boundary themselves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_in_range, check_needs, check_places
from cvtimg._shared.types import Points
from cvtimg.placement.regions import Region

#: Distance, in sizes of the region, by which what is called on the boundary may be off.
_NEAR = 1e-6


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
