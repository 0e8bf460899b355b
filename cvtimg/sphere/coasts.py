"""Grids whose points follow coasts: no triangle has corners on both sides."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import ROUNDING
from cvtimg._shared.checks import check_at_least, check_choice, check_picture_density
from cvtimg._shared.choices import EffortName
from cvtimg._shared.iteration import Callback, Watch
from cvtimg._shared.messages import warn
from cvtimg._shared.records import Claims
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Indices, Ints, Points
from cvtimg.sphere.densities import (
    GlobePicture,
    Scaled,
    SphereDensityLike,
    as_sphere_density,
    check_globe,
    from_degrees,
)
from cvtimg.sphere.descent import polish_angles
from cvtimg.sphere.grids import EFFORTS, as_grid, sphere_grid
from cvtimg.sphere.result import SphereGrid
from cvtimg.sphere.triangulation import SphereTriangulation, SumCells, WeightedCells, uniform_cells, unit


@dataclass(frozen=True, slots=True)
class CoastSettings:
    """How coasts are drawn, and how points follow them; lengths are in sizes of cells."""

    smoothing: float = 1.0  # of coasts: cells cannot follow less
    fewest_cells: float = 6.0  # of islands and lakes; smaller ones are left out
    pixels: float = 3.0  # that a cell is drawn with
    together: float = 0.05  # two points meet on a coast where they would be nearer than this
    crowded: float = 0.8  # a point has too little of a coast if its cell holds less, and less than its neighbors' do
    aside: float = 1.1  # how far it then moves off
    every: int = 10  # moves, and only in the first two thirds of them, so that the others settle
    rounds: int = 20  # of polishing; each adds the points that have come to the coast
    polishing: tuple[int, int] = (50, 200)  # moves in a round: to the usual bounds of angles, then to wider ones
    wider: tuple[float, float] = (35.0, 89.0)  # in degrees: where coasts turn, few angles are near to 60


_HOW = CoastSettings()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CoastalGrid(SphereGrid):
    """A grid of the sphere whose points follow coasts.

    Attributes
    ----------
    on_coast : (N,) bool array
        Points on the boundary between land and sea.
    on_land : (N,) bool array
        Points on land and not on the coast.
    """

    on_coast: Bools
    on_land: Bools

    def _claims(self) -> Claims:
        yield from SphereGrid._claims(self)
        yield "no point of a coast is on land", ~(self.on_coast & self.on_land)

    def _flags(self) -> dict[str, Ints]:
        return {"land": self.on_land.astype(np.int32), "coast": self.on_coast.astype(np.int32)}


def coastal_grid(
    n: int,
    land: ArrayLike,
    *,
    density: SphereDensityLike = None,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> CoastalGrid:
    """Place points on the sphere so that those whose cells a coast crosses are on it.

    Parameters
    ----------
    n : int
        Number of points.
    land : (H, 2 H) array
        Mask of the globe, as `cvtimg.sphere_grid` takes images: True, or the largest value, for land, 0 for sea.
        Coasts are smoothed to what cells can follow; where there is none, points are placed as without it.
    density, effort, rng, callback
        As in `cvtimg.sphere_grid`.

    Returns
    -------
    CoastalGrid

    Examples
    --------
    >>> from cvtimg.sphere import coastal_grid
    >>> lat = np.linspace(89, -89, 90)[:, None]
    >>> grid = coastal_grid(642, np.broadcast_to(lat > 20, (90, 180)))
    >>> np.unique(grid.lat[grid.on_coast].round()).tolist()
    [20.0]
    """
    n = check_at_least("n", n, 4, "the corners of a tetrahedron")
    settings = EFFORTS[check_choice("effort", effort, EFFORTS)]
    weight = as_sphere_density(density)
    start = sphere_grid(n, density=density, effort="fast", polish=False, rng=rng)
    sums: SumCells = uniform_cells if weight is None else WeightedCells(Scaled(weight).for_cells(n))
    mesh = SphereTriangulation(start.points, start.triangles)
    coast = Coast.of(land, float(np.sqrt(start.areas.min())))
    watch = Watch(callback)
    on_coast = np.zeros(n, bool)
    if not len(coast.starts):
        warn("land has no coast that cells of this size can follow: points are placed as without it")
        even = sphere_grid(n, density=density, effort=effort, rng=rng, callback=callback)
        return _coastal(even, on_coast, coast)
    for move in range(settings.moves):
        cells = sums(mesh, None)
        if watch(cells.energy):
            break
        there = unit(mesh.points + cells.pulls / cells.masses[:, None])
        on_coast = coast.claimed(there, coast.crosses(mesh, on_coast), float(np.sqrt(cells.areas.min())))
        centers, there[on_coast] = there[on_coast], coast.nearest(there[on_coast])
        if move % _HOW.every == _HOW.every - 1 and move < 2 / 3 * settings.moves:
            # Where two rows of points come to the same coast, one of them must leave it.
            sizes = np.sqrt(cells.areas)
            aside = coast.crowded(mesh, on_coast, sizes)
            ways = (centers - there[on_coast])[aside[on_coast]]
            lengths = np.maximum(np.linalg.norm(ways, axis=1), 1e-300)
            there[aside] = unit(there[aside] + (_HOW.aside * sizes[aside] / lengths)[:, None] * ways)
            on_coast &= ~aside
        mesh.replace(there)
    on_coast = _settled(mesh, coast, on_coast, np.sqrt(sums(mesh, None).areas))
    return _coastal(as_grid(mesh, sums, ~on_coast), on_coast, coast)


def _coastal(grid: SphereGrid, on_coast: Bools, coast: Coast) -> CoastalGrid:
    """Say which points of a grid are on the coast, and which on land."""
    values = {field.name: getattr(grid, field.name) for field in fields(grid)}
    values["fixed"] = np.zeros(len(on_coast), bool)
    return CoastalGrid(**values, on_coast=on_coast, on_land=coast.is_land(grid.points) & ~on_coast)


def _settled(mesh: SphereTriangulation, coast: Coast, on_coast: Bools, sizes: Floats) -> Bools:
    """Polish angles while points on the coast move along it; return which are there in the end."""

    def project(there: Points, _: Points) -> Points:
        there[on_coast] = coast.nearest(there[on_coast])
        return there

    for _ in range(_HOW.rounds):
        added = coast.crosses(mesh, on_coast) & ~on_coast
        on_coast = coast.claimed(mesh.points, on_coast | added, float(sizes.min()))
        mesh.replace(project(mesh.points.copy(), mesh.points))
        polish_angles(mesh, sizes, _HOW.polishing[0], project=project)
        polish_angles(mesh, sizes, _HOW.polishing[1], bounds=_HOW.wider, project=project)
        if not (coast.crosses(mesh, on_coast) & ~on_coast).any():
            break
    return on_coast


@dataclass(frozen=True, slots=True, eq=False)
class Coast:
    """The boundary between land and sea, as arcs between points of the sphere."""

    height: GlobePicture  # Above 0.5 on land
    # (M, 3): of arcs.
    starts: Points
    ends: Points
    before: Indices  # (M,): the arc that ends where an arc starts; itself if there is none
    tree: Any  # Of starts

    @classmethod
    def of(cls, land: ArrayLike, size: float) -> Coast:
        """Draw the coasts of a mask that cells of this size, in radians, can follow."""
        from scipy.spatial import cKDTree
        from skimage import measure

        mask = check_globe("land", check_picture_density("land", land))
        coarse = GlobePicture.padded(mask / mask.max()).coarsened(size / _HOW.pixels)
        height = GlobePicture.padded(_smoothed(coarse.picture, size))
        n_rows, n_columns = height.picture.shape
        find_contours: Any = measure.find_contours
        lines = find_contours(np.concatenate([height.picture, height.picture[:, :1]], axis=1), 0.5)
        places = [np.empty((0, 3))] + [
            from_degrees((line[:, 1] + 0.5) * 360 / n_columns - 180, 90 - (line[:, 0] + 0.5) * 180 / n_rows)
            for line in lines
        ]
        starts, ends = (np.concatenate([line[part] for line in places]) for part in (slice(-1), slice(1, None)))
        if not len(starts):
            return cls(height, starts, ends, np.empty(0, np.intp), None)
        gaps, before = cKDTree(ends).query(starts)  # of closed lines the first arc follows the last one
        return cls(height, starts, ends, np.where(gaps < ROUNDING, before, np.arange(len(starts))), cKDTree(starts))

    def is_land(self, points: Points) -> Bools:
        """Tell which of (N, 3) points are on land."""
        return self.height(points) > 0.5

    def nearest(self, points: Points) -> Points:
        """Return the nearest point of the coast to each of (N, 3) points."""
        if not len(points):
            return points
        arc = self.tree.query(points)[1]
        after, before = self._on_arcs(points, arc), self._on_arcs(points, self.before[arc])
        nearer = np.linalg.norm(after - points, axis=1) <= np.linalg.norm(before - points, axis=1)
        return np.where(nearer[:, None], after, before)

    def crosses(self, mesh: SphereTriangulation, on_coast: Bools) -> Bools:
        """Tell which cells (N,) have corners, or a generator that is not on the coast, on both sides."""
        corners = np.repeat(self.is_land(mesh.circumcenters()), 3)
        vertices, n = mesh.triangles.ravel(), len(mesh.points)
        n_land, n_corners = np.bincount(vertices, corners, n), np.bincount(vertices, minlength=n)
        on_land = self.is_land(mesh.points)
        n_land, n_corners = np.where(on_coast, (n_land, n_corners), (n_land + on_land, n_corners + 1))
        return (n_land > 0) & (n_land < n_corners)

    def claimed(self, points: Points, on_coast: Bools, size: float) -> Bools:
        """Tell which of those (N,) points go to the coast: of two that would meet there, the nearer one does."""
        from scipy.spatial import cKDTree

        which = np.flatnonzero(on_coast)
        places = self.nearest(points[which])
        far = np.linalg.norm(points[which] - places, axis=1)
        pairs = cKDTree(places).query_pairs(_HOW.together * size, output_type="ndarray")
        claimed = on_coast.copy()
        claimed[which[np.where(far[pairs[:, 0]] < far[pairs[:, 1]], pairs[:, 1], pairs[:, 0])]] = False
        return claimed

    def crowded(self, mesh: SphereTriangulation, on_coast: Bools, sizes: Floats) -> Bools:
        """Tell which points (N,) on the coast have too little of it, and no more than their neighbors have."""
        from scipy.spatial import cKDTree

        nearest = cKDTree(mesh.points).query(unit(self.starts + self.ends))[1]
        lengths = np.bincount(nearest, np.linalg.norm(self.ends - self.starts, axis=1), len(mesh.points))
        shares = np.where(on_coast, lengths / sizes, np.inf)
        least = shares.copy()
        for k in range(3):  # one end of each edge sees the other here, and in the triangle beyond the other way around
            np.minimum.at(least, mesh.triangles[:, k], shares[mesh.triangles[:, k - 1]])
        return (shares < _HOW.crowded) & (shares <= least)

    def _on_arcs(self, points: Points, arcs: Indices) -> Points:
        start, way = self.starts[arcs], self.ends[arcs] - self.starts[arcs]
        part = np.einsum("ij,ij->i", points - start, way) / np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
        return unit(start + np.clip(part, 0, 1)[:, None] * way)


def _smoothed(land: Array, size: float) -> Floats32:
    """Smooth an image of land by a length on the ground, and leave out islands and lakes that are too small."""
    from scipy.ndimage import gaussian_filter1d, label

    height, width = land.shape
    sigma = _HOW.smoothing * size * height / np.pi
    smooth = gaussian_filter1d(land.astype(np.float64), sigma, axis=0, mode="nearest")
    along = np.cos(np.pi * ((np.arange(height) + 0.5) / height - 0.5))
    for row in range(height):
        smooth[row] = gaussian_filter1d(smooth[row], min(sigma / along[row], width / 8), mode="wrap")
    areas = np.broadcast_to((along * 2 * np.pi**2 / (height * width))[:, None], smooth.shape)
    for is_land in (True, False):
        parts, n_parts = label((smooth > 0.5) == is_land)
        small = np.bincount(parts.ravel(), areas.ravel(), n_parts + 1) < _HOW.fewest_cells * size**2
        small[np.unique(parts[:, [0, -1]])] = False  # on the date line, beyond which they may go on
        small[0] = False
        away = small[parts]
        smooth[away] = 1 - smooth[away]  # as far from the height of the coast, 0.5, on the other side
    return smooth.astype(np.float32)
