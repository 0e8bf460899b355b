"""Weighted points in the layout that the kernels read, and the passes over them that every method is made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import SAMPLE_DTYPES, check_that
from cvtimg._shared.threads import in_parts
from cvtimg.engine import _kernels

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

#: Points are summed in at most this many parts, of at least this many tiles each. The parts depend only on the data,
#: so that sums have the same bits for any number of threads.
_MAX_PARTS = 32
_MIN_TILES = 256
#: Ruling out generators that cannot be nearest pays off from this number of generators on.
GROUPED_FROM = 40
#: Any center near the points will do: the mean of at most this many rows.
_CENTER_ROWS = 1 << 20
#: Energies below this fraction of the energy about the origin are rounding errors in float64.
_ROUNDING = 1e-24
#: Energies, sums of squares, of values this far from their mean are out of the range of float64.
_TOO_LARGE = 1e140
#: Energies below this fraction of the energy about the origin are summed point by point: half the digits of their
#: moments cancel.
SMALL_ENERGY = float(np.sqrt(np.finfo(np.float64).eps))


class Frame(NamedTuple):
    """An origin near the mean of the points, and a scale, so that float32 holds the digits that matter."""

    center: NDArray[np.float64]
    scale: float

    def inward(self, places: NDArray[Any]) -> NDArray[np.float64]:
        """Transform (n, D) places from the units of the samples to the frame."""
        return (places - self.center) * self.scale

    def outward(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform (n, D) places from the frame to the units of the samples."""
        return places / self.scale + self.center

    def energy(self, energy: float) -> float:
        """Convert an energy from the frame to squared units of the samples."""
        return float(energy) / self.scale / self.scale  # the square of a scale may be out of range


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Weighted points in their frame, packed in tiles for the kernels."""

    # Only this module and the kernels know the layout of the tiles; others use the methods here.

    tiles: NDArray[np.float32]  # (n_tiles, D, TILE): the points; the last one is repeated to fill the last tile
    boxes: NDArray[np.float32]  # (n_tiles, 2, D): smallest and largest coordinates in each tile
    density: NDArray[np.float64]  # (n_tiles * TILE,): weight of each point, 0 in the padding
    frame: Frame  # Where the origin of the tiles is
    n_points: int  # Number of points, padding not included
    in_order: bool  # Whether consecutive points are near each other
    energy_about_origin: float  # Sum of density times squared distance to the origin of the frame

    @property
    def n_dims(self) -> int:
        """Number of coordinates, D."""
        return int(self.tiles.shape[1])

    def rows(self, members: NDArray[np.intp] | list[int] | slice = slice(None)) -> NDArray[np.float64]:
        """Return the (m, D) places of some points in the frame, all by default."""
        index = np.arange(self.n_points)[members]
        return self.tiles[index // _kernels.TILE, :, index % _kernels.TILE].astype(np.float64)

    def coordinate(self, dim: int) -> NDArray[np.float32]:
        """Return one coordinate of all points, padding included, in the order of `density`."""
        return self.tiles[:, dim].reshape(-1)

    def take(self, members: NDArray[np.intp], density: NDArray[np.float64]) -> Points:
        """Return some of the points, by their (m,) indices in ascending order, with (m,) new weights."""
        index = np.pad(members, (0, -len(members) % _kernels.TILE), "edge")
        rows = self.tiles[index // _kernels.TILE, :, index % _kernels.TILE]
        tiles = np.ascontiguousarray(rows.reshape(-1, _kernels.TILE, self.n_dims).swapaxes(1, 2))
        padded = np.pad(density, (0, len(index) - len(members)))
        return _points(tiles, padded, self.frame, len(members), self.in_order)


def pack(
    rows: NDArray[Any],
    density: NDArray[np.float64],
    *,
    center: NDArray[np.float64] | None = None,
    frame: Frame | None = None,
    in_order: bool = False,
    order: NDArray[np.intp] | None = None,
) -> Points:
    """Pack (N, D) rows and their weights, in a frame about their mean or another center, or in a given one."""
    # With an order, in which near ones follow each other, they are packed in that.
    # Rows are copied only here.
    middle = _mean(rows, density) if center is None and frame is None else center
    if rows.dtype not in SAMPLE_DTYPES:  # other integers
        rows = rows.astype(np.float64)
    if middle is not None:
        frame = Frame(middle, scale_within(*limits(rows), middle) if rows.dtype.kind == "f" else 1.0)
    assert frame is not None
    n_points, n_dims = rows.shape
    n_tiles = -(-n_points // _kernels.TILE)
    tiles = np.empty((n_tiles, n_dims, _kernels.TILE), np.float32)
    padded = np.zeros(n_tiles * _kernels.TILE)

    def pack_part(start: int, stop: int) -> None:
        ends = slice(start * _kernels.TILE, min(stop * _kernels.TILE, n_points))
        if order is None:
            own, padded[ends] = rows[ends], density[ends]
        else:
            own, padded[ends] = rows[order[ends]], density[order[ends]]
        _kernels.pack_tiles(own, frame.center, frame.scale, tiles[start:stop])

    in_parts(pack_part, n_tiles, work=4 * rows.size)
    return _points(tiles, padded, frame, n_points, in_order or order is not None)


def limits(rows: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the (D,) least and greatest coordinates of (N, D) rows."""
    # Long rows are compared ten times faster than short ones.
    n_dims, n_long = rows.shape[1], len(rows) // _kernels.TILE
    long, rest = rows[: n_long * _kernels.TILE].reshape(n_long, n_dims * _kernels.TILE), rows[n_long * _kernels.TILE :]
    low, high = [rest], [rest]

    def compare(start: int, stop: int) -> None:
        low.append(long[start:stop].min(axis=0).reshape(-1, n_dims))
        high.append(long[start:stop].max(axis=0).reshape(-1, n_dims))

    if n_long:
        in_parts(compare, n_long, work=2 * rows.size)
    return np.concatenate(low).min(axis=0), np.concatenate(high).max(axis=0)


def _mean(rows: NDArray[Any], density: NDArray[np.float64]) -> NDArray[np.float64]:
    some, weights = rows[:_CENTER_ROWS], density[:_CENTER_ROWS]
    if not weights.any():
        center: NDArray[np.float64] = some.mean(axis=0, dtype=np.float64)
    else:
        center = np.einsum("n,nd->d", weights, some) / weights.sum()
    # Whole, so that float32 holds integers, and products of 8-bit colors, exactly.
    return np.rint(center) if rows.dtype.kind == "u" else center


def scale_within(low: NDArray[Any], high: NDArray[Any], center: NDArray[np.float64]) -> float:
    """Return the scale for places between these (D,) limits."""
    return scale_for_float32(max(float(np.max(high - center)), float(np.max(center - low))))


def scale_for_float32(size: float) -> float:
    """Return a power of two, usually 1, that brings places of this size to one whose squares float32 holds."""
    check_that(f"values up to {size:.3g} from their mean", size < _TOO_LARGE, f"be within {_TOO_LARGE:g} of it")
    return 1.0 if size == 0 or 1e-6 < size < 1e6 else float(2.0 ** -np.round(np.log2(size)))


def _points(
    tiles: NDArray[np.float32], density: NDArray[np.float64], frame: Frame, n_points: int, in_order: bool
) -> Points:
    boxes = np.empty((len(tiles), 2, tiles.shape[1]), np.float32)
    parts = _fixed_parts(tiles)
    energies = np.empty(len(parts))

    def finish(start: int, stop: int) -> None:
        for n, (part, ends) in enumerate(parts[start:stop], start):
            tiles[part].min(axis=2, out=boxes[part, 0])
            tiles[part].max(axis=2, out=boxes[part, 1])
            squares = np.einsum("tdi,tdi->ti", tiles[part], tiles[part], dtype=np.float64).reshape(-1)
            energies[n] = np.einsum("n,n->", density[ends], squares)

    in_parts(finish, len(parts), work=4 * tiles.size)
    return Points(tiles, boxes, density, frame, n_points, in_order, sum(energies.tolist()))


def coarsen(points: Points, factor: int) -> Points:
    """Replace every `factor` consecutive points by their center of mass; `factor` divides the size of a tile."""
    # Where consecutive points are near each other, generators that suit the fewer points nearly suit all.
    n_tiles, n_dims, width = points.tiles.shape
    n_merged = -(-n_tiles // factor)
    merged, masses = np.empty((n_merged, n_dims, width), np.float32), np.empty((n_merged, width))

    def merge(start: int, stop: int) -> None:
        # Every `factor` tiles become one tile; the last one may lack some.
        tiles = points.tiles[start * factor : stop * factor]
        density = points.density[start * factor * width : stop * factor * width]
        n_missing = (stop - start) * factor - len(tiles)
        if n_missing:
            tiles = np.concatenate([tiles, np.repeat(tiles[-1:], n_missing, axis=0)])
            density = np.concatenate([density, np.zeros(n_missing * width)])
        groups, weights = (
            tiles.reshape(-1, n_dims, width // factor, factor),
            density.reshape(-1, width // factor, factor),
        )
        own = weights.sum(axis=2)
        sums = np.einsum("tdgi,tgi->tdg", groups, weights)
        means = np.divide(sums, own[:, None], out=groups[..., 0].astype(np.float64), where=own[:, None] > 0)
        merged[start:stop] = (
            means.reshape(-1, factor, n_dims, width // factor).swapaxes(1, 2).reshape(-1, n_dims, width)
        )
        masses[start:stop] = own.reshape(-1, width)

    in_parts(merge, n_merged, work=8 * points.tiles.size)
    return _points(merged, masses.reshape(-1), points.frame, masses.size, in_order=True)


def thin(points: Points, factor: int, rng: np.random.Generator) -> Points:
    """Draw one point in `factor`."""
    drawn = np.sort(rng.choice(points.n_points, points.n_points // factor, replace=False))
    return points.take(drawn, points.density[drawn])


def in_main_subspace(points: Points, n_dims: int) -> tuple[Points, NDArray[np.float32]]:
    """Project points onto the subspace where they vary most, nearly; also return its (n_dims, D) orthonormal axes."""
    # Two passes of a randomized range finder: N. Halko, P.-G. Martinsson, J. A. Tropp, SIAM Review 53 (2011) 217-288,
    # doi 10.1137/090771806.
    # One thread, because the bits of a product of matrices depend on the number of threads of the BLAS.
    with _blas().limit(limits=1, user_api="blas"):
        axes = np.random.default_rng(0).standard_normal((n_dims, points.n_dims), np.float32)
        weighted = np.matmul(axes, points.tiles) * points.density.reshape(-1, 1, _kernels.TILE).astype(np.float32)
        sums = np.zeros((n_dims, points.n_dims))
        for tile, along in zip(points.tiles, weighted, strict=True):
            sums += along @ tile.T
        axes = np.ascontiguousarray(np.linalg.qr(sums.T)[0].T, np.float32)
        tiles = np.matmul(axes, points.tiles)
    frame = Frame(np.zeros(n_dims), points.frame.scale)
    return _points(tiles, points.density, frame, points.n_points, points.in_order), axes


@cache
def _blas() -> ThreadpoolController:
    """Return the BLAS that NumPy has loaded; looking for it takes some milliseconds."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def assign(points: Points, generators: NDArray[np.float64]) -> NDArray[np.int32]:
    """Label each point, padding included, with its nearest generator; the first one on a tie."""
    # The nearest generator z of a point y has the least ``|z|^2 / 2 - y . z``.
    single, half_norms = _for_kernels(generators)
    labels = np.empty(len(points.density), np.int32)
    columns = np.full((points.n_dims, -(-len(single) // _kernels.TILE) * _kernels.TILE), 1e18, np.float32)
    columns[:, : len(single)] = single.T
    grouped = points.n_dims <= _kernels.MAX_GROUPED_DIMS and len(single) >= GROUPED_FROM

    def assign_part(start: int, stop: int) -> None:
        part, ends = slice(start, stop), slice(start * _kernels.TILE, stop * _kernels.TILE)
        if grouped:
            _kernels.assign_grouped(points.tiles[part], points.boxes[part], columns, single, half_norms, labels[ends])
        else:
            _kernels.assign(points.tiles[part], single, half_norms, labels[ends])

    # With many generators only some dozens are compared with each point, after a look at all for each few tiles.
    n_compared = GROUPED_FROM + len(single) // 16 if grouped else len(single)
    in_parts(assign_part, len(points.tiles), work=points.tiles.size / 8 * n_compared)
    return labels


def assign_next(
    points: Points, generators: NDArray[np.float64], labels: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the nearest generator of each point but for its own, and how much farther that is, in squared distance."""
    seconds, gaps = np.empty(len(labels), np.int32), np.empty(len(labels), np.float32)
    single, half_norms = _for_kernels(generators)

    def assign_part(start: int, stop: int) -> None:
        ends = slice(start * _kernels.TILE, stop * _kernels.TILE)
        _kernels.assign_next(points.tiles[start:stop], single, half_norms, labels[ends], seconds[ends], gaps[ends])

    in_parts(assign_part, len(points.tiles), work=points.tiles.size / 8 * len(single))
    return seconds, gaps


def cell_moments(
    points: Points, labels: NDArray[np.int32], n_cells: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the (K,) mass of each cell and the (K, D) sum of density times point."""
    slices = _fixed_parts(points.tiles)
    parts = np.zeros((len(slices), n_cells, points.n_dims + 1))

    def accumulate(start: int, stop: int) -> None:
        for (tiles, ends), part in zip(slices[start:stop], parts[start:stop], strict=True):
            _kernels.accumulate(points.tiles[tiles], points.density[ends], labels[ends], part)

    in_parts(accumulate, len(parts), work=3 * points.tiles.size)
    total = parts.sum(axis=0)
    return total[:, -1].copy(), total[:, :-1].copy()


def energy(
    about_origin: float, generators: NDArray[np.float64], masses: NDArray[np.float64], sums: NDArray[np.float64]
) -> float:
    """Return the sum of density times squared distance to the own generator, from the moments of the cells."""
    # `about_origin` is that to the origin. Below the fraction `SMALL_ENERGY` of it the moments cancel.
    cross = np.einsum("kd,kd->", generators, sums)
    norms = np.einsum("k,kd,kd->", masses, generators, generators)
    return float(max(about_origin - 2 * cross + norms, 0.0))


def cell_energies(points: Points, generators: NDArray[np.float64], labels: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the (K,) energy of each cell, summed point by point: accurate where `energy` cancels."""
    parts = _fixed_parts(points.tiles)
    sums = np.empty((len(parts), len(generators)))

    def add(start: int, stop: int) -> None:
        for n, (tiles, ends) in enumerate(parts[start:stop], start):
            distances = np.empty(ends.stop - ends.start)
            _kernels.distances_to_own(points.tiles[tiles], generators, labels[ends], distances)
            sums[n] = np.bincount(labels[ends], points.density[ends] * distances, len(generators))

    in_parts(add, len(parts), work=3 * points.tiles.size)
    energies = sums.sum(axis=0)
    # Distinct points are farther apart than this: the rest is the rounding of means.
    return np.where(energies > _ROUNDING * points.energy_about_origin, energies, 0.0)


def _for_kernels(generators: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Convert generators to float32, and compute half their squared norms."""
    single = np.ascontiguousarray(generators, dtype=np.float32)
    return single, (0.5 * np.einsum("kd,kd->k", single, single, dtype=np.float64)).astype(np.float32)


def _fixed_parts(tiles: NDArray[np.float32]) -> list[tuple[slice, slice]]:
    """Return the tiles, and the points, of each part that is summed by itself."""
    n_parts = min(max(len(tiles) // _MIN_TILES, 1), _MAX_PARTS)
    bounds = [len(tiles) * part // n_parts for part in range(n_parts + 1)]
    return [(slice(*ends), slice(ends[0] * _kernels.TILE, ends[1] * _kernels.TILE)) for ends in pairwise(bounds)]
