"""Rows of numbers in blocks: Dask arrays, and what becomes one, such as zarr arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from cvtimg._shared.checks import check_numbers, check_shape, check_that
from cvtimg._shared.extras import optional

if TYPE_CHECKING:
    Array: TypeAlias = Any  # dask.array.Array, which is not typed


#: Bytes of a block, where the data do not come in blocks.
BLOCK_BYTES = 1 << 25


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """N rows of D numbers in blocks, perhaps with weights.

    Attributes
    ----------
    rows : (N, D) dask.array.Array
        In blocks of some rows and all columns.
    weights : (N,) dask.array.Array or None
        In the same blocks.
    kept : (M,) bool dask.array.Array or None
        Which rows of a file are in `rows`, if some may have been left out; in the same blocks.
    names : tuple of str
        Names of the columns, if they come from a file.
    left_out : dict of str
        Why columns of the file were left out that nobody chose, such as ``{"name": "text"}``.
    """

    rows: Array
    weights: Array | None = None
    kept: Array | None = None
    names: tuple[str, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        weighted = "" if self.weights is None else ", weighted"
        return f"Blocks({self.n_blocks} blocks of {self.n_dims} columns, {self.rows.dtype}{weighted})"

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return int(self.rows.numblocks[0])

    @property
    def n_dims(self) -> int:
        """Number of columns, D."""
        return int(self.rows.shape[1])

    @property
    def lengths(self) -> tuple[int, ...] | None:
        """Number of rows of each block; None if Dask does not know them yet."""
        lengths = self.rows.chunks[0]
        return None if any(math.isnan(length) for length in lengths) else tuple(map(int, lengths))


def is_blocked(samples: object) -> bool:
    """Whether samples come in blocks: as `Blocks`, a Dask array or table, or a zarr array."""
    # No import of libraries that may not be there.
    return isinstance(samples, Blocks) or type(samples).__module__.partition(".")[0] in ("dask", "zarr")


def as_blocks(samples: object, weights: object = None, *, weights_name: str = "density") -> Blocks:
    """Return samples of any kind in blocks.

    Parameters
    ----------
    samples : Blocks, or (N, D) dask.array.Array, dask.dataframe.DataFrame or zarr.Array
        Also a NumPy array, or one mapped to memory, which is then cut into blocks.
    weights : (N,) array of the same kinds, optional
        Weights of the rows. `Blocks` carry their own.
    weights_name : str
        What the caller calls the weights.

    Examples
    --------
    >>> from cvtimg.blocks import as_blocks
    >>> as_blocks(np.zeros((5, 3)))
    Blocks(1 blocks of 3 columns, float64)
    """
    if isinstance(samples, Blocks):
        check_that(weights_name, weights is None, "not be given with Blocks, which carry their own weights")
        return samples
    rows = _dask_array(samples)
    check_shape("samples", rows.shape, rows.ndim == 2 and 0 not in rows.shape, "(N, D) with N, D >= 1")
    check_numbers("samples", rows.dtype)
    rows = rows.rechunk({1: -1})
    if weights is None:
        return Blocks(rows)
    given = _dask_array(weights)
    check_numbers(weights_name, given.dtype)
    fits = given.ndim == 1 and (given.shape == rows.shape[:1] or math.isnan(rows.shape[0] + given.shape[0]))
    check_shape(weights_name, given.shape, fits, f"({rows.shape[0]},), one weight for each sample")
    if not math.isnan(given.shape[0] + rows.shape[0]):
        given = given.rechunk(rows.chunks[:1])
    n_blocks = (given.numblocks[0], rows.numblocks[0])
    check_that(weights_name, len(set(n_blocks)) == 1, f"be in as many blocks as the samples: {n_blocks[1]}")
    return Blocks(rows, given)


def _dask_array(array: Any) -> Array:
    da = dask_arrays()
    if hasattr(array, "to_dask_array"):  # a table of dask.dataframe
        return array.to_dask_array()
    if isinstance(array, da.Array):
        return array
    if not hasattr(array, "shape"):
        array = np.asarray(array)
    step = block_length(math.prod(array.shape[1:]) * np.dtype(array.dtype).itemsize)
    if hasattr(array, "chunks") and array.chunks:  # whole chunks of zarr, each of which is read once
        step = max(1, round(step / array.chunks[0])) * array.chunks[0]
    return da.from_array(array, chunks=(step, *array.shape[1:]))


def block_length(row_bytes: int) -> int:
    """Return the number of rows of a block, where the data do not come in blocks."""
    return max(1, BLOCK_BYTES // max(1, row_bytes))


def dask_arrays() -> Any:
    """Import dask.array."""
    return optional("dask.array", "dask", "samples in blocks need")
