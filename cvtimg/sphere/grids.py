"""Grids of the sphere, of any number of points and any density."""

from dataclasses import dataclass

import numpy as np

from cvtimg._shared.budgets import MOST_POINTS
from cvtimg._shared.checks import check_at_least, check_choice, check_in_range, check_that
from cvtimg._shared.choices import EffortName
from cvtimg._shared.iteration import Callback, Watch
from cvtimg._shared.messages import warn
from cvtimg._shared.types import Bools
from cvtimg.sphere.densities import GlobePicture, Scaled, SphereDensityLike, as_sphere_density
from cvtimg.sphere.descent import descend, polish_angles
from cvtimg.sphere.result import SphereGrid
from cvtimg.sphere.starts import Lattice, bisected, drawn, icosahedron, in_order, twist, without
from cvtimg.sphere.triangulation import Cells, SphereTriangulation, SumCells, WeightedCells, uniform_cells, unit
from cvtimg.sphere.widths import CellWidth

#: Points of the coarsest level, at least: few where cells are alike, so that twelve are pentagons; and with a density.
_COARSEST = (12, 600)
#: Coarsest grids with cells alike, and the moves after which the lowest goes on.
_TRIALS, _TRIAL_MOVES = 8, 200
#: Steps along a side of an icosahedron, at most, without moving a coarser lattice first.
_DIRECT = 32
#: Share of the sphere on which a density may be 0 without a warning.
_MOST_ZEROS = 0.01


@dataclass(frozen=True, slots=True)
class GridEffort:
    """How long points move; lengths are in sizes of cells."""

    moves: int  # at most, at each level
    tolerance: float  # offset from centers of mass at which a level ends
    # With a density: how far points are moved at random at each level, to remove defects; the best grid is kept.
    noises: tuple[float, ...]
    polishing: int  # moves of polishing at most


#: The registry: names for `effort`.
EFFORTS: dict[str, GridEffort] = {
    "fast": GridEffort(30, 1e-3, (0.2,), 60),
    "balanced": GridEffort(100, 1e-6, (0.2,), 100),
    "best": GridEffort(300, 1e-8, (0.2, 0.15, 0.25), 300),
}


def sphere_grid(
    n: int | None = None,
    *,
    density: SphereDensityLike = None,
    polish: bool = True,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> SphereGrid:
    """Place points on the sphere, each at the center of mass of its own Voronoi cell, projected to the sphere.

    Parameters
    ----------
    n : int, optional
        Number of points, >= 4; by default that of `density`, a `CellWidth`. With 12, 32, 42, 72, ... 10 t + 2 and no
        density, t = h^2 + h k + k^2, all cells but twelve are hexagons.
    density : callable, (H, 2 H) array, CellWidth, Refinement or sequence of these, optional
        A function from (N, 3) unit vectors to (N,) values >= 0; an equirectangular image, longitudes -180..180 from
        left to right and latitudes 90..-90 from top to bottom; or `Refinement` caps, of which the finest counts. The
        size of cells goes as density^(-1/4); by an image, it grows by at most 15 % through a cell and is at most 10
        times that of the finest. `CellWidth` says it in km. 1 everywhere by default.
    polish : bool
        Move points a little at the end, so that no triangle is obtuse.
    effort : {"fast", "balanced", "best"}
        How long points move.
    rng : int or numpy.random.Generator
        Seed. The same seed gives the same bits, whatever the number of threads.
    callback : callable, optional
        Called before each move with its number and the energy; it stops by returning True.

    Returns
    -------
    SphereGrid

    Notes
    -----
    Points move by limited-memory BFGS. Moments of cells are exact for the density 1; other densities are taken to be
    linear between points and corners of cells.

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, Constrained centroidal Voronoi tessellations for surfaces, SIAM J. Sci. Comput. 24
    (2003) 1488-1506, doi 10.1137/S1064827501391576.

    Examples
    --------
    >>> from cvtimg import sphere_grid
    >>> grid = sphere_grid(642)
    >>> grid, grid.measures().n_pentagons, grid.measures().n_obtuse
    (SphereGrid(642 points, 1280 triangles), 12, 0)
    """
    if n is None:
        check_that("n", isinstance(density, CellWidth), "be given, unless the density is a CellWidth")
        n = density.n_points  # type: ignore[union-attr]
    n = check_at_least("n", n, 4, "the corners of a tetrahedron")
    check_in_range("n", n, n <= MOST_POINTS, f"at most {MOST_POINTS}")
    settings = EFFORTS[check_choice("effort", effort, EFFORTS)]
    weight = as_sphere_density(density)
    random = np.random.default_rng(rng)
    scaled = None if weight is None else Scaled(weight)
    if scaled is not None and scaled.share_of_zeros > _MOST_ZEROS and not isinstance(weight, GlobePicture):
        warn(
            f"the density is 0 on {scaled.share_of_zeros:.0%} of the sphere: cells there are 100 times as wide as the "
            "finest, and triangles at their border are bad; a density that falls gradually makes better grids"
        )
    return _Plan(scaled, settings, polish, random, Watch(callback)).by_levels(_sizes(n, weight is None))


def _sizes(n: int, is_even: bool) -> list[int]:
    """Numbers of points of all levels, from the coarsest."""
    coarsest, sizes = _COARSEST[not is_even], [n]
    while (coarser := (sizes[-1] + 9) // 4) >= coarsest:
        if is_even and twist(sizes[-1]) and not twist(coarser):
            break
        sizes.append(coarser)
    return sizes[::-1]


@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """What all ways to a grid share."""

    density: Scaled | None
    effort: GridEffort
    polish: bool
    rng: np.random.Generator
    watch: Watch

    def by_levels(self, sizes: list[int]) -> SphereGrid:
        """Begin with few points, and double the resolution at each level."""
        noises = (0.0,) if self.density is None else self.effort.noises
        grids = [self._finished(self._climb(sizes, noise)) for noise in noises]
        return grids[0] if len(grids) == 1 else min(grids, key=lambda grid: (grid.measures().n_obtuse, grid.energy))

    def _climb(self, sizes: list[int], noise: float) -> SphereTriangulation:
        mesh = self._coarsest(sizes[0])
        for level, n in enumerate(sizes):
            if level:
                mesh = bisected(mesh)
            if n_surplus := len(mesh.points) - n:
                mesh = without(mesh, n_surplus, self.rng)
            mesh = in_order(mesh)
            sums = self._sums(n)
            if noise and level:
                step = noise * np.sqrt(sums(mesh, None).areas)[:, None]
                mesh.replace(unit(mesh.points + step * self.rng.normal(size=mesh.points.shape)))
            self._descend(mesh, sums)
        return mesh

    def _coarsest(self, n: int) -> SphereTriangulation:
        if self.density is not None:
            return SphereTriangulation(drawn(self.density.for_cells(n), n, self.rng))
        if n == 12:
            return icosahedron()
        if sides := twist(n):
            return self._latticed(*sides)
        trials = [SphereTriangulation(unit(self.rng.normal(size=(n, 3)))) for _ in range(_TRIALS)]
        return min(trials, key=lambda mesh: descend(mesh, uniform_cells, _TRIAL_MOVES, self.effort.tolerance).energy)

    def _latticed(self, h: int, k: int) -> SphereTriangulation:
        """Begin with a lattice on an icosahedron, moved as coarser ones are."""
        lattice = Lattice(h, k)
        steps = int(lattice.t**0.5)
        if steps <= _DIRECT:
            return SphereTriangulation(lattice.points())
        coarse = self._latticed(steps // 2, 0)
        self._descend(coarse, uniform_cells)
        return SphereTriangulation(lattice.points(Lattice(steps // 2, 0), coarse.points))

    def _sums(self, n: int) -> SumCells:
        """How cells are summed at a level of n points: without details that are finer than the cells."""
        return uniform_cells if self.density is None else WeightedCells(self.density.for_cells(n))

    def _descend(self, mesh: SphereTriangulation, sums: SumCells) -> Cells:
        return descend(mesh, sums, self.effort.moves, self.effort.tolerance, watch=self.watch)

    def _finished(self, mesh: SphereTriangulation) -> SphereGrid:
        sums = self._sums(len(mesh.points))
        if self.polish:
            polish_angles(mesh, np.sqrt(sums(mesh, None).areas), self.effort.polishing)
        return as_grid(mesh, sums, None)


def as_grid(mesh: SphereTriangulation, sums: SumCells, free: Bools | None) -> SphereGrid:
    """Sum the cells of a triangulation at its end."""
    cells = sums(mesh, free)
    weight = sums.density if isinstance(sums, WeightedCells) else None
    unit = weight.unit if isinstance(weight, Scaled) else 1.0
    return SphereGrid(
        points=mesh.points,
        triangles=mesh.triangles,
        areas=mesh.areas(),
        density=np.ones(len(mesh.points)) if weight is None else unit * weight(mesh.points),
        energy=unit * cells.energy,
        offset=cells.offset,
        fixed=np.zeros(len(mesh.points), bool) if free is None else ~free,
    )
