"""Passes over blocks: work on each, and one sum of all.

Dask decides where and in which order the work is done, retries it, and moves and spills blocks. The sum is taken along
a tree that depends only on the number of blocks, so it has the same bits for any number of workers.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any, NoReturn, TypeVar

import numpy as np

from cvtimg._shared.budgets import ROWS_AT_ONCE
from cvtimg._shared.checks import as_samples, check_shape, check_that
from cvtimg._shared.messages import one_line
from cvtimg._shared.threads import one_thread
from cvtimg._shared.types import Array, Floats
from cvtimg.blocks.rows import Blocks

T = TypeVar("T")

#: Sums that are added at a time: fewer make more tasks, and more wait for each other.
_WIDTH = 8
_KEY = "cvtimg-block"
_passes = count()


class BlockError(ValueError):
    """A block is not as it must be, or cannot be read; `number` says which, from 0."""

    def __init__(self, number: int, why: str) -> None:
        super().__init__(number, why)
        self.number = number

    def __str__(self) -> str:
        return f"block {self.number}: {self.args[1]}"


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """One block, where it is worked on."""

    number: int  # Which block, from 0
    rows: Array  # (n, D): of the type of the samples
    weights: Array | None  # (n,)

    def pieces(self) -> Iterator[tuple[Array, Floats]]:
        """Yield some rows at a time, finite and of a type that the kernels read, with their weights, >= 0."""
        for start in range(0, len(self.rows), ROWS_AT_ONCE):
            part = slice(start, start + ROWS_AT_ONCE)
            rows = as_samples("samples", self.rows[part])
            if self.weights is None:
                yield rows, np.ones(len(rows))
                continue
            weights = np.ascontiguousarray(self.weights[part], np.float64)
            check_that("weights", np.isfinite(weights).all() and weights.min() >= 0, "be finite and >= 0")
            yield rows, weights


def over_blocks(blocks: Blocks, work: Callable[..., T], add: Callable[[Sequence[T]], T], *shared: Any) -> T:
    """Return the sum of ``work(block, *shared)`` over the blocks: the same bits wherever they are worked on."""
    # `add` takes values of consecutive blocks, or sums of them, in their order; both functions are picklable. What is
    # shared is sent to each worker once. Raises BlockError if a block fails, and ConnectionError if the cluster was
    # lost.
    from dask.delayed import delayed

    rows = blocks.rows.to_delayed()[:, 0].tolist()
    weights = [None] * len(rows) if blocks.weights is None else blocks.weights.to_delayed().tolist()
    parts, name = list(zip(rows, weights, strict=True)), getattr(work, "__name__", "work")
    token = f"{_KEY}-{name}-{next(_passes)}"
    promised = blocks.lengths or (None,) * len(parts)
    common = delayed((work, promised, blocks.n_dims, shared), name=f"{token}-shared", traverse=False)
    on_rows, total = delayed(_on_rows, pure=False), delayed(add, pure=False)
    sums = [on_rows(number, *arrays, common, dask_key_name=f"{token}-{number}") for number, arrays in enumerate(parts)]
    while len(sums) > 1:  # along a tree that depends only on their number
        sums = [total(sums[first : first + _WIDTH]) for first in range(0, len(sums), _WIDTH)]
    return _computed(sums, parts)[0]


def map_rows(
    blocks: Blocks,
    function: Callable[[Array], Array],
    dtype: Any,
    n_columns: int | None = None,
    *,
    lengths: tuple[int, ...] | None = None,
) -> Any:
    """Return what a function makes of (n, D) rows, (n,) or (n, n_columns) values, as a Dask array."""
    # The function is picklable and works row by row. `lengths` are those of the blocks, where Dask does not know them.
    from dask.delayed import delayed

    tail = () if n_columns is None else ((n_columns,),)
    return blocks.rows.map_blocks(
        _mapped,
        function=delayed(function, traverse=False, pure=True),
        empty=np.empty((0, *(() if n_columns is None else (n_columns,))), dtype),
        dtype=dtype,
        drop_axis=[1] if n_columns is None else [],
        chunks=(lengths or blocks.rows.chunks[0], *tail),
        meta=np.empty((0,) * (1 + len(tail)), dtype),
    )


def blocks_of(*arrays: Any) -> Iterator[tuple[Array, ...]]:
    """Compute Dask arrays that are in the same number of blocks, block by block in order, some at a time."""
    parts = list(zip(*(array.to_delayed().ravel().tolist() for array in arrays), strict=True))
    for start in range(0, len(parts), _WIDTH):
        yield from _computed(parts[start : start + _WIDTH], parts)


def _mapped(rows: Array, *, function: Callable[[Array], Array], empty: Array, block_info: Any = None) -> Array:
    number = block_info[0]["chunk-location"][0] if block_info else 0
    try:
        with one_thread():
            parts = [function(piece) for piece, _ in Block(number, rows, None).pieces()]
            return np.concatenate(parts) if parts else empty
    except ValueError as error:
        raise BlockError(number, one_line(error)) from error


def _on_rows(number: int, rows: object, weights: object, common: tuple[Any, ...]) -> Any:
    """Work on rows of the promised length and width, in one thread: Dask works on several blocks at a time."""
    work, promised, n_dims, shared = common
    try:
        rows, length = np.asarray(rows), promised[number]
        fits = rows.ndim == 2 and rows.shape[1] == n_dims and length in (None, len(rows))
        check_shape("samples", rows.shape, fits, f"({'n' if length is None else length}, {n_dims})")
        if weights is not None:
            weights = np.asarray(weights)
            check_shape("weights", weights.shape, weights.shape == rows.shape[:1], f"({len(rows)},), one for each row")
        with one_thread():
            return work(Block(number, rows, weights), *shared)
    except (ValueError, TypeError) as error:
        raise BlockError(number, one_line(error)) from error


def _computed(values: Sequence[Any], parts: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
    """Compute delayed values that are made of the delayed arrays of each block."""
    try:
        return _compute(*values)
    except BlockError:
        raise
    except Exception as error:
        _explain(error, parts)


def _explain(error: Exception, parts: Sequence[tuple[Any, ...]]) -> NoReturn:
    """Say which block it was, or that the cluster was lost."""
    kind = type(error).__name__
    if kind == "KilledWorker":
        key = str(getattr(error, "task", ""))
        number = int(key.rpartition("-")[2]) if key.startswith(_KEY) and key.rpartition("-")[2].isdigit() else -1
        n_lost = getattr(error, "allowed_failures", 0) + 1
        if number >= 0:
            raise BlockError(number, f"{n_lost} workers were lost while they worked on it") from error
        raise ConnectionError(f"{n_lost} workers of the Dask cluster were lost while they worked on {key}") from error
    if type(error).__module__.partition(".")[0] == "distributed" or "Cancelled" in kind:
        raise ConnectionError(f"the Dask cluster was lost ({one_line(error) or kind})") from error
    # Dask does not say where an error comes from: read one block after the other.
    from dask.delayed import delayed

    for number, arrays in enumerate(parts):
        try:
            _compute(*(delayed(len, pure=False)(array) for array in arrays if array is not None))
        except Exception as why:
            raise BlockError(number, f"cannot be read ({type(why).__name__}: {one_line(why)})") from why
    raise error


def _compute(*values: Any) -> tuple[Any, ...]:
    import dask.base

    library: Any = dask.base
    return library.compute(*values)
