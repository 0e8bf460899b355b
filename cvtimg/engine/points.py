"""Weighted points in the layout that the kernels read, and the passes over them that every method is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

import cvtimg.engine._kernels as _kernels
from cvtimg._shared.budgets import ROWS_AT_ONCE
from cvtimg._shared.checks import SAMPLE_DTYPES, check_that
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Array, Floats, Indices, Ints

#: Points are summed in at most this many parts, of at least this many tiles each. The parts depend only on the data,
#: so that sums have the same bits for any number of threads.
_MAX_PARTS = 32
_MIN_TILES = 256
#: Ruling out generators that cannot be nearest pays off from this number of generators on.
GROUPED_FROM = 40
#: Energies below this fraction of the energy about the origin are rounding errors of means of float32 samples.
_ROUNDING = 1e-24
#: Largest rounding errors, by the number that is rounded.
_UNIT, _EXACT_UNIT = (float(np.finfo(dtype).epsneg) for dtype in (np.float32, np.float64))
#: Fraction by which labels of float32 may raise the energy of the true ones; more gives float32 more tables.
LOSS = 1e-6
#: Squared distances of float32 differ from the true ones by less than 8 roundings for each dimension and 4 more.
_ROUNDINGS = 8
#: Energies, sums of squares, of values this far from their mean are out of the range of float64.
_TOO_LARGE = 1e140
#: Energies below this fraction of the energy about the origin are summed point by point: half the digits of their
#: moments cancel.
SMALL_ENERGY = float(np.sqrt(np.finfo(np.float64).eps))


class Frame(NamedTuple):
    """An origin near the mean of the points, and a scale, so that float32 holds the digits that matter."""

    center: Floats
    scale: float

    def inward(self, places: Array) -> Floats:
        """Transform (n, D) places from the units of the samples to the frame."""
        return (places - self.center) * self.scale

    def outward(self, places: Floats) -> Floats:
        """Transform (n, D) places from the frame to the units of the samples."""
        return places / self.scale + self.center

    def energy(self, energy: float) -> float:
        """Convert an energy from the frame to squared units of the samples."""
        return float(energy) / self.scale / self.scale  # the square of a scale may be out of range


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Weighted points in their frame, packed in tiles for the kernels."""

    # Only this module and the kernels know the layout of the tiles; others use the methods here.

    tiles: Array  # (n_tiles, D, TILE), float32, or float64 of exact ones; the last one fills the last tile
    boxes: Array  # (n_tiles, 2, D): smallest and largest coordinates in each tile, of few dimensions
    squares: Floats  # (n_tiles * TILE,): squared distances to the origin of points that are not exact
    density: Floats  # (n_tiles * TILE,): weight of each point, 0 in the padding
    frame: Frame  # Where the origin of the tiles is
    n_points: int  # Number of points, padding not included
    in_order: bool  # Whether consecutive points are near each other
    energy_about_origin: float  # Sum of density times squared distance to the origin of the frame

    @property
    def n_dims(self) -> int:
        """Number of coordinates, D."""
        return int(self.tiles.shape[1])

    @property
    def exact(self) -> bool:
        """Whether the points are in float64, where distances are sums of squared differences."""
        return bool(self.tiles.dtype == np.float64)

    def rows(self, members: Indices | list[int] | slice = slice(None)) -> Floats:
        """Return the (m, D) places of some points in the frame, all by default."""
        index = np.arange(self.n_points)[members]
        return self.tiles[index // _kernels.TILE, :, index % _kernels.TILE].astype(np.float64)

    def coordinate(self, dim: int) -> Array:
        """Return one coordinate of all points, padding included, in the order of `density`."""
        return self.tiles[:, dim].reshape(-1)

    def take(self, members: Indices, density: Floats) -> Points:
        """Return some of the points, by their (m,) indices in ascending order, with (m,) new weights."""
        index = np.pad(members, (0, -len(members) % _kernels.TILE), "edge")
        rows = self.tiles[index // _kernels.TILE, :, index % _kernels.TILE]
        tiles = np.ascontiguousarray(rows.reshape(-1, _kernels.TILE, self.n_dims).swapaxes(1, 2))
        padded = np.pad(density, (0, len(index) - len(members)))
        return _points(tiles, padded, self.frame, len(members), self.in_order)


def pack(
    rows: Array,
    density: Floats,
    *,
    center: Floats | None = None,
    frame: Frame | None = None,
    in_order: bool = False,
    order: Indices | None = None,
    exact: bool = False,
) -> Points:
    """Pack (N, D) rows and their weights, in a frame about their mean or another center, or in a given one."""
    # With an order, in which near ones follow each other, they are packed in that. Exact points are in float64.
    # Rows are copied only here.
    if rows.dtype not in SAMPLE_DTYPES:  # other integers
        rows = rows.astype(np.float64)
    if frame is None:
        # Of few columns each by itself, which is faster.
        columns = rows.T if len(rows.T) < 16 else [rows]
        low, high = (np.hstack([least(column, axis=0) for column in columns]) for least in (np.min, np.max))
        if center is None:
            # Differences to the place nearest to 0 of the box of the rows lose none of their digits.
            center = np.clip(0.0, low, high).astype(np.float64) if exact else _mean(rows, density)
        frame = Frame(center, scale_within(low, high, center) if rows.dtype.kind == "f" else 1.0)
    n_points, n_dims = rows.shape
    n_tiles = -(-n_points // _kernels.TILE)
    tiles = np.empty((n_tiles, n_dims, _kernels.TILE), np.float64 if exact else np.float32)
    padded = np.zeros(n_tiles * _kernels.TILE)

    def pack_part(start: int, stop: int) -> None:
        ends = slice(start * _kernels.TILE, min(stop * _kernels.TILE, n_points))
        if order is None:
            some, padded[ends] = rows[ends], density[ends]
        else:
            some, padded[ends] = rows[order[ends]], density[order[ends]]
        _kernels.pack_tiles(some, frame.center, frame.scale, tiles[start:stop])

    in_parts(pack_part, n_tiles, work=16 * rows.size)
    return _points(tiles, padded, frame, n_points, in_order or order is not None)


def _mean(rows: Array, density: Floats) -> Floats:
    some, weights = rows[:ROWS_AT_ONCE], density[:ROWS_AT_ONCE]  # any center near the points will do
    if not weights.any():
        center: Floats = some.mean(axis=0, dtype=np.float64)
    else:
        center = np.einsum("n,nd->d", weights, some) / weights.sum()
    # Whole, so that float32 holds integers, and products of 8-bit colors, exactly.
    return np.rint(center) if rows.dtype.kind == "u" else center


def scale_within(low: Array, high: Array, center: Floats) -> float:
    """Return the scale for places between these (D,) limits."""
    return scale_for_float32(max(float(np.max(high - center)), float(np.max(center - low))))


def scale_for_float32(size: float) -> float:
    """Return a power of two, usually 1, that brings places of this size to one whose squares float32 holds."""
    check_that(f"values up to {size:.3g} from their mean", size < _TOO_LARGE, f"be within {_TOO_LARGE:g} of it")
    return 1.0 if size == 0 or 1e-6 < size < 1e6 else 2.0 ** min(-round(math.log2(size)), 1000)


def _points(tiles: Array, density: Floats, frame: Frame, n_points: int, in_order: bool) -> Points:
    boxes = np.zeros((len(tiles), 2, tiles.shape[1]), tiles.dtype)
    parts = _fixed_parts(len(tiles))
    squares, energies = np.zeros(len(density)), np.zeros(len(parts))
    origin, labels = np.zeros((1, tiles.shape[1])), np.zeros(len(density), np.int32)

    def finish(start: int, stop: int) -> None:
        for n, (part, ends) in enumerate(parts[start:stop], start):
            if tiles.shape[1] <= _kernels.MAX_GROUPED_DIMS:
                tiles[part].min(axis=2, out=boxes[part, 0])
                tiles[part].max(axis=2, out=boxes[part, 1])
            if tiles.dtype == np.float32:
                _kernels.distances_to_own(tiles[part], origin, labels[ends], squares[ends])
                energies[n] = np.einsum("n,n->", density[ends], squares[ends])

    in_parts(finish, len(parts), work=4 * tiles.size)
    return Points(tiles, boxes, squares, density, frame, n_points, in_order, sum(energies.tolist()))


def coarsen(points: Points, factor: int) -> Points:
    """Replace every `factor` consecutive points by their center of mass; `factor` divides the size of a tile."""
    # Where consecutive points are near each other, generators that suit the fewer points nearly suit all.
    n_tiles, n_dims, width = points.tiles.shape
    groups = points.tiles.reshape(n_tiles, n_dims, width // factor, factor)
    weights = points.density.reshape(n_tiles, width // factor, factor)
    masses = weights.sum(axis=2)
    sums = np.einsum("tdgi,tgi->tdg", groups, weights)
    means = np.divide(sums, masses[:, None], out=groups[..., 0].astype(np.float64), where=masses[:, None] > 0)
    n_merged = -(-points.n_points // factor)
    rows, density = means.swapaxes(1, 2).reshape(-1, n_dims)[:n_merged], masses.reshape(-1)[:n_merged]
    at_origin = Frame(np.zeros(n_dims), 1.0)
    return replace(pack(rows, density, frame=at_origin, in_order=True, exact=points.exact), frame=points.frame)


def thin(points: Points, factor: int, rng: np.random.Generator) -> Points:
    """Draw one point in `factor`, those that are far from the mean more often, with weights that make up for it."""
    # Half by mass and half by energy: O. Bachem, M. Lucic, A. Krause, KDD 2018, 1119-1127, doi 10.1145/3219819.3219973.
    n_drawn = points.n_points // factor
    labels, apart = np.zeros(len(points.density), np.int32), np.empty(len(points.density))
    mass, sums = cell_moments(points, labels, 1)
    _kernels.distances_to_own(points.tiles, sums / mass, labels, apart)
    apart *= points.density
    chances = points.density / mass[0] + apart / (apart.sum() or 1.0)
    ends = np.cumsum(chances)
    places = (np.arange(n_drawn) + rng.random()) / n_drawn * ends[-1]
    drawn, counts = np.unique(np.searchsorted(ends, places, side="right"), return_counts=True)
    return points.take(drawn, points.density[drawn] * counts * ends[-1] / (n_drawn * chances[drawn]))


def assign(points: Points, generators: Floats, gaps: Array | None = None) -> Ints:
    """Label each point, padding included, with its nearest generator; the first one on a tie."""
    # Into gaps goes how much farther the second nearest is, in squared distance.
    # The nearest generator z of a point y has the least ``|z|^2 / 2 - y . z``.
    places, half_norms = _for_kernels(points, generators)
    labels = np.empty(len(points.density), np.int32)
    grouped = points.n_dims <= _kernels.MAX_GROUPED_DIMS and len(places) >= GROUPED_FROM
    columns = np.full((points.n_dims, -(-len(places) // _kernels.TILE) * _kernels.TILE), 1e18, places.dtype)
    columns[:, : len(places)] = places.T

    def assign_part(start: int, stop: int) -> None:
        part, ends = slice(start, stop), slice(start * _kernels.TILE, stop * _kernels.TILE)
        arguments = columns if grouped else None, places, half_norms, labels[ends], None if gaps is None else gaps[ends]
        _kernels.assign(points.tiles[part], points.boxes[part], *arguments)

    # With many generators only some dozens are compared with each point, after a look at all for each few tiles.
    n_compared = GROUPED_FROM + len(places) // 16 if grouped else len(places)
    in_parts(assign_part, len(points.tiles), work=points.tiles.size / 8 * n_compared)
    return labels


def assign_rows(rows: Array, places: Array, points: Points, order: Indices | None = None) -> Ints:
    """Label (N, D) rows with their nearest places, in their own units, once packed as points; perhaps in an order."""
    # Where the two nearest are nearer to each other than rounding is, float64 decides. So a label depends on no other
    # row: J. Shewchuk, Discrete & Computational Geometry 18 (1997) 305-363, doi 10.1007/PL00009321.
    generators = points.frame.inward(places)
    gaps = np.full(len(points.density), np.inf, points.tiles.dtype)
    labels = assign(points, generators, None if points.exact else gaps)
    if not points.exact and len(places) > 1:
        norms = np.einsum("kd,kd->k", generators, generators)
        bound = _ROUNDINGS * (points.n_dims + 4) * _UNIT
        doubt = np.flatnonzero((gaps <= bound * np.maximum(points.squares, norms[labels]))[: points.n_points])
        if doubt.size:
            doubtful = rows[doubt if order is None else order[doubt]]
            frame = Frame(np.zeros(points.n_dims), points.frame.scale)
            exact = pack(doubtful, np.ones(len(doubtful)), frame=frame, exact=True)
            labels[doubt] = assign(exact, frame.inward(places))[: len(doubt)]
    if order is None:
        return labels[: points.n_points]
    given = np.empty(points.n_points, np.int32)
    given[order] = labels[: points.n_points]
    return given


class RowMoments(NamedTuple):
    """Sums over the rows of each cell, in their own units, about a place for each."""

    masses: Floats  # (K,) of the weights
    steps: Floats  # (K, D) of weight times row - place
    energies: Floats  # (K,) of weight times squared distance to the place

    @classmethod
    def of(cls, rows: Array, weights: Floats, places: Floats, labels: Ints) -> RowMoments:
        """Sum over (N, D) rows by their labels."""
        points = pack(rows, weights, frame=Frame(np.zeros(rows.shape[1]), 1.0), exact=True)
        padded = np.pad(labels, (0, len(points.density) - len(labels)))
        masses, sums = cell_moments(points, padded, len(places))
        return cls(masses, sums - masses[:, None] * places, cell_energies(points, places, padded))

    def about(self, places: Floats, moves: Floats) -> RowMoments:
        """Return the moments about other places, which are short moves from those of these moments."""
        cross = np.einsum("kd,kd->k", moves, self.masses[:, None] * moves - 2 * self.steps)
        energies = self.energies + cross
        # Distinct rows are farther apart than this: the rest is the rounding of means.
        least = (8 * _EXACT_UNIT) ** 2 * self.masses * np.einsum("kd,kd->k", places, places)
        steps = self.steps - self.masses[:, None] * moves
        return RowMoments(self.masses, steps, np.where(energies > least, energies, 0.0))

    def to_means(self, places: Floats, frame: Frame, *, exact: bool) -> Floats:
        """Return the (K, D) steps of places to the means of their cells, 0 where more than rounding is in between."""
        masses = np.where(self.masses > 0, self.masses, 1.0)
        steps, off = self.steps / masses[:, None], places - frame.center
        size = np.einsum("kd,kd->k", off, off) + self.energies / masses
        rounding = 4 * (_EXACT_UNIT if exact else _UNIT)
        return np.where((np.einsum("kd,kd->k", steps, steps) <= rounding**2 * size)[:, None], steps, 0.0)


def float32_suffices(points: Points, energy: float, loss: float = LOSS) -> bool:
    """Whether rows that float32 cannot tell apart may raise this energy by no more than a fraction of it."""
    # A label is wrong only where two squared distances are equal but for rounding, u sqrt(D) A / N, with A the energy
    # about the origin and u the unit. So are u sqrt(D) A / E of all, and none costs more than rounding: the loss is of
    # second order, D (u A / E)^2 of the energy.
    return _UNIT * math.sqrt(points.n_dims) * points.energy_about_origin <= math.sqrt(loss) * energy


def assign_next(points: Points, generators: Floats, labels: Ints) -> tuple[Ints, Array]:
    """Return the nearest generator of each point but for its own, and how much farther that is, in squared distance."""
    seconds, gaps = np.empty(len(labels), np.int32), np.empty(len(labels), points.tiles.dtype)
    places, half_norms = _for_kernels(points, generators)

    def assign_part(start: int, stop: int) -> None:
        ends = slice(start * _kernels.TILE, stop * _kernels.TILE)
        _kernels.assign_next(points.tiles[start:stop], places, half_norms, labels[ends], seconds[ends], gaps[ends])

    in_parts(assign_part, len(points.tiles), work=points.tiles.size / 8 * len(places))
    return seconds, gaps


def cell_moments(points: Points, labels: Ints, n_cells: int) -> tuple[Floats, Floats]:
    """Return the (K,) mass of each cell and the (K, D) sum of density times point."""
    slices = _fixed_parts(len(points.tiles))
    parts = np.zeros((len(slices), n_cells, points.n_dims + 1))

    def accumulate(start: int, stop: int) -> None:
        for (tiles, ends), part in zip(slices[start:stop], parts[start:stop], strict=True):
            _kernels.accumulate(points.tiles[tiles], points.density[ends], labels[ends], part)

    in_parts(accumulate, len(parts), work=8 * points.tiles.size)
    total = parts.sum(axis=0)
    return total[:, -1].copy(), total[:, :-1].copy()


def energy(points: Points, generators: Floats, labels: Ints, masses: Floats, sums: Floats) -> float:
    """Return the sum of density times squared distance to the own generator, from the moments of the cells."""
    # Below the fraction `SMALL_ENERGY` of that about the origin the moments cancel.
    if points.exact:
        return float(cell_energies(points, generators, labels).sum())
    cross = np.einsum("kd,kd->", generators, sums)
    norms = np.einsum("k,kd,kd->", masses, generators, generators)
    return float(max(points.energy_about_origin - 2 * cross + norms, 0.0))


def cell_energies(points: Points, generators: Floats, labels: Ints) -> Floats:
    """Return the (K,) energy of each cell, summed point by point: accurate where `energy` cancels."""
    parts = _fixed_parts(len(points.tiles))
    sums = np.empty((len(parts), len(generators)))

    def add(start: int, stop: int) -> None:
        for n, (tiles, ends) in enumerate(parts[start:stop], start):
            distances = np.empty(ends.stop - ends.start)
            _kernels.distances_to_own(points.tiles[tiles], generators, labels[ends], distances)
            sums[n] = np.bincount(labels[ends], points.density[ends] * distances, len(generators))

    in_parts(add, len(parts), work=12 * points.tiles.size)
    energies = sums.sum(axis=0)
    # Distinct points are farther apart than this: the rest is the rounding of means.
    least = _ROUNDING * points.energy_about_origin
    if points.exact:
        sizes = np.einsum("kd,kd->k", generators, generators)
        least = (8 * _EXACT_UNIT) ** 2 * sizes * np.bincount(labels, points.density, len(generators))
    return np.where(energies > least, energies, 0.0)


def _for_kernels(points: Points, generators: Floats) -> tuple[Array, Array]:
    """Convert generators to the type of the points, and compute half their squared norms, 0 for exact points."""
    if points.exact:
        return np.ascontiguousarray(generators), np.zeros(len(generators))
    single = np.ascontiguousarray(generators, dtype=np.float32)
    return single, (0.5 * np.einsum("kd,kd->k", single, single, dtype=np.float64)).astype(np.float32)


def _fixed_parts(n_tiles: int) -> list[tuple[slice, slice]]:
    """Return the tiles, and the points, of each part that is summed by itself."""
    n_parts = min(max(n_tiles // _MIN_TILES, 1), _MAX_PARTS)
    bounds = [n_tiles * part // n_parts for part in range(n_parts + 1)]
    return [(slice(*ends), slice(ends[0] * _kernels.TILE, ends[1] * _kernels.TILE)) for ends in pairwise(bounds)]
