"""Tables larger than memory: which files are opened in blocks, their spread, and labels written block by block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg.blocks.passes import Block, blocks_of, over_blocks
from cvtimg.blocks.rows import Blocks
from cvtimg.engine.block_descent import survey
from cvtimg.files.whole import StrPath
from cvtimg.tables.files import Scaling, write_label_parts

#: Arrays of more bytes are opened in blocks.
_LARGE_BYTES = 1 << 30


def is_large_table(path: Path) -> bool:
    """Whether a table is opened in blocks: Parquet and Zarr always, and .npy arrays of more than 1 GiB."""
    kind = path.suffix.lower()
    if kind == ".npy" and path.is_file() and path.stat().st_size > _LARGE_BYTES:
        return np.load(path, mmap_mode="r").dtype.names is None  # a structured array is no array of rows
    return kind in (".parquet", ".zarr")


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Sums over rows: mass, (D,) means and sums of weight times squared distance to them, and (D,) limits."""

    mass: float
    means: NDArray[np.float64]
    squares: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @classmethod
    def of(cls, rows: NDArray[Any], weights: NDArray[np.float64]) -> Spread:
        """Measure rows of positive weight."""
        rows, weights = rows[weights > 0].astype(np.float64), weights[weights > 0]
        n_dims = rows.shape[1]
        if not len(rows):
            return cls(0.0, np.zeros(n_dims), np.zeros(n_dims), np.full(n_dims, np.inf), np.full(n_dims, -np.inf))
        means = np.average(rows, axis=0, weights=weights)
        squares = np.einsum("n,nd->d", weights, (rows - means) ** 2)
        return cls(float(weights.sum()), means, squares, rows.min(axis=0), rows.max(axis=0))

    @staticmethod
    def total(parts: Sequence[Spread]) -> Spread:
        """Join the spreads of parts of the rows."""
        full = [part for part in parts if part.mass] or list(parts[:1])
        masses = np.array([part.mass for part in full])
        all_means = np.stack([part.means for part in full])
        means = np.average(all_means, axis=0, weights=masses) if masses.any() else all_means[0]
        squares = np.sum([part.squares for part in full], axis=0) + masses @ (all_means - means) ** 2
        low, high = (np.stack([getattr(part, limit) for part in full]) for limit in ("low", "high"))
        return Spread(float(masses.sum()), means, squares, low.min(axis=0), high.max(axis=0))

    @property
    def scaling(self) -> Scaling:
        """Scales columns to mean 0 and variance 1."""
        deviations = np.sqrt(self.squares / self.mass)
        return Scaling(self.means, np.where((self.low == self.high) | (deviations == 0), 1.0, deviations))


def spread_of(blocks: Blocks) -> Spread:
    """Measure all rows in one pass; at least one must have a positive weight."""
    found = over_blocks(blocks, _spread_of_block, Spread.total)
    check_that("at least one row", found.mass > 0, "be complete and of positive weight")
    return found


def _spread_of_block(block: Block) -> Spread:
    nothing = np.zeros((0, block.rows.shape[1]))
    return Spread.total([Spread.of(*piece) for piece in block.pieces()] or [Spread.of(nothing, np.zeros(0))])


def standardized(blocks: Blocks, scaling: Scaling) -> Blocks:
    """Return rows that are scaled as they are read."""
    return replace(blocks, rows=blocks.rows.map_blocks(scaling.apply, dtype=np.float64))


def sample_rows(blocks: Blocks, rng: int) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Draw about a million rows of positive weight; return them and their weights."""
    found = survey(blocks, 1, np.random.default_rng(rng))
    return found.rows, found.weights


def write_block_labels(path: StrPath, labels: Any, blocks: Blocks, *, overwrite: bool = False) -> int:
    """Write the labels of rows in blocks as `write_row_labels` does, and return the number of rows of the file."""
    given = labels if blocks.kept is None else blocks.kept
    n_rows = int(given.shape[0])
    write_label_parts(path, n_rows, _parts(labels, blocks.kept), overwrite=overwrite)
    return n_rows


def _parts(labels: Any, kept: Any) -> Iterator[NDArray[np.int32]]:
    if kept is None:
        yield from (part for (part,) in blocks_of(labels))
        return
    for part, inside in blocks_of(labels, kept):
        whole = np.full(len(inside), -1, np.int32)
        whole[inside] = part
        yield whole
