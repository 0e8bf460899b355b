"""Snapshots in a few coordinates: a randomized singular value decomposition over blocks of rows.

Everything else works on the coordinates, so its cost does not depend on the size of a snapshot, and the snapshots are
read only a few times.

N. Halko, P.-G. Martinsson, J. A. Tropp, SIAM Review 53 (2011) 217-288, doi 10.1137/090771806.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvtimg._shared.threads import one_blas_thread
from cvtimg._shared.types import Array, Floats
from cvtimg.bases.snapshots import Snapshots

#: Snapshots or values in each, the fewer of them, and values in all, up to which all directions are found: the cost of
#: at most 2^45 products, some seconds.
EXACT_RANK, _EXACT_VALUES = 1 << 10, 1 << 25


@dataclass(frozen=True, slots=True, eq=False)
class Sketch:
    """Snapshots less their mean, in the coordinates of their leading singular directions."""

    coordinates: Floats  # (N, R) with mean 0; columns are orthogonal, of falling length
    directions: Array  # (R, D) orthonormal rows
    mean: Floats  # (D,) of the snapshots
    variance: float  # sum of squared distances to the mean; what the coordinates miss of it is `missed`

    @property
    def missed(self) -> float:
        """The part of the variance outside of the directions, as an energy."""
        return max(self.variance - float((self.coordinates**2).sum()), 0.0)


@one_blas_thread
def sketch(
    snapshots: Snapshots, rank: int, rng: np.random.Generator, *, centered: bool = True, weights: Floats | None = None
) -> Sketch:
    """Sketch snapshots in at most `rank` coordinates.

    Of arrays that are small all directions are found, and the coordinates are those of a singular value decomposition.
    Coordinates are multiplied by the roots of the weights; the mean is 0 if they are not to be `centered`.
    """
    whole = min(snapshots.n_snapshots, snapshots.n_dims)
    rank = min(rank, whole)
    is_exact = whole <= EXACT_RANK and snapshots.n_snapshots * snapshots.n_dims <= _EXACT_VALUES
    width, dtype = (whole, np.dtype(np.float64)) if is_exact else (rank, snapshots.dtype)
    directions = rng.standard_normal((snapshots.n_dims, width), np.float32).astype(dtype)
    # Products are taken about a snapshot at first, lest float32 lose what differs beside what all have in common.
    center = np.asarray(snapshots.read(0, 1), dtype).reshape(-1) * dtype.type(centered)
    heavy = np.ones(snapshots.n_snapshots) if weights is None else weights
    for _ in range(1 if is_exact else 2):
        values, mean, variance = _products(snapshots, directions, center, heavy, centered)
        center = mean.astype(dtype)
        basis = np.linalg.qr(values)[0]
        rows = _combined(snapshots, (basis * np.sqrt(heavy)[:, None]).astype(dtype), center)
        directions = np.linalg.qr(rows.T)[0].astype(dtype)
    left, lengths, right = np.linalg.svd(rows, full_matrices=False)
    coordinates = ((basis @ left) * lengths)[:, :rank]
    return Sketch(coordinates, right[:rank].astype(snapshots.dtype), mean, variance)


def _products(
    snapshots: Snapshots, directions: Array, center: Array, weights: Floats, centered: bool
) -> tuple[Floats, Floats, float]:
    """Return the (N, R) products of weighted snapshots less their mean with directions, the (D,) mean, the variance."""
    values, sums, squares = [], np.zeros(snapshots.n_dims), 0.0
    for rows, block in snapshots.blocks():
        apart = block - center
        values.append(apart @ directions)
        sums += np.einsum("n,nd->d", weights[rows], apart, dtype=np.float64)
        squares += float(np.einsum("n,nd,nd->", weights[rows], apart, apart, dtype=np.float64))
    joined, mass = np.concatenate(values).astype(np.float64), float(weights.sum())
    shift = sums / mass if centered else np.zeros_like(sums)
    variance = max(squares - mass * float(shift @ shift), 0.0)
    middle = weights @ joined / mass if centered else 0.0
    return np.sqrt(weights)[:, None] * (joined - middle), center + shift, variance


def _combined(snapshots: Snapshots, basis: Array, center: Array) -> Floats:
    """Return (R, D) combinations of snapshots less their mean."""
    total = np.zeros((basis.shape[1], snapshots.n_dims))
    for rows, block in snapshots.blocks():
        total += basis[rows].T @ (block - center)
    return total
