"""Passes of NumPy over the rows of arrays, which threads share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts, of_each

Floats = NDArray[np.float64]

#: Rows of a block whose products are summed by itself.
_BLOCK = 1 << 14
#: Steps of a kernel that NumPy needs for each number that it is given.
_STEPS = 8


def by_rows(function: Callable[..., Floats], first: NDArray[Any], *others: NDArray[Any], **options: Any) -> Floats:
    """Return what a function makes of the rows of arrays, each row by itself, in the shape of the first array."""
    made = np.empty(first.shape)

    def make(start: int, stop: int) -> None:
        made[start:stop] = function(*(given[start:stop] for given in (first, *others)), **options)

    in_parts(make, len(made), _STEPS * sum(given.size for given in (first, *others)))
    return made


def products(pairs: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Sum the products of each of M pairs of (N, D) arrays: (M,). The threads of a BLAS would change bits."""

    def of_block(n: int) -> list[float]:
        block = slice(n * _BLOCK, (n + 1) * _BLOCK)
        return [np.einsum("nd,nd", one[block], other[block]) for one, other in pairs]

    n_blocks = -(-max(len(one) for one, _ in pairs) // _BLOCK)
    return np.sum(of_each(of_block, n_blocks, _STEPS * sum(one.size for one, _ in pairs)), axis=0)
