"""Files of numbers larger than memory, here or elsewhere: arrays and columns that are read when they are needed."""

import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_choice, check_in_range, check_shape, check_that
from cvtimg._shared.extras import optional
from cvtimg._shared.messages import one_line
from cvtimg._shared.types import Array
from cvtimg.blocks.rows import Blocks, as_blocks, block_length, dask_arrays
from cvtimg.files.remote import elsewhere, is_remote, url_of
from cvtimg.files.whole import StrPath

#: Kinds of files that can be opened in blocks.
BLOCK_SUFFIXES = (".npy", ".zarr", ".parquet")


def open_blocks(
    path: StrPath, *, columns: Sequence[str] | None = None, weight: str | None = None, missing: str = "error"
) -> Blocks:
    """Open a file of numbers larger than memory, without reading it.

    Parameters
    ----------
    path : path or URL
        A ``.npy`` file with an (N,) or (N, D) array, a ``.zarr`` array, or a ``.parquet`` file or a folder of them.
    columns : sequence of str, optional
        Columns to use, in this order; all but `weight` by default. Those of arrays are called col0, col1, ..., or 0,
        1, ... for short.
    weight : str, optional
        Column with the weights.
    missing : {"error", "drop"}
        What to do with rows in which a selected value is missing: NaN, or null in a Parquet file. "drop" leaves them
        out; `Blocks.kept` tells which remain.

    Returns
    -------
    Blocks
        Of row groups of a Parquet file, and otherwise of about 32 MiB. Workers of a cluster need the same path.

    See Also
    --------
    as_blocks : Arrays in memory, of Dask or of zarr.
    cvtimg.tessellate, cvtimg.CVT : Take what it opens.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg import tessellate
    >>> from cvtimg.blocks import open_blocks
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/a.npy", np.array([[0, 0], [0, 2], [9, 0], [9, 2]]))
    ...     result = tessellate(open_blocks(f"{folder}/a.npy"), 2)
    ...     result.generators.tolist(), result.labels.compute().tolist()
    ([[0.0, 1.0], [9.0, 1.0]], [0, 0, 1, 1])
    """
    place = url_of(path)
    check_choice("missing", missing, ("error", "drop"))
    kind = Path(place).suffix.lower()
    if not kind and _parquet_files(place) != [place]:
        kind = ".parquet"
    check_choice(f"{place}: suffix", kind, BLOCK_SUFFIXES)
    if kind == ".parquet":
        blocks = _of_parquet(place, columns, weight, missing)
    else:
        blocks = _of_array(place, _zarr_array(place) if kind == ".zarr" else _npy_array(place), columns, weight)
    if missing == "error" or blocks.rows.dtype.kind != "f":
        return blocks
    (rows, weights), isnan = (blocks.rows, blocks.weights), dask_arrays().isnan
    kept = ~isnan(rows).any(axis=1) if weights is None else ~(isnan(rows).any(axis=1) | isnan(weights))
    return replace(blocks, rows=rows[kept], weights=None if weights is None else weights[kept], kept=kept)


def _of_array(place: str, array: Any, columns: Sequence[str] | None, weight: str | None) -> Blocks:
    """Return columns of an (N, D) array, which have numbers for names."""
    names = [f"col{number}" for number in range(array.shape[1])]
    numbers = {name: number for number, name in enumerate(names)}
    numbers |= {str(number): number for number in range(len(names))}
    for name in [*(columns or ()), *([] if weight is None else [weight])]:
        check_in_range(f"{place}: column", name, name in numbers, f"one of {', '.join(names)}")
    weighted = None if weight is None else numbers[weight]
    chosen = [n for n in range(len(names)) if n != weighted] if columns is None else [numbers[name] for name in columns]
    whole = as_blocks(array)
    rows = whole.rows if chosen == list(range(len(names))) else whole.rows[:, chosen]
    weights = None if weighted is None else whole.rows[:, weighted].astype(np.float64)
    return Blocks(as_blocks(rows).rows, weights, None, tuple(names[number] for number in chosen))


def _zarr_array(place: str) -> Any:
    zarr = optional("zarr", "zarr", f"{place}: needs")
    try:
        stored = zarr.open_array(place, mode="r")
    except (OSError, ValueError) as error:
        raise OSError(f"{place}: is not a Zarr array ({one_line(error)})") from error
    check_shape(place, stored.shape, stored.ndim in (1, 2) and 0 not in stored.shape, "(N,) or (N, D) with N, D >= 1")
    return dask_arrays().from_zarr(stored)[:, None] if stored.ndim == 1 else as_blocks(stored).rows


def _npy_array(place: str) -> Any:
    check_that(place, not is_remote(place), "be a .zarr array or a .parquet file: .npy files are read on this machine")
    try:
        stored = np.lib.format.open_memmap(place, mode="r")
    except ValueError as error:
        raise OSError(f"{place}: is not a .npy file of numbers ({error})") from error
    check_shape(place, stored.shape, stored.ndim in (1, 2) and 0 not in stored.shape, "(N,) or (N, D) with N, D >= 1")
    width = math.prod(stored.shape[1:])
    length = block_length(width * stored.itemsize)
    bounds = [*range(0, len(stored), length), len(stored)]
    reads = [partial(_map_rows, place, begin, end) for begin, end in pairwise(bounds)]
    return _joined(reads, np.diff(bounds).tolist(), (width,), stored.dtype)


def _map_rows(place: str, begin: int, end: int) -> Array:
    rows = np.array(np.load(place, mmap_mode="r")[begin:end])
    return rows.reshape(len(rows), -1)


def _of_parquet(place: str, columns: Sequence[str] | None, weight: str | None, missing: str) -> Blocks:
    files = _parquet_files(place)
    check_that(place, bool(files), "have at least one .parquet file in it")
    groups = [(file, group) for file in files for group in _row_groups(file)]
    n_rows = [group.row_groups[0].num_rows for _, group in groups]  # count_rows may be that of the file
    check_that(place, sum(n_rows) > 0, "have rows")
    names, left_out = list(columns or ()), {}
    if columns is None:
        kinds = {field.name: field.type for field in groups[0][1].physical_schema if field.name != weight}
        left_out = {
            name: str(kind) for name, kind in kinds.items() if not _is_number(kind) or name.startswith("__index")
        }
        names = [name for name in kinds if name not in left_out]
        check_that(place, bool(names), "have a column of numbers")
    # The same column may have other types in other files, and a row without a value has NaN for it.
    wanted = [*names, *([] if weight is None else [weight])]
    types = [_type_of(file, group.physical_schema, name) for file, group in groups for name in wanted]
    dtype = np.result_type(*types, *([np.float32] if missing == "drop" else []))
    reads = [partial(_read_group, file, group, wanted, dtype, missing) for file, group in groups]
    whole = as_blocks(_joined(reads, n_rows, (len(wanted),), dtype)).rows
    if weight is None:
        return Blocks(whole, None, None, tuple(names), left_out)
    return Blocks(whole[:, :-1], whole[:, -1].astype(np.float64), None, tuple(names), left_out)


def _row_groups(place: str) -> list[Any]:
    """Return the row groups of a file, which are read when they are needed."""
    pyarrow = optional("pyarrow", "parquet", f"{place}: needs")
    from pyarrow import dataset

    with elsewhere(place) if is_remote(place) else nullcontext((None, place)) as (files, name):
        try:
            (whole,) = dataset.dataset(name, format="parquet", filesystem=files).get_fragments()
            return list(whole.split_by_row_group())
        except pyarrow.ArrowException as error:
            raise OSError(f"{place}: is not a Parquet file ({one_line(error)})") from error


def _type_of(place: str, schema: Any, name: str) -> np.dtype[Any]:
    from pyarrow import types

    check_choice(f"{place}: column", name, schema.names)
    kind = schema.field(name).type
    is_number = _is_number(kind) or types.is_boolean(kind)
    check_that(f"{place}: column {name!r} of type {kind}", is_number, "be of numbers; name the columns to use")
    return np.dtype(kind.to_pandas_dtype())


def _is_number(kind: object) -> bool:
    from pyarrow import types

    return bool(types.is_integer(kind) or types.is_floating(kind))


def _parquet_files(place: str) -> list[str]:
    if is_remote(place):
        with elsewhere(place) as (files, name):
            names = sorted(str(part) for part in (files.find(name) if files.isdir(name) else []))
            return [str(files.unstrip_protocol(part)) for part in names if part.endswith(".parquet")] or [place]
    path = Path(place)
    return [str(file) for file in sorted(path.rglob("*.parquet"))] if path.is_dir() else [place]


def _read_group(place: str, group: Any, names: Sequence[str], dtype: np.dtype[np.generic], missing: str) -> Array:
    """Read some columns of a row group, (n, C)."""
    import pyarrow

    table = group.to_table(columns=list(names), schema=group.physical_schema)
    for name, column in zip(names, table.columns, strict=True):
        whole = missing == "drop" or not column.null_count
        check_that(f"{place}: column {name!r} of row group {group.row_groups[0].id}", whole, "have no missing values")
    columns = [column.cast(pyarrow.float64(), safe=False) if column.null_count else column for column in table.columns]
    return np.stack([column.to_numpy() for column in columns], axis=1).astype(dtype)


def _joined(
    reads: Sequence[Callable[[], Array]], lengths: Sequence[int], shape: tuple[int, ...], dtype: np.dtype[np.generic]
) -> Any:
    """Return the array of blocks that are read when they are needed."""
    da = dask_arrays()
    from dask.delayed import delayed

    parts = [
        da.from_delayed(delayed(read, pure=True)(), (length, *shape), dtype)
        for read, length in zip(reads, lengths, strict=True)
    ]
    return da.concatenate(parts)
