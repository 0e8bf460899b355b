"""Weighted points as the kernels read them, and the three passes over them that every method is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg import _kernels

#: Points are summed in this many parts at most, each of this many tiles at least. The parts depend on the data
#: alone: the sums have the same bits whatever the number of threads.
_MAX_PARTS = 32
_MIN_TILES = 256
#: Finding which generators can be nearest pays from this number of generators.
_GROUPED_FROM = 40


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Weighted points, packed in tiles for the kernels and centered.

    Attributes
    ----------
    tiles : (n_tiles, D, TILE) float32 array
        Points less the center, the last one repeated to fill the last tile.
    boxes : (n_tiles, 2, D) float32 array
        Least and greatest coordinates in each tile.
    density : (n_tiles * TILE,) float64 array
        Weight of each point, 0 in the padding.
    center : (D,) float64 array
        Mean of the points, or an integer near it, so that float32 holds what matters.
    n_points : int
        Points without the padding.
    in_order : bool
        Whether points that follow each other are near each other.
    spread : float
        Sum of density times squared distance to the center.
    """

    tiles: NDArray[np.float32]
    boxes: NDArray[np.float32]
    density: NDArray[np.float64]
    center: NDArray[np.float64]
    n_points: int
    in_order: bool
    spread: float

    @property
    def n_dims(self) -> int:
        """Number of coordinates, D."""
        return int(self.tiles.shape[1])

    def rows(self, members: NDArray[np.intp] | slice = slice(None)) -> NDArray[np.float64]:
        """(m, D) centered coordinates of some points."""
        index = np.arange(self.n_points)[members]
        return self.tiles[index // _kernels.TILE, :, index % _kernels.TILE].astype(np.float64)


def pack(rows: NDArray[Any], density: NDArray[np.float64], *, in_order: bool = False) -> Points:
    """Pack (N, D) rows and their weights; the rows are copied once, here."""
    center = density @ rows / density.sum()
    if rows.dtype.kind == "u":
        center = np.rint(center)  # so that float32 holds integers, and products of 8-bit colors, exactly
    return _points(*_tiles(rows, center, density), center, len(rows), in_order)


def _tiles(
    rows: NDArray[Any], offset: NDArray[np.float64], density: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Tiles of rows less an offset, and their density with 0 in the padding."""
    n_points, n_dims = rows.shape
    n_tiles = -(-n_points // _kernels.TILE)
    tiles = np.empty((n_tiles, n_dims, _kernels.TILE), np.float32)
    _kernels.pack_tiles(rows, offset, tiles)
    padded = np.zeros(n_tiles * _kernels.TILE)
    padded[:n_points] = density
    return tiles, padded


def _points(
    tiles: NDArray[np.float32],
    density: NDArray[np.float64],
    center: NDArray[np.float64],
    n_points: int,
    in_order: bool,
) -> Points:
    boxes = np.stack([tiles.min(axis=2), tiles.max(axis=2)], axis=1)
    squares = np.einsum("tdi,tdi->ti", tiles, tiles, dtype=np.float64)
    return Points(tiles, boxes, density, center, n_points, in_order, float(density @ squares.reshape(-1)))


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
    return _points(np.ascontiguousarray(means), masses.reshape(-1), points.center, masses.size, in_order=True)


def thin(points: Points, factor: int, rng: np.random.Generator) -> Points:
    """Draw one of each `factor` points."""
    drawn = np.sort(rng.choice(points.n_points, points.n_points // factor, replace=False))
    tiles, density = _tiles(points.rows(drawn), np.zeros(points.n_dims), points.density[drawn])
    return _points(tiles, density, points.center, len(drawn), points.in_order)


def assign(points: Points, generators: NDArray[np.float64]) -> NDArray[np.int32]:
    """Label each point, padding too, with its nearest generator; the first one on a tie."""
    single, half_norms = _for_kernels(generators)
    labels = np.empty(len(points.density), np.int32)
    if points.n_dims > _kernels.MAX_GROUPED_DIMS or len(single) < _GROUPED_FROM:
        _kernels.assign(points.tiles, single, half_norms, labels)
    else:
        n_filled = -(-len(single) // _kernels.TILE) * _kernels.TILE
        columns = np.full((points.n_dims, n_filled), 1e18, np.float32)
        columns[:, : len(single)] = single.T
        _kernels.assign_grouped(points.tiles, points.boxes, columns, single, half_norms, labels)
    return labels


def assign_two(
    points: Points, generators: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """Label each point with its nearest and its second nearest generator, and tell how much farther that is.

    The third array is the squared distance to the second nearest less that to the nearest.
    """
    labels, seconds = np.empty((2, len(points.density)), np.int32)
    gaps = np.empty(len(points.density), np.float32)
    _kernels.assign_two(points.tiles, *_for_kernels(generators), labels, seconds, gaps)
    return labels, seconds, gaps


def cell_moments(
    points: Points, labels: NDArray[np.int32], n_cells: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(K,) mass of each cell and (K, D) sum of density times point."""
    parts = np.zeros((_n_parts(points), n_cells, points.n_dims + 1))
    _kernels.accumulate(points.tiles, points.density, labels, parts)
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
    _kernels.measure(points.tiles, points.density, generators, labels, parts)
    energies: NDArray[np.float64] = parts.sum(axis=0)
    return energies


def _for_kernels(generators: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return generators in float32, and half their squared norms."""
    single = np.ascontiguousarray(generators, dtype=np.float32)
    return single, (0.5 * np.einsum("kd,kd->k", single, single, dtype=np.float64)).astype(np.float32)


def _n_parts(points: Points) -> int:
    return min(max(len(points.tiles) // _MIN_TILES, 1), _MAX_PARTS)
