"""What must hold of a tessellation and its rows, checked where results prove themselves."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from cvtimg._shared.records import PROVING, Claims, equals, prove
from cvtimg._shared.types import Array, Floats

#: A tessellation, whose module imports this one.
_Result = TypeVar("_Result")
#: The nearest generator is looked for again of this many rows.
_ROWS = 1024
#: Generators are as near as each other, and energies the same, within this share.
_ROUNDING = 1e-6


def proven(result: _Result, rows: Array, density: Floats, nearest: bool) -> _Result:
    """Return a tessellation of (N, D) rows, which is checked if that is asked for; labels if they are the nearest."""
    if PROVING:
        prove("Tessellation", _claims(result, rows, density, nearest))
    return result


def _claims(result: Any, rows: Array, density: Floats, nearest: bool) -> Claims:
    labels, generators = result.labels, result.generators
    yield "masses are sums of the density", equals(result.masses, np.bincount(labels, density, len(generators)))
    blocks = [slice(start, start + _ROWS) for start in range(0, len(rows), _ROWS)]
    squares = np.concatenate([np.square(rows[block] - generators[labels[block]]).sum(axis=1) for block in blocks])
    rounded = float(np.square(np.finfo(np.float32).eps * np.abs(rows).max()))  # of generators that are found in float32
    energy, rounding = float(density @ squares), rounded * float(density.sum())
    yield "the energy is that of the labels", abs(result.energy - energy) <= _ROUNDING * energy + rounding
    if nearest:
        some = slice(None, None, -(-len(rows) // _ROWS))
        least = np.full(len(squares[some]), np.inf)
        for generator in generators:
            np.minimum(least, np.square(rows[some] - generator).sum(axis=1), out=least)
        yield "rows have their nearest generators", squares[some] <= least * (1 + _ROUNDING) + rounded
