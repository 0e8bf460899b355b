"""Sums of what has one label, what each label has, and functions of rows."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts


def sum_by_label(
    labels: NDArray[np.integer], values: NDArray[Any], n_labels: int = 0, weights: NDArray[Any] | None = None
) -> NDArray[np.float64]:
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


def take_rows(rows: NDArray[Any], labels: NDArray[np.integer]) -> NDArray[Any]:
    """Return the row (M, ...) that each label has, of labels of any shape; threads share the work."""
    found, flat = np.empty((labels.size, *rows.shape[1:]), rows.dtype), labels.reshape(-1)

    def take(start: int, stop: int) -> None:
        np.take(rows, flat[start:stop], axis=0, out=found[start:stop], mode="clip")

    in_parts(take, flat.size, work=found.size)
    return found.reshape(*labels.shape, *rows.shape[1:])


def by_rows(function: Callable[..., NDArray[Any]]) -> Callable[..., NDArray[Any]]:
    """Let a function of arrays of N rows, which gives one like the first, take parts of them, in threads."""

    @wraps(function)
    def whole(first: NDArray[Any], *others: NDArray[Any]) -> NDArray[Any]:
        found = np.empty_like(first)

        def part(start: int, stop: int) -> None:
            found[start:stop] = function(first[start:stop], *(other[start:stop] for other in others))

        in_parts(part, len(first), work=32.0 * first.size)
        return found

    return whole


def per_mass(sums: NDArray[np.float64], masses: NDArray[Any]) -> NDArray[np.float64]:
    """Divide (K, P) sums by (K,) masses; 0 where there is none."""
    has_mass = masses[:, None] > 0
    return np.divide(sums, masses[:, None], out=np.zeros_like(sums), where=has_mass)
