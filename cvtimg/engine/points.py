"""Weighted points as the kernels read them, and the three passes over them that every method is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.engine import _kernels

#: Points are summed in this many parts at most, each of this many tiles at least. The parts depend on the data
#: alone: the sums have the same bits whatever the number of threads.
_MAX_PARTS = 32
_MIN_TILES = 256
#: Finding which generators can be nearest pays from this number of generators.
_GROUPED_FROM = 40
#: Any center near the points serves: their mean over so many rows.
_CENTER_ROWS = 1 << 20
_TILES_AT_ONCE = 1 << 12


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The center, about the mean of the points, and the scale that let float32 hold what matters."""

    center: NDArray[np.float64]
    scale: float

    def inward(self, places: NDArray[Any]) -> NDArray[np.float64]:
        """(n, D) places in the units of the samples, as places in the frame."""
        inside: NDArray[np.float64] = (places - self.center) * self.scale
        return inside

    def outward(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, D) places in the frame, as places in the units of the samples."""
        return places / self.scale + self.center

    def energy(self, energy: float) -> float:
        """Return an energy in the frame in the squared units of the samples."""
        return float(energy) / self.scale**2


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Weighted points, packed in tiles for the kernels and centered.

    Attributes
    ----------
    tiles : (n_tiles, D, TILE) float32 array
        Points in the frame, the last one repeated to fill the last tile.
    boxes : (n_tiles, 2, D) float32 array
        Least and greatest coordinates in each tile.
    density : (n_tiles * TILE,) float64 array
        Weight of each point, 0 in the padding.
    frame : Frame
        Where the origin of the tiles is.
    n_points : int
        Points without the padding.
    in_order : bool
        Whether points that follow each other are near each other.
    spread : float
        Sum of density times squared distance to the origin of the frame.
    """

    tiles: NDArray[np.float32]
    boxes: NDArray[np.float32]
    density: NDArray[np.float64]
    frame: Frame
    n_points: int
    in_order: bool
    spread: float

    @property
    def n_dims(self) -> int:
        """Number of coordinates, D."""
        return int(self.tiles.shape[1])

    def rows(self, members: NDArray[np.intp] | slice = slice(None)) -> NDArray[np.float64]:
        """(m, D) places of some points in the frame."""
        index = np.arange(self.n_points)[members]
        return self.tiles[index // _kernels.TILE, :, index % _kernels.TILE].astype(np.float64)


def pack(
    rows: NDArray[Any],
    density: NDArray[np.float64],
    *,
    center: NDArray[np.float64] | None = None,
    in_order: bool = False,
) -> Points:
    """Pack (N, D) rows and their weights; the rows are copied once, here. The center is their mean by default."""
    if center is None:
        some, weights = rows[:_CENTER_ROWS], density[:_CENTER_ROWS]
        center = (
            np.einsum("n,nd->d", weights, some) / weights.sum()
            if weights.any()
            else some.mean(axis=0, dtype=np.float64)
        )
        if rows.dtype.kind == "u":
            center = np.rint(center)  # so that float32 holds integers, and products of 8-bit colors, exactly
    scale = _scale(rows, center) if rows.dtype.kind == "f" else 1.0
    tiles, padded = _tiles(rows, density, center, scale)
    return _points(tiles, padded, Frame(center, scale), len(rows), in_order)


def _scale(rows: NDArray[Any], center: NDArray[np.float64]) -> float:
    """Return a power of two that brings points to a size whose squares float32 holds, mostly 1."""
    size = max(float(np.max(rows.max(axis=0) - center)), float(np.max(center - rows.min(axis=0))))
    return 1.0 if size == 0 or 1e-6 < size < 1e6 else float(2.0 ** -np.round(np.log2(size)))


def _tiles(
    rows: NDArray[Any], density: NDArray[np.float64], offset: NDArray[np.float64], scale: float
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Tiles of rows less an offset, scaled, and their density with 0 in the padding."""
    n_points, n_dims = rows.shape
    n_tiles = -(-n_points // _kernels.TILE)
    tiles = np.empty((n_tiles, n_dims, _kernels.TILE), np.float32)

    def pack_part(start: int, stop: int) -> None:
        _kernels.pack_tiles(rows, offset, scale, start, tiles[start:stop])

    in_parts(pack_part, n_tiles, work=rows.size)
    padded = np.zeros(n_tiles * _kernels.TILE)
    padded[:n_points] = density
    return tiles, padded


def _points(
    tiles: NDArray[np.float32],
    density: NDArray[np.float64],
    frame: Frame,
    n_points: int,
    in_order: bool,
) -> Points:
    boxes = np.stack([tiles.min(axis=2), tiles.max(axis=2)], axis=1)
    # Part by part: the squares of all at once would be a second copy of the points.
    spread = 0.0
    for start in range(0, len(tiles), _TILES_AT_ONCE):
        part = tiles[start : start + _TILES_AT_ONCE]
        squares = np.einsum("tdi,tdi->ti", part, part, dtype=np.float64).reshape(-1)
        first = start * _kernels.TILE
        spread += float(np.einsum("n,n->", density[first : first + len(squares)], squares))
    return Points(tiles, boxes, density, frame, n_points, in_order, spread)


def coarsen(points: Points, factor: int) -> Points:
    """Replace each `factor` points that follow each other, a divisor of the tile, by their center of mass.

    Where points that follow each other are near each other, generators that suit the fewer points nearly suit all.
    """
    n_tiles, n_dims, width = points.tiles.shape
    n_missing = -n_tiles % factor
    tiles = np.concatenate([points.tiles, np.repeat(points.tiles[-1:], n_missing, axis=0)])
    density = np.concatenate([points.density, np.zeros(n_missing * width)]).reshape(-1, 1, width // factor, factor)
    groups = tiles.reshape(-1, n_dims, width // factor, factor)
    masses = density.sum(axis=3)
    sums = np.einsum("tdgi,tegi->tdg", groups, density)
    means = np.divide(sums, masses, out=groups[..., 0].astype(np.float64), where=masses > 0).astype(np.float32)
    # Each `factor` tiles of few points become one tile.
    means = means.reshape(-1, factor, n_dims, width // factor).swapaxes(1, 2).reshape(-1, n_dims, width)
    return _points(np.ascontiguousarray(means), masses.reshape(-1), points.frame, masses.size, in_order=True)


def thin(points: Points, factor: int, rng: np.random.Generator) -> Points:
    """Draw one of each `factor` points."""
    drawn = np.sort(rng.choice(points.n_points, points.n_points // factor, replace=False))
    tiles, density = _tiles(points.rows(drawn), points.density[drawn], np.zeros(points.n_dims), 1.0)
    return _points(tiles, density, points.frame, len(drawn), points.in_order)


def assign(points: Points, generators: NDArray[np.float64]) -> NDArray[np.int32]:
    """Label each point, padding too, with its nearest generator; the first one on a tie."""
    single, half_norms = _for_kernels(generators)
    labels = np.empty(len(points.density), np.int32)
    columns = np.full((points.n_dims, -(-len(single) // _kernels.TILE) * _kernels.TILE), 1e18, np.float32)
    columns[:, : len(single)] = single.T
    grouped = points.n_dims <= _kernels.MAX_GROUPED_DIMS and len(single) >= _GROUPED_FROM

    def assign_part(start: int, stop: int) -> None:
        part, ends = slice(start, stop), slice(start * _kernels.TILE, stop * _kernels.TILE)
        if grouped:
            _kernels.assign_grouped(points.tiles[part], points.boxes[part], columns, single, half_norms, labels[ends])
        else:
            _kernels.assign(points.tiles[part], single, half_norms, labels[ends])

    # Of many generators in a group only some dozens are compared with each point.
    n_compared = _GROUPED_FROM if grouped else len(single)
    in_parts(assign_part, len(points.tiles), work=points.tiles.size / 8 * n_compared)
    return labels


def assign_two(
    points: Points, generators: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """Label each point with its nearest and its second nearest generator, and tell how much farther that is.

    The third array is the squared distance to the second nearest less that to the nearest.
    """
    labels, seconds = np.empty((2, len(points.density)), np.int32)
    gaps = np.empty(len(points.density), np.float32)
    single, half_norms = _for_kernels(generators)

    def assign_part(start: int, stop: int) -> None:
        ends = slice(start * _kernels.TILE, stop * _kernels.TILE)
        _kernels.assign_two(points.tiles[start:stop], single, half_norms, labels[ends], seconds[ends], gaps[ends])

    in_parts(assign_part, len(points.tiles), work=points.tiles.size / 8 * len(single))
    return labels, seconds, gaps


def cell_moments(
    points: Points, labels: NDArray[np.int32], n_cells: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(K,) mass of each cell and (K, D) sum of density times point."""
    parts = np.zeros((_n_parts(points), n_cells, points.n_dims + 1))

    def accumulate(part: int, tiles: slice, ends: slice) -> None:
        _kernels.accumulate(points.tiles[tiles], points.density[ends], labels[ends], parts[part])

    _sum_in_parts(points, accumulate, len(parts))
    total = parts.sum(axis=0)
    return total[:, -1].copy(), total[:, :-1].copy()


def energy(
    points: Points, generators: NDArray[np.float64], masses: NDArray[np.float64], sums: NDArray[np.float64]
) -> float:
    """Sum of density times squared distance to the own generator, from the moments of the cells."""
    cross = np.einsum("kd,kd->", generators, sums)
    norms = np.einsum("k,kd,kd->", masses, generators, generators)
    return float(max(points.spread - 2 * cross + norms, 0.0))


def cell_energies(points: Points, generators: NDArray[np.float64], labels: NDArray[np.int32]) -> NDArray[np.float64]:
    """(K,) energy of each cell, summed point by point: exact where `energy` cancels."""
    parts = np.zeros((_n_parts(points), len(generators)))

    def measure(part: int, tiles: slice, ends: slice) -> None:
        _kernels.measure(points.tiles[tiles], points.density[ends], generators, labels[ends], parts[part])

    _sum_in_parts(points, measure, len(parts))
    energies: NDArray[np.float64] = parts.sum(axis=0)
    return energies


def _for_kernels(generators: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return generators in float32, and half their squared norms."""
    single = np.ascontiguousarray(generators, dtype=np.float32)
    return single, (0.5 * np.einsum("kd,kd->k", single, single, dtype=np.float64)).astype(np.float32)


def _sum_in_parts(points: Points, kernel: Callable[[int, slice, slice], None], n_parts: int) -> None:
    """Call ``kernel(part, tiles, ends)`` for each of the fixed parts of the points."""
    bounds = [len(points.tiles) * part // n_parts for part in range(n_parts + 1)]

    def sum_some(start: int, stop: int) -> None:
        for part in range(start, stop):
            first, last = bounds[part], bounds[part + 1]
            kernel(part, slice(first, last), slice(first * _kernels.TILE, last * _kernels.TILE))

    in_parts(sum_some, n_parts, work=points.tiles.size)


def _n_parts(points: Points) -> int:
    return min(max(len(points.tiles) // _MIN_TILES, 1), _MAX_PARTS)
