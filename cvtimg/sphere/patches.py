"""Moves of the points of a large grid in patches, which share only the positions along their borders."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_at_least, check_that
from cvtimg.sphere.densities import Scaled, SphereDensityLike, as_sphere_density
from cvtimg.sphere.descent import SumCells, WeightedCells, uniform_cells
from cvtimg.sphere.grids import as_grid
from cvtimg.sphere.result import SphereGrid
from cvtimg.sphere.triangulation import Points, Triangulation, unit

#: Points around those of a patch that it is told of, in the largest cell sizes; triangles may span half of that.
_HALO, _SPAN = 6.0, 3.0
#: Far points by which a patch closes the sphere.
_FAR = 400


def move_in_patches(
    grid: SphereGrid, moves: int, *, n_patches: int = 2, density: SphereDensityLike = None, client: Any = None
) -> SphereGrid:
    """Move points to the centers of mass of their cells, in patches that may lie on several machines.

    Parameters
    ----------
    grid : SphereGrid
        Where to begin. Its points should be numbered along a curve, as those of `cvtimg.sphere_grid` are.
    moves : int
        Number of moves of Lloyd's method, >= 0.
    n_patches : int
        Number of patches, >= 1.
    density : optional
        That of the grid, as in `cvtimg.sphere_grid`; 1 everywhere by default.
    client : dask.distributed.Client, optional
        Whose workers hold the patches; without it they are moved one after the other.

    Returns
    -------
    SphereGrid
        With the same bits for any number of patches and workers.

    Raises
    ------
    ValueError
        If a number is out of range, or triangles are so large that patches are too small for them.

    Examples
    --------
    >>> from cvtimg import sphere_grid
    >>> from cvtimg.sphere import move_in_patches
    >>> grid = sphere_grid(2000, start="spiral", effort="fast", polish=False)
    >>> one, two = (move_in_patches(grid, 3, n_patches=n) for n in (1, 2))
    >>> bool((one.points == two.points).all())
    True
    """
    check_at_least("moves", moves, 0, "the number of moves")
    check_at_least("n_patches", n_patches, 1, "the number of patches")
    weight = as_sphere_density(density)
    sums: SumCells = uniform_cells if weight is None else WeightedCells(Scaled(weight).for_cells(len(grid.points)))
    points, bounds = grid.points.copy(), np.linspace(0, len(grid.points), n_patches + 1).astype(int)
    reach = _HALO * float(np.sqrt(grid.areas.max()))
    members = [_members(points, first, last, reach) for first, last in pairwise(bounds)]
    patches: list[Any] = [
        _Patch(points[ids], np.searchsorted(ids, [first, last]), sums, reach)
        for ids, first, last in zip(members, bounds, bounds[1:], strict=False)
    ]
    if client is not None:
        futures = [client.submit(_itself, patch, actor=True, pure=False) for patch in patches]
        patches = [future.result() for future in futures]
    for _ in range(moves):
        steps = [patch.moved() for patch in patches]  # side by side, where workers have them
        points = np.concatenate([step if client is None else step.result() for step in steps])
        done = [patch.take(points[ids]) for patch, ids in zip(patches, members, strict=True)]
        if client is not None:
            for each in done:
                each.result()
    mesh = Triangulation(points)
    return as_grid(mesh, sums, None)


def _itself(patch: _Patch) -> _Patch:
    return patch


def _members(points: Points, first: int, last: int, reach: float) -> NDArray[np.intp]:
    """Return the numbers of a patch's points, of those around them, and of some far away, in rising order."""
    from scipy.spatial import cKDTree

    distances = cKDTree(points[first:last]).query(points, distance_upper_bound=reach)[0]
    near = np.flatnonzero(distances < np.inf)
    far = np.flatnonzero(distances == np.inf)
    return np.union1d(near, far[:: max(len(far) // _FAR, 1)])


class _Patch:
    """Points of which a stretch belongs to the patch; the others are what it must know of them."""

    def __init__(self, points: Points, own: NDArray[np.intp], sums: SumCells, reach: float) -> None:
        self._mesh = Triangulation(points)
        self._own = slice(int(own[0]), int(own[1]))
        self._sums = sums
        self._widest = _SPAN / _HALO * reach

    def moved(self) -> Points:
        """Return where the own points move to."""
        self._check()
        cells = self._sums(self._mesh)
        there: Points = unit(self._mesh.points + cells.pulls / cells.masses[:, None])[self._own]
        return there

    def take(self, points: Points) -> None:
        """Take the new positions of all points."""
        self._mesh.replace(np.ascontiguousarray(points))

    def _check(self) -> None:
        """Refuse triangles of own points that are so wide that a point outside of the halo may be in their caps."""
        triangles = self._mesh.triangles
        is_own = ((triangles >= self._own.start) & (triangles < self._own.stop)).any(axis=1)
        gaps = self._mesh.circumcenters()[is_own] - self._mesh.points[triangles[is_own, 0]]
        width = 2 * float(np.sqrt(np.einsum("ij,ij->i", gaps, gaps).max(initial=0)))
        check_that("grid", width < self._widest, "have triangles no wider than half of what surrounds a patch")
