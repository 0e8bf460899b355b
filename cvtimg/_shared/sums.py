"""Sums of what has one label, and what each label has."""

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts, in_stripes
from cvtimg._shared.types import Array, Floats


def sum_by_label(labels: NDArray[np.integer], values: Array, n_labels: int = 0, weights: Array | None = None) -> Floats:
    """Sum values (M,) or (M, P), times weights (M,) if given, by their labels (M,): (K,) or (K, P) sums.

    K is one more than the largest label, or `n_labels` if that is more. Values are added in double precision, one
    after the other.

    Examples
    --------
    >>> sum_by_label(np.array([0, 1, 1]), np.array([[1, 2], [3, 4], [5, 6]])).tolist()
    [[1.0, 2.0], [8.0, 10.0]]
    """
    if values.ndim == 1:
        weighted = values if weights is None else weights * values
        return np.bincount(labels, weighted, n_labels).astype(np.float64, copy=False)
    return np.stack([sum_by_label(labels, column, n_labels, weights) for column in values.T], axis=1)


def take_rows(rows: Array, labels: NDArray[np.integer]) -> Array:
    """Return the row (M, ...) that each label has, of labels of any shape; threads share the work."""
    taken, flat = np.empty((labels.size, *rows.shape[1:]), rows.dtype), labels.reshape(-1)

    def take(start: int, stop: int) -> None:
        np.take(rows, flat[start:stop], axis=0, out=taken[start:stop], mode="clip")

    in_parts(take, flat.size, work=8.0 * taken.size)
    return taken.reshape(*labels.shape, *rows.shape[1:])


def copy_rows(rows: Array, out: Array) -> Array:
    """Copy (H, ...) rows to `out`, and return it; threads share the work."""

    def copy(stripe: slice) -> None:
        out[stripe] = rows[stripe]

    in_stripes(copy, len(rows), work=16.0 * rows.size)
    return out


def contiguous(array: Array) -> Array:
    """Return an array, or a copy of it in the order of its axes; threads share the work."""
    array = np.asarray(array)
    return array if array.flags.c_contiguous else copy_rows(array, np.empty(array.shape, array.dtype))


def per_mass(sums: Floats, masses: Array) -> Floats:
    """Divide (K, P) sums by (K,) masses; 0 where there is none."""
    has_mass = masses[:, None] > 0
    return np.divide(sums, masses[:, None], out=np.zeros_like(sums), where=has_mass)
