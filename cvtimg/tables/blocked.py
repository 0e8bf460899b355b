"""Tables larger than memory: which files are opened in blocks, their spread, and labels written block by block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_that
from cvtimg._shared.types import Array, Floats, Ints
from cvtimg.blocks.passes import Block, blocks_of, over_blocks
from cvtimg.blocks.rows import Blocks
from cvtimg.blocks.spread import Scaling, Spread
from cvtimg.engine.block_descent import survey
from cvtimg.files.whole import StrPath
from cvtimg.tables.files import write_label_parts

#: Arrays of more bytes are opened in blocks.
_LARGE_BYTES = 1 << 30


def is_large_table(path: Path) -> bool:
    """Whether a table is opened in blocks: Parquet and Zarr always, and .npy arrays of more than 1 GiB."""
    kind = path.suffix.lower()
    if kind == ".npy" and path.is_file() and path.stat().st_size > _LARGE_BYTES:
        return np.load(path, mmap_mode="r").dtype.names is None  # a structured array is no array of rows
    return kind in (".parquet", ".zarr")


def spread_of(blocks: Blocks) -> Spread:
    """Measure all rows in one pass; at least one must have a positive weight."""
    spread = over_blocks(blocks, _spread_of_block, Spread.total)
    check_that("at least one row", spread.mass > 0, "be complete and of positive weight")
    return spread


def _spread_of_block(block: Block) -> Spread:
    nothing = np.zeros((0, block.rows.shape[1]))
    return Spread.total([Spread.of(*piece) for piece in block.pieces()] or [Spread.of(nothing, np.zeros(0))])


def standardized(blocks: Blocks, scaling: Scaling) -> Blocks:
    """Return rows that are scaled as they are read."""
    return replace(blocks, rows=blocks.rows.map_blocks(scaling.apply, dtype=np.float64))


def sample_rows(blocks: Blocks, rng: int) -> tuple[Array, Floats]:
    """Draw about a million rows of positive weight; return them and their weights."""
    surveyed = survey(blocks, 1, np.random.default_rng(rng))
    return surveyed.rows, surveyed.weights


def write_block_labels(path: StrPath, labels: Any, blocks: Blocks, *, overwrite: bool = False) -> int:
    """Write the labels of rows in blocks as `write_row_labels` does, and return the number of rows of the file."""
    given = labels if blocks.kept is None else blocks.kept
    n_rows = int(given.shape[0])
    write_label_parts(path, n_rows, _parts(labels, blocks.kept), overwrite=overwrite)
    return n_rows


def _parts(labels: object, kept: object) -> Iterator[Ints]:
    if kept is None:
        yield from (part for (part,) in blocks_of(labels))
        return
    for part, inside in blocks_of(labels, kept):
        whole = np.full(len(inside), -1, np.int32)
        whole[inside] = part
        yield whole
