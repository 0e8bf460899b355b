"""CVOD: a tessellation whose generators are affine subspaces, each cell with a proper orthogonal basis of its own.

Q. Du, M. Gunzburger, Centroidal Voronoi tessellation based proper orthogonal decomposition analysis, in: Control and
Estimation of Distributed Parameter Systems, Birkhauser (2003) 137-150, doi 10.1007/978-3-0348-8001-5_9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.tessellation import tessellate

_Floats = NDArray[np.float64]

_STARTS = 4
_MAX_ROUNDS = 100
_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Subspaces:
    """Affine subspaces and the rows that are nearest to each."""

    centers: _Floats  # (C, R) mean of each cell
    axes: _Floats  # (C, n, R) orthonormal, those of greatest variance first; zeros where a cell has fewer
    labels: NDArray[np.int64]  # (N,) cell of each row
    energy: float  # sum of squared distances of the rows to their subspaces


def find_subspaces(rows: _Floats, n_cells: int, n_axes: int, rng: np.random.Generator) -> Subspaces:
    """Tessellate (N, R) rows by `n_cells` affine subspaces of `n_axes` dimensions, from the best of a few starts."""
    ends = (_descend(rows, _start(rows, n_cells, rng), n_cells, n_axes) for _ in range(_STARTS))
    return min(ends, key=lambda end: end.energy)


def distances(rows: _Floats, centers: _Floats, axes: _Floats) -> _Floats:
    """(N, C) squared distances of rows to affine subspaces."""
    columns = []
    for center, own in zip(centers, axes, strict=True):
        apart = rows - center
        along = apart @ own.T
        columns.append(np.einsum("nr,nr->n", apart, apart) - np.einsum("na,na->n", along, along))
    return np.maximum(np.stack(columns, axis=1), 0.0)


def principal_axes(rows: _Floats, n_axes: int) -> tuple[_Floats, _Floats]:
    """Mean of (N, R) rows, and their (n_axes, R) axes of greatest variance, padded by zeros."""
    center = rows.mean(axis=0)
    right = np.linalg.svd(rows - center, full_matrices=False)[2][:n_axes]
    axes = np.zeros((n_axes, rows.shape[1]))
    n_found = min(len(right), len(rows) - 1)
    axes[:n_found] = right[:n_found]
    return center, axes


def _start(rows: _Floats, n_cells: int, rng: np.random.Generator) -> NDArray[np.int64]:
    return tessellate(rows, n_cells, init="k-means++", effort="fast", rng=rng).labels.astype(np.int64)


def _descend(rows: _Floats, labels: NDArray[np.int64], n_cells: int, n_axes: int) -> Subspaces:
    """Fit each cell's subspace and assign each row to the nearest, in turns: the energy never rises."""
    last = np.inf
    for _ in range(_MAX_ROUNDS):
        fitted = [principal_axes(rows[labels == cell], n_axes) for cell in range(n_cells)]
        centers, axes = (np.stack(parts) for parts in zip(*fitted, strict=True))
        apart = distances(rows, centers, axes)
        labels = _without_empty_cells(apart, apart.argmin(axis=1))
        energy = float(apart.min(axis=1).sum())
        if energy >= last * (1 - _TOLERANCE):
            break
        last = energy
    return Subspaces(centers, axes, apart.argmin(axis=1), energy)


def _without_empty_cells(apart: _Floats, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give each empty cell the row that is farthest from its own subspace, of a cell that keeps others."""
    sizes = np.bincount(labels, minlength=apart.shape[1])
    order = np.argsort(-apart.min(axis=1), kind="stable")
    for cell in np.flatnonzero(sizes == 0):
        farthest = next(row for row in order if sizes[labels[row]] > 1)
        sizes[labels[farthest]] -= 1
        labels[farthest], sizes[cell] = cell, 1
    return labels
