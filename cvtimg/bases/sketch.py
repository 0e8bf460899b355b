"""Snapshots in a few coordinates: a randomized singular value decomposition over blocks of rows.

Everything else works on the coordinates, so its cost does not depend on the size of a snapshot, and the snapshots are
read only a few times.

N. Halko, P.-G. Martinsson, J. A. Tropp, SIAM Review 53 (2011) 217-288, doi 10.1137/090771806.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from cvtimg.bases.snapshots import Snapshots


@dataclass(frozen=True, slots=True, eq=False)
class Sketch:
    """Snapshots less their mean, in the coordinates of their leading singular directions."""

    coordinates: NDArray[np.float64]  # (N, R) with mean 0; columns are orthogonal, of falling length
    directions: NDArray[Any]  # (R, D) orthonormal rows
    mean: NDArray[np.float64]  # (D,) of the snapshots
    variance: float  # sum of squared distances to the mean; what the coordinates miss of it is `missed`

    @property
    def missed(self) -> float:
        """The part of the variance outside of the directions, as an energy."""
        return max(self.variance - float((self.coordinates**2).sum()), 0.0)


def sketch(snapshots: Snapshots, rank: int, passes: int, rng: np.random.Generator) -> Sketch:
    """Sketch snapshots in at most `rank` coordinates, reading them `passes` times, an even number."""
    # Sums over blocks are taken in a fixed order, so the same blocks give the same bits on every machine of a kind.
    rank = min(rank, snapshots.n_snapshots, snapshots.n_dims)
    directions = rng.standard_normal((snapshots.n_dims, rank), np.float32).astype(snapshots.dtype)
    # Products are taken about a snapshot at first, lest float32 lose what differs beside what all have in common.
    center = np.asarray(snapshots.read(0, 1), snapshots.dtype).reshape(-1)
    with threadpool_limits(1, "blas"):
        for _ in range(passes // 2):
            found = snapshots.total(partial(_project, directions=directions, center=center), _Products.total)
            values, mean, variance = found.about_mean(center)
            center = mean.astype(snapshots.dtype)
            basis = np.linalg.qr(values)[0]
            rows = snapshots.total(partial(_combine, basis=basis.astype(snapshots.dtype), center=center), _added)
            rows = rows.astype(np.float64, copy=False)
            directions = np.linalg.qr(rows.T)[0].astype(snapshots.dtype)
        left, lengths, right = np.linalg.svd(rows, full_matrices=False)
        coordinates = (basis @ left) * lengths
    return Sketch(coordinates, right.astype(snapshots.dtype), mean, variance)


@dataclass(frozen=True, slots=True, eq=False)
class _Products:
    """Snapshots less a center: lists of their (m, R) products with directions, their (D,) sum, and that of squares."""

    values: list[NDArray[Any]]
    sums: NDArray[np.float64]
    squares: float

    @staticmethod
    def total(parts: Iterable[_Products]) -> _Products:
        """Join the products of consecutive blocks."""
        given = iter(parts)
        first = next(given)
        values, sums, squares = list(first.values), first.sums.copy(), first.squares
        for part in given:
            values += part.values
            sums += part.sums
            squares += part.squares
        return _Products(values, sums, squares)

    def about_mean(self, center: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return the (N, R) products of snapshots less their mean, the (D,) mean, and the variance."""
        values = np.concatenate(self.values).astype(np.float64)
        shift = self.sums / len(values)
        variance = max(self.squares - len(values) * float(shift @ shift), 0.0)
        return values - values.mean(axis=0), center + shift, variance


def _project(rows: slice, block: NDArray[Any], *, directions: NDArray[Any], center: NDArray[Any]) -> _Products:
    apart = block - center
    squares = float(np.einsum("nd,nd->", apart, apart, dtype=np.float64))
    return _Products([apart @ directions], apart.sum(axis=0, dtype=np.float64), squares)


def _combine(rows: slice, block: NDArray[Any], *, basis: NDArray[Any], center: NDArray[Any]) -> NDArray[Any]:
    """Return (R, D) combinations of snapshots less their mean."""
    return basis[rows].T @ (block - center)


def _added(parts: Iterable[NDArray[Any]]) -> NDArray[np.float64]:
    """Add arrays in double, in the memory of one."""
    given = iter(parts)
    total = next(given).astype(np.float64)
    for part in given:
        total += part
    return total
