"""Moves of the points of a large grid in patches, which tell each other the positions along their borders."""

from __future__ import annotations

from inspect import iscoroutine
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_at_least, check_that
from cvtimg._shared.iteration import Watch
from cvtimg.sphere.densities import Scaled, SphereDensityLike, as_sphere_density
from cvtimg.sphere.descent import Stretch, block_size, follow
from cvtimg.sphere.grids import as_grid
from cvtimg.sphere.result import SphereGrid
from cvtimg.sphere.triangulation import (
    UNIFORM_ENERGY,
    Points,
    SphereTriangulation,
    SumCells,
    WeightedCells,
    uniform_cells,
)

_Indices = NDArray[np.intp]

#: Points around those of a patch that it is told of, in the largest cell sizes.
_HALO = 6.0
#: Circumscribed caps must be narrower than half the halo, and points may move by at most a quarter of it, so that no
#: point that a patch is not told of enters a cap.
_WIDEST, _FARTHEST = 0.5, 0.25
#: Far points by which a patch closes the sphere. They stay where they are.
_FAR = 400


def move_in_patches(
    grid: SphereGrid,
    moves: int,
    *,
    tolerance: float = 0.0,
    n_patches: int = 2,
    density: SphereDensityLike = None,
    client: Any = None,
) -> SphereGrid:
    """Move points to the centers of mass of their cells, in patches that may lie on several machines.

    Parameters
    ----------
    grid : SphereGrid
        Where to begin. Its points should be numbered along a curve, as those of `cvtimg.sphere_grid` are.
    moves : int
        Number of moves at most, >= 0, by the method of `cvtimg.sphere_grid`.
    tolerance : float
        Points rest where the root mean square of their distances to centers of mass, by the sizes of cells, is no more
        than this.
    n_patches : int
        Number of patches, >= 1.
    density : optional
        That of the grid, as in `cvtimg.sphere_grid`; 1 everywhere by default.
    client : dask.distributed.Client, optional
        Whose workers hold the patches, and send each other the positions of points along borders; the client is sent
        sums. Without it patches are moved one after the other.

    Returns
    -------
    SphereGrid
        With the same bits for any number of patches and workers.

    Raises
    ------
    ValueError
        If a number is out of range, triangles are so large that patches are too small for them, or points are so far
        from rest that they move across borders.

    See Also
    --------
    cvtimg.sphere_grid

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
    check_that("tolerance", tolerance >= 0, "be >= 0")
    check_at_least("n_patches", n_patches, 1, "the number of patches")
    weight = as_sphere_density(density)
    sums: SumCells = uniform_cells if weight is None else WeightedCells(Scaled(weight).for_cells(len(grid.points)))
    patches = _Patches(grid, n_patches, sums, client)
    follow(patches, moves, tolerance, Watch())
    return as_grid(SphereTriangulation(patches.points()), sums, None)


class _Patches:
    """All patches, side by side where workers have them."""

    def __init__(self, grid: SphereGrid, n_patches: int, sums: SumCells, client: Any) -> None:
        self.n_free, self.constant = len(grid.points), 0.0 if isinstance(sums, WeightedCells) else UNIFORM_ENERGY
        self._is_remote = client is not None
        block = block_size(self.n_free)
        n_blocks = -(-self.n_free // block)
        # Patches begin with a block, so that sums have the same parts for any number of them.
        bounds = np.unique(np.linspace(0, n_blocks, n_patches + 1).astype(int)) * block
        bounds[-1] = self.n_free
        reach = _HALO * float(np.sqrt(grid.areas.max()))
        members = [_members(grid.points, first, last, reach) for first, last in pairwise(bounds)]
        self._patches = []
        workers = list(client.nthreads()) if self._is_remote else []
        check_that("client", bool(workers) or not self._is_remote, "have workers")
        for number, (near, ids) in enumerate(members):
            own = slice(*np.searchsorted(ids, bounds[number : number + 2]).tolist())
            owners = np.searchsorted(bounds, near, side="right") - 1
            receives = {
                int(other): np.searchsorted(ids, near[owners == other])
                for other in np.unique(owners)
                if other != number
            }
            sends = {
                other: theirs[(theirs >= bounds[number]) & (theirs < bounds[number + 1])] - bounds[number]
                for other, (theirs, _) in enumerate(members)
                if other != number
            }
            given = number, grid.points[ids], own, sums, block, reach, receives, sends
            if self._is_remote:
                at = [workers[number % len(workers)]]
                sent = client.scatter(given, workers=at, hash=False)
                self._patches.append(client.submit(_Patch, sent, actor=True, pure=False, workers=at))
            else:
                self._patches.append(_Patch(given))
        if self._is_remote:
            self._patches = [future.result() for future in self._patches]
        self._each("meet", self._patches)

    def measured(self, slot: int) -> NDArray[np.float64]:
        return np.concatenate(self._each("measured", slot))

    def move(self, step: NDArray[np.float64], part: float, force: bool) -> bool:
        self._each("propose", step, part)
        is_sound = all(self._each("exchange"))
        if is_sound or force:
            self._each("settle")
        return is_sound or force

    def points(self) -> Points:
        return np.concatenate(self._each("positions"))

    def _each(self, name: str, *args: Any) -> list[Any]:
        answers = [getattr(patch, name)(*args) for patch in self._patches]
        return [answer.result() for answer in answers] if self._is_remote else answers


def _members(points: Points, first: int, last: int, reach: float) -> tuple[_Indices, _Indices]:
    """Return the numbers of a patch's points and those around them, and with some far away, in rising order."""
    from scipy.spatial import cKDTree

    distances = cKDTree(points[first:last]).query(points, distance_upper_bound=reach)[0]
    near, far = np.flatnonzero(distances < np.inf), np.flatnonzero(distances == np.inf)
    return near, np.union1d(near, far[:: max(len(far) // _FAR, 1)])


class _Patch:
    """Points of which a stretch belongs to the patch; the others are what it must know of them."""

    def __init__(self, given: tuple[Any, ...]) -> None:
        self._number, points, self._own, sums, block, reach, self._receives, self._sends = given
        self._stretch = Stretch(SphereTriangulation(points), self._own, sums, block)
        self._start = self._stretch.points
        self._reach = reach

    def meet(self, patches: list[Any]) -> None:
        """Take all patches, some of which are to be asked."""
        self._others = patches

    def positions(self) -> Points:
        """Return where own points are."""
        return self._stretch.points

    def measured(self, slot: int) -> NDArray[np.float64]:
        """Sum own cells, as a `Stretch` does."""
        self._check()
        return self._stretch.measured(slot)

    def propose(self, step: NDArray[np.float64], part: float) -> None:
        """Find where own points may move to."""
        self._there = self._stretch.moved(step, part)

    def border(self, number: int) -> Points:
        """Return where points may move to that another patch must know of."""
        return self._there[self._sends[number]]

    async def border_meanwhile(self, number: int) -> Points:
        """Return the same while this patch is at work, which asks others at that time."""
        return self.border(number)

    def exchange(self) -> bool:
        """Ask others where their points may move to; return whether no triangle of own points turns over."""
        mesh = self._stretch.mesh
        self._proposed = mesh.points.copy()
        self._proposed[self._own] = self._there
        answers = {number: self._ask(self._others[number]) for number in self._receives}
        for number, answer in answers.items():
            self._proposed[self._receives[number]] = answer if isinstance(answer, np.ndarray) else answer.result()
        return not mesh.n_turned(self._proposed, self._is_own(mesh.triangles))

    def _ask(self, other: Any) -> Any:
        answer = other.border_meanwhile(self._number)
        if iscoroutine(answer):  # the other is in this process: nobody would wait for that
            answer.close()
            answer = other.border(self._number)
        return answer

    def settle(self) -> None:
        """Move points to where they may move."""
        self._stretch.mesh.replace(self._proposed)

    def _is_own(self, triangles: NDArray[np.int32]) -> NDArray[np.bool_]:
        return ((triangles >= self._own.start) & (triangles < self._own.stop)).any(axis=1)

    def _check(self) -> None:
        """Refuse what may bring points that the patch is not told of into caps of its triangles."""
        mesh = self._stretch.mesh
        is_own = self._is_own(mesh.triangles)
        width = 2 * _longest(mesh.circumcenters()[is_own] - mesh.points[mesh.triangles[is_own, 0]])
        check_that("grid", width < _WIDEST * self._reach, "have triangles no wider than half of what surrounds a patch")
        way = _longest(self._stretch.points - self._start)
        check_that("grid", way < _FARTHEST * self._reach, "be so near to rest that points do not move across borders")


def _longest(vectors: Points) -> float:
    return float(np.sqrt(np.einsum("ij,ij->i", vectors, vectors).max(initial=0)))
