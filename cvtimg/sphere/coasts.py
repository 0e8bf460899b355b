"""Grids whose points follow coasts: no triangle has corners on both sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_at_least, check_choice, check_picture_density, check_that
from cvtimg._shared.choices import EffortName
from cvtimg._shared.iteration import Callback, Watch
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
from cvtimg.sphere.triangulation import Points, SphereTriangulation, SumCells, WeightedCells, uniform_cells, unit

#: Coasts are smoothed by this part of the size of a cell; islands and lakes smaller than so many cells are left out.
_SMOOTHING, _FEWEST_CELLS = 1.0, 6.0
#: Pixels for each cell that coasts are drawn with.
_PIXELS = 3.0
#: Islands that are left out, and lakes, are so far from the height of the coast, 0.5.
_FLAT = 0.02
#: Two points meet on a coast where they would be nearer than this part of a cell.
_TOGETHER = 0.05
#: How far a crowded point moves off the coast, in cell sizes.
_ASIDE = 1.1
#: A point is crowded if its cell holds less of the coast than this share of the size, and than its neighbors' cells.
_CROWDED = 0.8
#: Crowded points move every so many moves, in the first part of all moves.
_EVERY, _FIRST_PART = 10, 0.7
#: Rounds of polishing; each adds the points that have come to the coast, and makes this many moves.
_ROUNDS, _MOVES = 20, 50
#: Then it goes on for the angles that are out of these bounds, in degrees: where coasts turn, few are near to 60.
_WIDER, _LAST_MOVES = (35.0, 89.0), 200


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

    on_coast: NDArray[np.bool_]
    on_land: NDArray[np.bool_]

    def _flags(self) -> dict[str, NDArray[np.int32]]:
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
        Coasts are smoothed to what cells can follow.
    density, effort, rng, callback
        As in `cvtimg.sphere_grid`.

    Returns
    -------
    CoastalGrid

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or the globe has no coast that cells can follow.

    See Also
    --------
    cvtimg.sphere_grid, nested_grid

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.sphere import coastal_grid
    >>> lat = np.linspace(89, -89, 90)[:, None]
    >>> grid = coastal_grid(642, np.broadcast_to(lat > 20, (90, 180)))
    >>> np.unique(grid.lat[grid.on_coast].round()).tolist()
    [20.0]
    """
    check_at_least("n", n, 4, "the corners of a tetrahedron")
    settings = EFFORTS[check_choice("effort", effort, EFFORTS)]
    weight = as_sphere_density(density)
    start = sphere_grid(n, density=density, effort="fast", polish=False, rng=rng)
    sums: SumCells = uniform_cells if weight is None else WeightedCells(Scaled(weight).for_cells(n))
    mesh = SphereTriangulation(start.points, start.triangles)
    coast = Coast.of(land, float(np.sqrt(start.areas.min())))
    watch = Watch(callback)
    on_coast = np.zeros(n, bool)
    for move in range(settings.moves):
        cells = sums(mesh)
        if watch(cells.energy):
            break
        there = unit(mesh.points + cells.pulls / cells.masses[:, None])
        on_coast = coast.claimed(there, coast.crosses(mesh, on_coast), float(np.sqrt(cells.areas.min())))
        centers, there[on_coast] = there[on_coast], coast.nearest(there[on_coast])
        if move % _EVERY == _EVERY - 1 and move < _FIRST_PART * settings.moves:
            # Where two rows of points come to the same coast, one of them must leave it.
            sizes = np.sqrt(cells.areas)
            aside = coast.crowded(mesh, on_coast, sizes)
            ways = (centers - there[on_coast])[aside[on_coast]]
            lengths = np.maximum(np.sqrt(np.einsum("ij,ij->i", ways, ways)), 1e-300)
            there[aside] = unit(there[aside] + (_ASIDE * sizes[aside] / lengths)[:, None] * ways)
            on_coast &= ~aside
        mesh.replace(there)
    on_coast = _settled(mesh, coast, on_coast, np.sqrt(sums(mesh).areas))
    grid = as_grid(mesh, sums, ~on_coast)
    names = ("points", "triangles", "areas", "density", "energy", "offset")
    values = {name: getattr(grid, name) for name in names}
    on_land = coast.is_land(mesh.points) & ~on_coast
    return CoastalGrid(**values, fixed=np.zeros(n, bool), on_coast=on_coast, on_land=on_land)


def _settled(
    mesh: SphereTriangulation, coast: Coast, on_coast: NDArray[np.bool_], sizes: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Polish angles while points on the coast move along it; return which are there in the end."""

    def project(there: Points, _: Points) -> Points:
        there[on_coast] = coast.nearest(there[on_coast])
        return there

    for _ in range(_ROUNDS):
        added = coast.crosses(mesh, on_coast) & ~on_coast
        on_coast = coast.claimed(mesh.points, on_coast | added, float(sizes.min()))
        mesh.replace(project(mesh.points.copy(), mesh.points))
        polish_angles(mesh, sizes, _MOVES, project=project)
        polish_angles(mesh, sizes, _LAST_MOVES, bounds=_WIDER, project=project)
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
    before: NDArray[np.intp]  # (M,): the arc that ends where an arc starts; itself if there is none
    tree: Any  # Of starts

    @classmethod
    def of(cls, land: ArrayLike, size: float) -> Coast:
        """Draw the coasts of a mask that cells of this size, in radians, can follow."""
        from scipy.spatial import cKDTree
        from skimage import measure

        mask = check_globe("land", check_picture_density("land", land))
        coarse = GlobePicture.padded(mask / mask.max()).coarsened(size / _PIXELS)
        height = GlobePicture.padded(_smoothed(coarse.picture, size))
        n_rows, n_columns = height.picture.shape
        starts, ends, before = [], [], []
        find_contours: Any = measure.find_contours
        lines = find_contours(np.concatenate([height.picture, height.picture[:, :1]], axis=1), 0.5)
        check_that("land", len(lines) > 0, "have a coast that cells can follow")
        n_arcs = 0
        for line in lines:
            places = from_degrees((line[:, 1] + 0.5) * 360 / n_columns - 180, 90 - (line[:, 0] + 0.5) * 180 / n_rows)
            starts.append(places[:-1])
            ends.append(places[1:])
            numbers = n_arcs + np.arange(-1, len(line) - 2)
            numbers[0] = n_arcs + len(line) - 2 if (line[0] == line[-1]).all() else n_arcs
            before.append(numbers)
            n_arcs += len(line) - 1
        first = np.concatenate(starts)
        return cls(height, first, np.concatenate(ends), np.concatenate(before), cKDTree(first))

    def is_land(self, points: Points) -> NDArray[np.bool_]:
        """Tell which of (N, 3) points are on land."""
        return self.height(points) > 0.5

    def nearest(self, points: Points) -> Points:
        """Return the nearest point of the coast to each of (N, 3) points."""
        if not len(points):
            return points
        arc = self.tree.query(points)[1]
        one, other = self._on_arcs(points, arc), self._on_arcs(points, self.before[arc])
        nearer = np.linalg.norm(one - points, axis=1) <= np.linalg.norm(other - points, axis=1)
        return np.where(nearer[:, None], one, other)

    def crosses(self, mesh: SphereTriangulation, on_coast: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Tell which cells (N,) have corners, or a generator that is not on the coast, on both sides."""
        corners = np.repeat(self.is_land(mesh.circumcenters()), 3)
        vertices, n = mesh.triangles.ravel(), len(mesh.points)
        n_land, n_corners = np.bincount(vertices, corners, n), np.bincount(vertices, minlength=n)
        own = self.is_land(mesh.points)
        n_land, n_corners = np.where(on_coast, (n_land, n_corners), (n_land + own, n_corners + 1))
        return (n_land > 0) & (n_land < n_corners)

    def claimed(self, points: Points, on_coast: NDArray[np.bool_], size: float) -> NDArray[np.bool_]:
        """Tell which of those (N,) points go to the coast: of two that would meet there, the nearer one does."""
        from scipy.spatial import cKDTree

        which = np.flatnonzero(on_coast)
        places = self.nearest(points[which])
        far = np.linalg.norm(points[which] - places, axis=1)
        pairs = cKDTree(places).query_pairs(_TOGETHER * size, output_type="ndarray")
        claimed = on_coast.copy()
        claimed[which[np.where(far[pairs[:, 0]] < far[pairs[:, 1]], pairs[:, 1], pairs[:, 0])]] = False
        return claimed

    def crowded(
        self, mesh: SphereTriangulation, on_coast: NDArray[np.bool_], sizes: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Tell which points (N,) on the coast have too little of it, and no more than their neighbors have."""
        from scipy.spatial import cKDTree

        nearest = cKDTree(mesh.points).query(unit(self.starts + self.ends))[1]
        lengths = np.bincount(nearest, np.linalg.norm(self.ends - self.starts, axis=1), len(mesh.points))
        shares = np.where(on_coast, lengths / sizes, np.inf)
        least = shares.copy()
        for k in range(3):  # one end of each edge sees the other here, and in the triangle beyond the other way around
            np.minimum.at(least, mesh.triangles[:, k], shares[mesh.triangles[:, k - 1]])
        return (shares < _CROWDED) & (shares <= least)

    def _on_arcs(self, points: Points, arcs: NDArray[np.intp]) -> Points:
        start, way = self.starts[arcs], self.ends[arcs] - self.starts[arcs]
        part = np.einsum("ij,ij->i", points - start, way) / np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
        return unit(start + np.clip(part, 0, 1)[:, None] * way)


def _smoothed(land: NDArray[Any], size: float) -> NDArray[np.float32]:
    """Smooth an image of land by a length on the ground, and leave out islands and lakes that are too small."""
    from scipy.ndimage import gaussian_filter1d, label

    height, width = land.shape
    sigma = _SMOOTHING * size * height / np.pi
    smooth = gaussian_filter1d(land.astype(np.float64), sigma, axis=0, mode="nearest")
    along = np.cos(np.pi * ((np.arange(height) + 0.5) / height - 0.5))
    for row in range(height):
        smooth[row] = gaussian_filter1d(smooth[row], min(sigma / along[row], width / 8), mode="wrap")
    areas = np.broadcast_to((along * 2 * np.pi**2 / (height * width))[:, None], smooth.shape)
    for is_land in (True, False):
        parts, n_parts = label((smooth > 0.5) == is_land)
        small = np.bincount(parts.ravel(), areas.ravel(), n_parts + 1) < _FEWEST_CELLS * size**2
        small[np.unique(parts[:, [0, -1]])] = False  # on the date line, beyond which they may go on
        small[0] = False
        smooth[small[parts]] = 0.5 - _FLAT if is_land else 0.5 + _FLAT
    return smooth.astype(np.float32)
