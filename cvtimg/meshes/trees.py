"""Size fields from functions, on a quadtree whose cells are as small as the sizes there ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from cvtimg._shared.budgets import ENOUGH_SAMPLES, MOST_IN_MEMORY
from cvtimg._shared.checks import check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Bools, Floats, Ints, Points
from cvtimg.engine.samples import along_curve
from cvtimg.halfedges import HalfEdges
from cvtimg.meshes.fields import PER_AREA, Field, metric_of
from cvtimg.meshes.outlines import Outline, StraightParts
from cvtimg.meshes.triangulation import PlaneTriangulation, delaunay

Sizes = Callable[[Points], Floats]

#: A cell is divided while its side is longer than this part of the least size at its corners and its center,
_SIDE = 0.7
#: from this level on, 2^6 cells along each axis, and to that one, where sides are 2^-24 of those of the region.
_FIRST_LEVEL, LAST_LEVEL = 6, 24
#: Cells at most, each of which takes the memory of eight vertices.
_MOST_CELLS = MOST_IN_MEMORY // 8


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Squares that cover a region."""

    centers: Points  # (C, 2)
    sides: Floats  # (C,)
    inside: Bools  # (C,): whether the center is in the region
    corners: Points  # (N, 2): the corners of squares twice as wide, each once
    contains: Callable[[Points], Bools]  # whether points (M, 2) are in the region

    def divided(self, sizes: Sizes) -> Cells:
        """Divide cells until they are as small as sizes at their centers ask for, which may be lower than at first.

        Where a level has enough cells for the mass, none is divided.
        """
        done, centers, sides = [], self.centers, self.sides
        quarters = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) / 4
        while len(centers):
            is_large = (sides > _SIDE * sizes(centers)) & (len(centers) < 2 * ENOUGH_SAMPLES)
            done.append((centers[~is_large], sides[~is_large]))
            centers, sides = centers[is_large], sides[is_large]
            centers = (centers[:, None] + sides[:, None, None] * quarters).reshape(-1, 2)
            sides = np.repeat(sides / 2, 4)
        if len(done) == 1:
            return self
        centers, sides = (np.concatenate(each) for each in zip(*done, strict=True))
        return replace(self, centers=centers, sides=sides, inside=self.contains(centers))

    def masses(self, density: Callable[[Points], Floats]) -> Floats:
        """Return the mass (C,) of each cell under a density at points (M, 2): 0 outside of the region."""
        masses = np.zeros(len(self.sides))
        masses[self.inside] = self.sides[self.inside] ** 2 * density(self.centers[self.inside])
        return masses

    def seeds(self, masses: Floats, n: int, rng: np.random.Generator) -> Points:
        """Draw (n, 2) points along a Morton curve, as many in each cell as its share of the mass."""
        order = along_curve(self.centers)
        ends = np.cumsum(masses[order])
        cell = order[np.minimum(np.searchsorted(ends, (np.arange(n) + 0.5) / n * ends[-1]), len(order) - 1)]
        return self.centers[cell] + (rng.random((n, 2)) - 0.5) * self.sides[cell, None]


class CellField(Field):
    """Sizes or metrics with squares as fine as they ask for."""

    cells: Cells

    @property
    def count(self) -> float:
        return PER_AREA * float(self._masses()[1].sum())

    def seeds(self, n: int, rng: np.random.Generator) -> Points:
        cells, masses = self._masses()
        return cells.seeds(masses, n, rng)

    def _masses(self) -> tuple[Cells, Floats]:
        """Return squares, and how many edges long and wide each is, multiplied: 0 outside of the region."""
        raise NotImplementedError


@dataclass(slots=True, eq=False)
class TreeField(CellField):
    """Sizes at the corners of a quadtree, interpolated on a triangulation of them."""

    cells: Cells
    mesh: PlaneTriangulation  # Of the corners, and of more points where sizes were lowered
    sizes: Floats  # (N,)
    _near: Ints = field(default_factory=lambda: np.empty(0, np.int32))

    @classmethod
    def of(cls, sizes: Sizes, outline: Outline, probes: Points) -> TreeField:
        """Sample sizes; at the probes they may be lower than all around."""
        cells = divide(sizes, outline, probes)
        points = np.concatenate([cells.corners, probes])
        values = np.concatenate([sizes(cells.corners), sizes(probes)])
        return cls(cells, *_triangulated(points, values))

    def metric(self, points: Points) -> Points:
        return metric_of(self._at(points))

    def scaled(self, factor: float) -> TreeField:
        return replace(self, sizes=self.sizes * factor)

    def limited(self, grade: float, least: float) -> TreeField:
        sizes = np.maximum(self.sizes, least)
        return replace(self, sizes=limited_along_edges(self.mesh, sizes, grade))

    def lowered(self, points: Points, sizes: Floats, grade: float) -> TreeField:
        low = sizes < self._at(points)
        if not low.any():
            return self
        all_points = np.concatenate([self.mesh.points, points[low]])
        mesh, values = _triangulated(all_points, np.concatenate([self.sizes, sizes[low]]))
        return replace(self, mesh=mesh, sizes=values, _near=np.empty(0, np.int32)).limited(grade, 0)

    def _masses(self) -> tuple[Cells, Floats]:
        cells = self.cells.divided(self._at)
        return cells, cells.masses(lambda points: self._at(points) ** -2.0)

    def _at(self, points: Points) -> Floats:
        triangles, shares = self.mesh.locate(points, self._near if len(self._near) == len(points) else None)
        corners, shares = self.mesh.triangles[triangles], np.maximum(shares, 0)
        self._near = corners[:, 0]  # for the next time, when they have moved
        total: Floats = np.einsum("pk,pk->p", self.sizes[corners], shares)
        return total / np.einsum("pk->p", shares)


def limited_along_edges(mesh: HalfEdges, sizes: Floats, grade: float) -> Floats:
    """Return sizes (N,) lowered until they grow by no more than `grade` for each unit of length along edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    # The least sum of a size and of the growth from there is the shortest way from a place beside the mesh.
    n, (a, b) = len(sizes), mesh.edges[mesh.twins.ravel() < np.arange(mesh.twins.size)].T
    growths = grade * np.linalg.norm(mesh.points[a] - mesh.points[b], axis=1)
    ways = np.concatenate([growths, growths, sizes])
    ends = np.concatenate([a, b, np.full(n, n)]), np.concatenate([b, a, np.arange(n)])
    return np.asarray(dijkstra(coo_array((ways, ends), (n + 1, n + 1)).tocsr(), indices=n)[:n])


def divide(sizes: Sizes, outline: Outline, probes: Points) -> Cells:
    """Divide a square around an outline into cells, smaller than the sizes there if they touch the inside."""
    low, high = outline.bounds
    # Where sizes are the same everywhere, the smallest cells are as large as may be.
    wanted = _SIDE * sizes(probes)
    side = float((high - low).max()) * 1.02
    side *= 2 ** (np.log2(wanted.min() / side) % 1) * (1 - 1e-9)
    origin = (low + high) / 2 - side / 2
    grid, corners_of = np.arange(1 << _FIRST_LEVEL), np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    seen_at = np.append(corners_of, [[0.5, 0.5]], axis=0)
    cells = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2).astype(np.int64)
    is_whole, lines = np.zeros(len(cells), bool), StraightParts.of(outline.lines).tree
    done, n_cells = [], 0
    for level in range(_FIRST_LEVEL, LAST_LEVEL + 1):
        step = side / (1 << level)
        around = (origin + cells * step)[:, None] + step * seen_at
        limit = sizes(around.reshape(-1, 2)).reshape(-1, len(seen_at)).min(axis=1) * _SIDE
        fine = ((probes[wanted < step] - origin) / step).astype(np.int64)
        small = limit < step
        # Cells that do not touch the inside stay as they are.
        unknown = np.flatnonzero(small & ~is_whole)
        if len(unknown):
            x, y = (origin + cells[unknown] * step).T
            crossed = np.zeros(len(unknown), bool)
            crossed[lines.query(shapely.box(x, y, x + step, y + step), predicate="intersects")[0]] = True
            inside = outline.contains(origin + (cells[unknown] + 0.5) * step)
            small[unknown], is_whole[unknown] = crossed | inside, inside & ~crossed
        divided = small | np.isin(cells @ np.array([1 << 32, 1]), fine @ np.array([1 << 32, 1]))
        divided &= level < LAST_LEVEL
        done.append((level, cells[~divided]))
        cells = (2 * cells[divided, None] + corners_of).reshape(-1, 2)
        is_whole = np.repeat(is_whole[divided], 4)
        n_cells += len(cells)
        check_that(f"sizes down to {limit.min() / _SIDE:g}", n_cells <= _MOST_CELLS, f"suit a region {side:g} wide")
        if not len(cells):
            break
    sides = np.concatenate([np.full(len(squares), side / (1 << level)) for level, squares in done])
    corners = np.concatenate([squares << (LAST_LEVEL - level) for level, squares in done])
    # Sizes hardly change over a cell: the corners of squares twice as wide will do.
    spans = np.concatenate([np.full((len(squares), 1), 2 << (LAST_LEVEL - level)) for level, squares in done])
    steps = spans[:, None] * corners_of
    keys = np.unique(((corners - corners % spans)[:, None] + steps).reshape(-1, 2) @ np.array([1 << 32, 1]))
    unique = np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1)
    unit = side / (1 << LAST_LEVEL)
    centers = origin + corners * unit + sides[:, None] / 2
    return Cells(centers, sides, outline.contains(centers), origin + unique * unit, outline.contains)


def _triangulated(points: Points, values: Floats) -> tuple[PlaneTriangulation, Floats]:
    """Triangulate points, of those at one place the one with the least value."""
    order = np.lexsort((values, points[:, 1], points[:, 0]))
    first = order[np.append(True, (np.diff(points[order], axis=0) != 0).any(axis=1))]
    return PlaneTriangulation(points[first], delaunay(points[first])), values[first]
