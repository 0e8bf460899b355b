"""Rows of numbers in blocks: Dask arrays, and what becomes one, such as zarr arrays and files on disk."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_alone, check_choice, check_numbers, check_shape, check_that
from cvtimg._shared.extras import needs

if TYPE_CHECKING:
    Array: TypeAlias = Any  # dask.array.Array, which is not typed

__all__ = ["Blocks", "as_blocks", "is_blocked", "open_blocks"]

#: Bytes and rows of a block, where the data do not come in blocks.
_BLOCK_BYTES = 1 << 25
_BLOCK_ROWS = 1 << 22
#: Kinds of files that can be opened in blocks.
_SUFFIXES = (".npy", ".zarr", ".parquet")


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """N rows of D numbers in blocks, perhaps with weights.

    Attributes
    ----------
    rows : (N, D) dask.array.Array
        In blocks of some rows and all columns.
    weights : (N,) dask.array.Array or None
        In the same blocks.
    """

    rows: Array
    weights: Array | None = None

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


def as_blocks(samples: Any, weights: Any = None, *, weights_name: str = "density") -> Blocks:
    """Return samples of any kind in blocks.

    Parameters
    ----------
    samples : Blocks, or (N, D) dask.array.Array, dask.dataframe.DataFrame or zarr.Array
        Also a NumPy array, or one mapped to memory, which is then cut into blocks.
    weights : (N,) array of the same kinds, optional
        Weights of the rows. `Blocks` carry their own.
    weights_name : str
        What the caller calls the weights.

    Returns
    -------
    Blocks

    Raises
    ------
    TypeError, ValueError
        If the samples are no table of numbers, or the weights do not fit them.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.blocks import as_blocks
    >>> as_blocks(np.zeros((5, 3)))
    Blocks(1 blocks of 3 columns, float64)
    """
    if isinstance(samples, Blocks):
        if weights is not None:
            check_alone(weights_name, ["Blocks, which carry their own weights"])
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


def open_blocks(
    path: str | os.PathLike[str], *, columns: Sequence[str] | None = None, weight: str | None = None
) -> Blocks:
    """Open a file of numbers larger than memory, without reading it.

    Parameters
    ----------
    path : path
        A ``.npy`` file with an (N,) or (N, D) array, a ``.zarr`` array, or a ``.parquet`` file or a folder of them.
    columns : sequence of str, optional
        Columns of a Parquet file, in this order; all but `weight` by default.
    weight : str, optional
        Column of a Parquet file with the weights.

    Returns
    -------
    Blocks
        Of row groups of a Parquet file, and otherwise of about 32 MiB. Workers of a cluster need the same path.

    Raises
    ------
    ValueError
        If the file is of another kind, or a column is missing.
    OSError
        If it cannot be read.
    ImportError
        If Dask is missing, or what the kind of file needs: zarr or pyarrow.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from cvtimg import tessellate
    >>> from cvtimg.blocks import open_blocks
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/a.npy", np.array([[0, 0], [0, 2], [9, 0], [9, 2]]))
    ...     result = tessellate(open_blocks(f"{folder}/a.npy"), 2)
    ...     result.generators.tolist(), result.labels.compute().tolist()
    ([[0.0, 1.0], [9.0, 1.0]], [0, 0, 1, 1])
    """
    file = Path(path)
    kind = file.suffix.lower()
    if not (file.is_dir() and kind != ".zarr"):
        check_choice(f"{file}: suffix", kind, _SUFFIXES)
    if kind not in (".npy", ".zarr"):
        return _of_parquet(file, columns, weight)
    if columns is not None or weight is not None:
        check_alone("columns or weight", [f"a {kind} file, whose columns have no names"])
    if kind == ".zarr":
        return as_blocks(_open_zarr(file))
    mapped = np.load(file, mmap_mode="r")
    shape = mapped.shape if mapped.ndim == 2 else (*mapped.shape, 1)
    check_shape(str(file), mapped.shape, len(shape) == 2 and mapped.size > 0, "(N,) or (N, D) with N, D >= 1")
    length = _block_length(shape[1] * mapped.dtype.itemsize)
    bounds = [*range(0, shape[0], length), shape[0]]
    reads = [partial(_read_npy, file, start, stop) for start, stop in pairwise(bounds)]
    return as_blocks(_joined(reads, np.diff(bounds).tolist(), shape[1:], mapped.dtype))


def _dask_array(array: Any) -> Array:
    da = dask_arrays()
    if hasattr(array, "to_dask_array"):  # a table of dask.dataframe
        return array.to_dask_array()
    if isinstance(array, da.Array):
        return array
    if not hasattr(array, "shape"):
        array = np.asarray(array)
    step = _block_length(math.prod(array.shape[1:]) * np.dtype(array.dtype).itemsize)
    if hasattr(array, "chunks") and array.chunks:  # whole chunks of zarr, each of which is read once
        step = max(1, round(step / array.chunks[0])) * array.chunks[0]
    return da.from_array(array, chunks=(step, *array.shape[1:]))


def _block_length(row_bytes: int) -> int:
    return max(1, min(_BLOCK_ROWS, _BLOCK_BYTES // max(1, row_bytes)))


def _open_zarr(path: Path) -> Any:
    try:
        import zarr
    except ImportError as error:
        raise ImportError(f"{path}: needs {needs('zarr 3.1 or newer', 'zarr')}") from error
    return zarr.open_array(str(path), mode="r")


def _read_npy(path: Path, start: int, stop: int) -> NDArray[Any]:
    rows = np.array(np.load(path, mmap_mode="r")[start:stop])
    return rows if rows.ndim == 2 else rows[:, None]


def _of_parquet(path: Path, columns: Sequence[str] | None, weight: str | None) -> Blocks:
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise ImportError(f"{path}: needs {needs('pyarrow', 'parquet')}") from error
    files = sorted(path.rglob("*.parquet")) if path.is_dir() else [path]
    check_that(f"{path}", bool(files), "have at least one .parquet file in it")
    schema = parquet.read_schema(files[0])
    names = [name for name in schema.names if name != weight] if columns is None else list(columns)
    for name in [*names, *([weight] if weight else [])]:
        check_choice(f"{path}: column", name, schema.names)
    groups, lengths = [], []
    for file in files:
        about = parquet.ParquetFile(file).metadata
        groups += [(file, number) for number in range(about.num_row_groups)]
        lengths += [about.row_group(number).num_rows for number in range(about.num_row_groups)]
    dtype = np.result_type(*(schema.field(name).type.to_pandas_dtype() for name in names))
    rows = [partial(_read_group, file, number, names, dtype) for file, number in groups]
    found = as_blocks(_joined(rows, lengths, (len(names),), dtype))
    if weight is None:
        return found
    weights = [partial(_read_weights, file, number, weight) for file, number in groups]
    return as_blocks(found.rows, _joined(weights, lengths, (), np.dtype(np.float64)))


def _read_group(path: Path, group: int, names: Sequence[str], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Read some columns of a row group, (n, C)."""
    from pyarrow import parquet

    table = parquet.ParquetFile(path).read_row_group(group, columns=list(names))
    rows = np.empty((table.num_rows, len(names)), dtype)
    for number, name in enumerate(names):
        column = table.column(name)
        check_that(f"{path}: column {name!r} of row group {group}", not column.null_count, "have no missing values")
        rows[:, number] = column.to_numpy()
    return rows


def _read_weights(path: Path, group: int, name: str) -> NDArray[np.float64]:
    return _read_group(path, group, [name], np.dtype(np.float64))[:, 0]


def _joined(
    reads: Sequence[Callable[[], NDArray[Any]]], lengths: Sequence[int], shape: tuple[int, ...], dtype: np.dtype[Any]
) -> Array:
    """Return the array of blocks that are read when they are needed."""
    da = dask_arrays()
    from dask.delayed import delayed

    parts = [
        da.from_delayed(delayed(read, pure=True)(), (length, *shape), dtype)
        for read, length in zip(reads, lengths, strict=True)
    ]
    return da.concatenate(parts)


def dask_arrays() -> Any:
    """Import dask.array."""
    try:
        import dask.array
    except ImportError as error:
        raise ImportError(f"samples in blocks need {needs('Dask', 'dask')}") from error
    return dask.array
