"""Grids that replace a part of a parent grid and keep the rest of it, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_at_least, check_choice, check_that
from cvtimg._shared.choices import EffortName
from cvtimg._shared.iteration import Callback, Watch
from cvtimg._shared.types import Bools, Floats, Points
from cvtimg.sphere.densities import (
    GROWTH,
    GlobePicture,
    Scaled,
    SphereDensity,
    SphereDensityLike,
    as_sphere_density,
    from_degrees,
)
from cvtimg.sphere.descent import descend, polish_angles
from cvtimg.sphere.grids import EFFORTS, as_grid, sphere_grid
from cvtimg.sphere.parts import Cap, PartLike, inside_of
from cvtimg.sphere.result import SphereGrid
from cvtimg.sphere.triangulation import SphereTriangulation, WeightedCells, check_sphere_points, unit

#: New points keep out of the circumscribed caps of kept triangles by this part of their radii, and are moved out so
#: often, as one may lead into the next.
_MARGIN, _PUSHES = 0.01, 4
#: Caps nearest to a point that are looked at: as many as may hold it.
_CAPS = 6
#: Sizes of cells that new points begin from kept ones at least: with more, fewer of the grid are taken.
_APART = 0.6
#: By what factor faster sizes change than by `GROWTH`, again and again, where points find no room while the
#: finest cells are less than half the mean.
_FASTER, _FINEST = 1.5, 0.5
#: Sizes of cells of the parent between which the size of cells inside is looked for.
_SIZES = (1e-3, 1e3)
#: Pixels of the height of the picture of distances from the border of a part that is no cap: with more, it is finer.
_HEIGHT = 512


def nested_grid(
    parent: SphereGrid | ArrayLike,
    n: int,
    *,
    within: PartLike,
    density: SphereDensityLike = None,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> SphereGrid:
    """Replace a part of a grid by a finer or coarser one.

    Every point outside the part, and every triangle of three such points, stays with the same bits.

    Parameters
    ----------
    parent : SphereGrid or (N, 3) array
        A grid, or the points of one.
    n : int
        Number of new points.
    within : callable, GeoJSON, shapely geometry or (H, 2 H) array
        The part to replace: a `Cap`, or what `limit_area` takes.
    density : callable, (H, 2 H) array, Refinement or sequence of these, optional
        As in `cvtimg.sphere_grid`, for the new points; so that they fit, cells near the border of the part should have
        the sizes of the parent. By default sizes change by 15 % from cell to cell, from those of the parent on,
        and faster where n asks for it.
    effort, rng, callback
        As in `cvtimg.sphere_grid`.

    Returns
    -------
    SphereGrid
        The kept points, in the order of the parent, are first; they are marked in `fixed`.

    Examples
    --------
    >>> from cvtimg import sphere_grid
    >>> from cvtimg.sphere import Cap, nested_grid
    >>> parent = sphere_grid(642)
    >>> grid = nested_grid(parent, 300, within=Cap(10, 50, 25))
    >>> kept = parent.points[~Cap(10, 50, 25)(parent.points)]
    >>> bool((grid.points[grid.fixed] == kept).all()), len(grid.points) - len(kept)
    (True, 300)
    """
    n = check_at_least("n", n, 1, "the number of new points")
    settings = EFFORTS[check_choice("effort", effort, EFFORTS)]
    points = check_sphere_points("parent", parent.points if isinstance(parent, SphereGrid) else parent, least=4)
    mesh = SphereTriangulation(points, parent.triangles if isinstance(parent, SphereGrid) else None)
    inside = inside_of("within", within, points)
    check_that("within", inside.any(), "hold a point of the parent")
    check_that("within", not inside.all(), "leave a point of the parent outside")
    kept = Kept.of(mesh, ~inside)
    transition = _Transition.of(mesh, inside, within)
    weight = as_sphere_density(density)
    wanted = transition.density(n) if weight is None else Scaled(weight).for_cells(len(points))
    random = np.random.default_rng(rng)
    new = kept.filled(transition.start(wanted, n, random), wanted, n, random)
    nested = SphereTriangulation(np.concatenate([kept.points, new]))
    free = np.arange(len(nested.points)) >= len(kept.points)
    sums = WeightedCells(wanted)
    watch, project = Watch(callback), kept.project
    cells = descend(nested, sums, settings.moves, settings.tolerance, free=free, project=project, watch=watch)
    polish_angles(nested, np.sqrt(cells.areas), settings.polishing, free=free, project=project)
    return as_grid(nested, sums, free)


@dataclass(frozen=True, slots=True, eq=False)
class _Transition:
    """Sizes of cells that lead from those of a parent to those of a part of it."""

    # From (N, 3) points to how far they are inside of the part, in radians.
    depth: Callable[[Points], Floats]
    size: float  # Of the cells of the parent at the border, in radians
    # (N, 3): of the parent, to sum by.
    points: Points
    areas: Floats
    inside: Bools  # (N,)

    @classmethod
    def of(cls, mesh: SphereTriangulation, inside: Bools, within: PartLike) -> _Transition:
        areas = mesh.areas()
        at_border = inside[mesh.triangles].any(axis=1) & ~inside[mesh.triangles].all(axis=1)
        size = float(np.sqrt(np.median(areas[np.unique(mesh.triangles[at_border])])))
        depth = within.depth if isinstance(within, Cap) else _depths(mesh.points, inside)
        return cls(depth, size, mesh.points, areas, inside)

    def density(self, n: int) -> SphereDensity:
        """Return the density by which about n cells fill the part."""
        from scipy.optimize import brentq

        areas, depths = self.areas[self.inside], self.depth(self.points[self.inside])
        least, growth = max(_SIZES[0], _FINEST * float(np.sqrt(areas.sum() / n)) / self.size), GROWTH

        def surplus(size: float) -> float:
            return float((areas / self._sizes(depths, np.exp(size), growth) ** 2).sum()) - n

        while least < 1 and surplus(np.log(least)) < 0 and growth < 1:
            growth *= _FASTER
        low, high = np.log(least), np.log(_SIZES[1])
        if surplus(high) < 0:
            high = brentq(surplus, low, high) if surplus(low) > 0 else low
        factor = float(np.exp(high))  # so few points may be asked for that sizes grow as long as there is way
        finest = self.size * min(factor, 1)
        return lambda points: (finest / self._sizes(self.depth(points), factor, growth)) ** 4

    def start(self, wanted: SphereDensity, n: int, rng: np.random.Generator) -> Points:
        """Return the points of a grid by which about n are in the part, fewer and fewer outside."""

        def fading(points: Points) -> Floats:
            return wanted(points) / self._sizes(-self.depth(points), np.inf) ** 4

        counts = self.areas * np.sqrt(fading(self.points))
        n_all = max(round(n * counts.sum() / counts[self.inside].sum()), 12)
        return sphere_grid(n_all, density=fading, effort="fast", polish=False, rng=rng).points

    def _sizes(self, depths: Floats, factor: float, growth: float = GROWTH) -> Floats:
        """Return sizes at depths that go from that at the border to `factor` times that, as fast as they may."""
        way = growth * np.maximum(depths, 0) / self.size
        factors = np.minimum(factor, 1 + way) if factor > 1 else np.maximum(factor, 1 - way)
        return self.size * factors


def _depths(points: Points, inside: Bools) -> Callable[[Points], Floats]:
    """Return a function for how far places are from the other side: a picture, as it is asked often."""
    from scipy.spatial import cKDTree

    steps = 180 * (np.arange(2 * _HEIGHT) + 0.5) / _HEIGHT
    places = from_degrees(np.tile(steps - 180, _HEIGHT), np.repeat(90 - steps[:_HEIGHT], 2 * _HEIGHT))
    to_outer, to_inner = (cKDTree(points[side]).query(places)[0] for side in (~inside, inside))
    return GlobePicture.padded((to_outer - to_inner).reshape(_HEIGHT, -1).astype(np.float32) / 2)


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """What stays of a parent."""

    points: Points  # (K, 3)
    sizes: Floats  # (K,): of their cells in the parent
    # (B, 3): circumscribed caps of kept triangles at the border: Delaunay triangles stay if no other point gets into
    # them.
    centers: Points
    radii: Floats
    # Of kept points, of centers of caps, and of all points of the parent.
    kept_tree: Any
    cap_tree: Any
    parent_tree: Any
    gone: Bools  # (N,): points of the parent that are replaced

    @classmethod
    def of(cls, mesh: SphereTriangulation, kept: Bools) -> Kept:
        """Find the caps of a parent that new points must keep out of."""
        from scipy.spatial import cKDTree

        near = ~kept
        for _ in range(3):  # caps reach no farther than the triangles around
            near[np.unique(mesh.triangles[near[mesh.triangles].any(axis=1)])] = True
        border = np.flatnonzero(kept[mesh.triangles].all(axis=1) & near[mesh.triangles].any(axis=1))
        centers = mesh.circumcenters()[border]
        chords = np.linalg.norm(mesh.points[mesh.triangles[border, 0]] - centers, axis=1)
        points = mesh.points[kept]
        tree = cKDTree(centers) if len(border) else None
        sizes = np.sqrt(mesh.areas()[kept])
        radii = (1 + _MARGIN) * 2 * np.arcsin(np.minimum(chords / 2, 1))
        return cls(points, sizes, centers, radii, cKDTree(points), tree, cKDTree(mesh.points), ~kept)

    def project(self, there: Points, before: Points) -> Points:
        """Move points after the kept ones out of the caps."""
        new, reach = there[len(self.points) :], 2 * np.sin(self.radii.max(initial=0) / 2)
        for _ in range(_PUSHES if self.cap_tree is not None else 0):
            # Most points are far from all caps: their index is one too large then, and their distance infinite.
            distances, caps = self.cap_tree.query(new, k=_CAPS, distance_upper_bound=reach)
            depths = np.append(self.radii, 0)[caps] - 2 * np.arcsin(np.minimum(distances / 2, 1))
            worst = depths.argmax(axis=1)
            rows = np.flatnonzero(depths[np.arange(len(new)), worst] > 0)
            if not len(rows):
                break
            cap = caps[rows, worst[rows]]
            centers, radii = self.centers[cap], self.radii[cap, None] * (1 + 1e-9)
            away = new[rows] - np.einsum("ij,ij->i", new[rows], centers)[:, None] * centers
            away /= np.maximum(np.sqrt(np.einsum("ij,ij->i", away, away)), 1e-300)[:, None]
            new[rows] = unit(np.cos(radii) * centers + np.sin(radii) * away)
        return there

    def filled(self, places: Points, density: SphereDensity, n: int, rng: np.random.Generator) -> Points:
        """Choose n new points from a grid; where they are too few, add middles of the largest triangles.

        They are in the cells that are replaced, and not too near to kept points.
        """
        places = places[self.gone[self.parent_tree.query(places)[1]]]
        places = self.project(np.concatenate([self.points, places]), self.points)[len(self.points) :]
        distances, nearest = self.kept_tree.query(places)
        points = places[distances > _APART * self.sizes[nearest]]
        points = points[np.sort(rng.permutation(len(points))[:n])]
        while len(points) < n:
            mesh = SphereTriangulation(np.concatenate([self.points, points]))
            corners = mesh.points[mesh.triangles]
            spans = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1) * density(unit(corners.sum(axis=1))) ** 0.25
            middles = unit(corners.sum(axis=1))[np.argsort(-spans, kind="stable")]
            middles = middles[self.gone[self.parent_tree.query(middles)[1]]]
            check_that("n", len(middles) > 0, "be smaller, or the part larger")
            points = np.concatenate([points, middles[: max(min(n - len(points), len(middles) // 8), 1)]])
        return points
