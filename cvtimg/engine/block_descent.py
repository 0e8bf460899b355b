"""Lloyd's method over blocks of samples that are larger than memory, on one machine or on many.

The search is on a sample in memory, drawn block by block, and only the descent is over all blocks. Its passes are sums
over the blocks: K x (D + 1) numbers for each, whatever its size. They are added along a fixed tree, so the result
depends on nothing but the samples, their blocks and the seed: it has the same bits for any number of workers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import as_samples, check_count, check_that, raise_unsupported
from cvtimg._shared.iteration import iterate
from cvtimg.blocks.passes import Block, map_rows, over_blocks
from cvtimg.blocks.rows import Blocks
from cvtimg.engine.methods import Conditions, Iteration
from cvtimg.engine.points import Frame, RowMoments, assign, assign_rows, pack, scale_within
from cvtimg.engine.seeding import TooFewSamplesError, refill
from cvtimg.files.arrays import UnfitArraysError, load_arrays, save_arrays
from cvtimg.files.remote import exists
from cvtimg.files.whole import StrPath

_CHECKPOINT = "checkpoint"
#: The sample has at most this many rows and values, but this many rows per generator.
_SAMPLE_ROWS = 1 << 20
_SAMPLE_VALUES = 1 << 25
_ROWS_PER_GENERATOR = 64


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What the first pass over the blocks finds, and a sample of rows of positive weight, drawn block by block."""

    lengths: NDArray[np.int64]  # (B,) rows of each block
    mass: float  # sum of the weights
    sums: NDArray[np.float64]  # (D,) sum of weight times row
    low: NDArray[np.float64]  # (D,) limits of the rows
    high: NDArray[np.float64]
    rows: NDArray[Any]  # (n, D) the sample
    weights: NDArray[np.float64]  # (n,)

    @property
    def frame(self) -> Frame:
        """A frame about the mean of all rows, in which every block is packed."""
        center = self.sums / self.mass
        if self.rows.dtype.kind == "f":
            return Frame(center, scale_within(self.low, self.high, center))
        return Frame(np.rint(center), 1.0)

    def fingerprint(self, *options: object) -> str:
        """Name the samples and some options, for `Checkpoint`."""
        digest = hashlib.sha256(repr((self.mass, self.rows.dtype, *options)).encode())
        for array in (self.lengths, self.sums, self.rows, self.weights):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    @staticmethod
    def total(parts: Sequence[Survey]) -> Survey:
        """Join the surveys of consecutive blocks."""
        return Survey(
            np.concatenate([part.lengths for part in parts]),
            sum(part.mass for part in parts),
            np.sum([part.sums for part in parts], axis=0),
            np.min([part.low for part in parts], axis=0),
            np.max([part.high for part in parts], axis=0),
            np.concatenate([part.rows for part in parts]),
            np.concatenate([part.weights for part in parts]),
        )


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A file or URL with generators, and the energies that led to them."""

    path: StrPath | None  # The file; None to save nothing
    job: str  # Names the samples and the options. The state of another job is refused.

    def load(self) -> tuple[NDArray[np.float64], list[float]] | None:
        """Return what was saved, or None if there is no file; a file of another job is refused."""
        if self.path is None or not exists(self.path):
            return None
        try:
            state = load_arrays(self.path, _CHECKPOINT, ("job", "generators", "energies"))
        except UnfitArraysError as error:
            raise ValueError(f"checkpoint={str(self.path)!r} must be a file that an earlier run saved") from error
        same = str(state["job"]) == self.job
        check_that(f"checkpoint={str(self.path)!r}", same, "be of the same samples, blocks and options")
        return state["generators"], state["energies"].tolist()

    def save(self, generators: NDArray[np.float64], energies: Sequence[float]) -> None:
        """Write the state, whole or not at all."""
        if self.path is not None:
            state = {"job": self.job, "generators": generators, "energies": np.array(energies, np.float64)}
            save_arrays(self.path, _CHECKPOINT, state, overwrite=True)


def survey(blocks: Blocks, n_generators: int, rng: np.random.Generator) -> Survey:
    """Check all blocks, measure them, and draw a sample; there must be as many rows as generators."""
    lengths = over_blocks(blocks, _length, np.concatenate) if blocks.lengths is None else blocks.lengths
    check_count("n_generators", n_generators, int(sum(lengths)), "the number of samples")
    most = max(_ROWS_PER_GENERATOR * n_generators, min(_SAMPLE_ROWS, _SAMPLE_VALUES // blocks.n_dims))
    found = over_blocks(blocks, _survey_block, Survey.total, int(rng.integers(1 << 62)), np.cumsum([0, *lengths]), most)
    check_that("density", found.mass > 0, "not be 0 for all samples")
    return found


def sample_rows(blocks: Blocks, found: Survey, n_generators: int) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Return the sample and its weights, with rows that it lacks if it has too few that differ."""
    rows, weights = found.rows, found.weights
    if len(_some_distinct([rows], n_generators)) < n_generators:
        rare = over_blocks(blocks, _distinct_block, partial(_some_distinct, most=n_generators), n_generators)
        if len(rare) < n_generators:
            raise TooFewSamplesError(n_generators, len(rare))
        rows, weights = np.concatenate([rows, rare]), np.append(weights, np.ones(len(rare)))
    return rows, weights


def check_by_blocks(method: object, volume_power: float) -> None:
    """Refuse what cannot be done with blocks, where only sums over cells are known."""
    if method not in (None, "lloyd"):
        raise_unsupported("method", method, "samples in blocks", ["'lloyd'"])
    if volume_power:
        raise_unsupported("volume_power", volume_power, "samples in blocks", ["0"])


def descend(
    blocks: Blocks,
    frame: Frame,
    sample: tuple[NDArray[Any], NDArray[np.float64]],
    generators: NDArray[np.float64],
    energies: Sequence[float],
    conditions: Conditions,
    checkpoint: Checkpoint,
) -> tuple[Iteration, RowMoments]:
    """Iterate Lloyd's method over all blocks, from some generators and the energies that led to them.

    All is in the units of the samples. Also return the moments of the cells.
    """
    # Empty cells, which are rare after a search, are refilled from the sample, rows and weights.
    free = np.arange(len(generators)) >= conditions.n_locked
    known = list(energies)
    found: RowMoments

    def measure() -> float:
        nonlocal found
        checkpoint.save(generators, known)
        # Whole places give sums of integers that are exact, and so the same for any blocks.
        whole = _whole(blocks, generators)
        found = over_blocks(blocks, _moments_of_block, _total, generators, whole, frame)
        found = found.about(generators, generators - whole)
        known.append(float(found.energies.sum()))
        return known[-1]

    def step() -> float:
        nonlocal generators
        full = found.masses > 0
        moves = np.divide(
            found.steps, found.masses[:, None], out=np.zeros_like(generators), where=(free & full)[:, None]
        )
        generators = generators + moves
        if (free & ~full).any():
            points = pack(*sample)
            places = points.frame.inward(generators)
            refilled = refill(points, places, assign(points, places), free & full, free & ~full)
            moved = (refilled != places).any(axis=1)
            generators[moved] = points.frame.outward(refilled[moved])
        return measure()

    history = iterate(measure(), step, conditions.stopping, conditions.watch, energies)
    return Iteration(generators, *history), found


def label_blocks(blocks: Blocks, lengths: NDArray[np.int64], generators: NDArray[np.float64], frame: Frame) -> Any:
    """Return the (N,) int32 labels as a Dask array, in the same blocks, which is computed when it is needed."""
    label = partial(_label_rows, generators=generators, frame=frame)
    return map_rows(blocks, label, np.int32, lengths=tuple(lengths.tolist()))


def _length(block: Block) -> NDArray[np.int64]:
    return np.array([len(block.rows)])


def _total(parts: Sequence[RowMoments]) -> RowMoments:
    """Add moments in their order."""
    return RowMoments(*(np.sum(some, axis=0) for some in zip(*parts, strict=True)))


def _survey_block(block: Block, seed: int, ends: NDArray[np.int64], most: int) -> Survey:
    n_rows, n_dims = block.rows.shape
    mass, sums = 0.0, np.zeros(n_dims)
    low, high = np.full(n_dims, np.inf), np.full(n_dims, -np.inf)
    for rows, weights in block.pieces():
        mass += float(weights.sum())
        sums += np.einsum("n,nd->d", weights, rows)
        low, high = np.minimum(low, rows.min(axis=0)), np.maximum(high, rows.max(axis=0))
    members = np.arange(n_rows) if block.weights is None else np.flatnonzero(block.weights)
    if len(members) and most < ends[-1]:
        start = int(ends[block.number])
        drawn = drawn_rows(int(ends[-1]), most, start, start + n_rows, seed) - start
        # In place of a row without weight, the next that has some.
        members = members[np.unique(np.minimum(np.searchsorted(members, drawn), len(members) - 1))]
    weights = np.ones(len(members)) if block.weights is None else block.weights[members].astype(np.float64)
    return Survey(np.array([n_rows]), mass, sums, low, high, as_samples("samples", block.rows[members]), weights)


def drawn_rows(n_rows: int, most: int, start: int, stop: int, seed: int) -> NDArray[np.int64]:
    """Draw one of each `most` equal parts of all rows, and return those in start..stop - 1.

    So the sample is the same for any blocks of the same rows.
    """
    first, last = max(start * most // n_rows - 1, 0), min(stop * most // n_rows + 2, most)
    parts = np.arange(first, last)
    begins, ends = parts * n_rows // most, (parts + 1) * n_rows // most
    # A number for each part, whichever of them are needed.
    places = np.random.Generator(np.random.PCG64(seed).advance(first)).random(len(parts))
    rows = begins + (places * (ends - begins)).astype(np.int64)
    return rows[(rows >= start) & (rows < stop)]


def _whole(blocks: Blocks, generators: NDArray[np.float64]) -> NDArray[np.float64]:
    return generators if blocks.rows.dtype.kind == "f" else np.rint(generators)


def _moments_of_block(
    block: Block, generators: NDArray[np.float64], places: NDArray[np.float64], frame: Frame
) -> RowMoments:
    """Sum about the places, by the nearest generators."""
    none = np.zeros(len(generators))
    found = [RowMoments(none, np.zeros_like(generators), none)]
    for rows, weights in block.pieces():
        labels = _label_rows(rows, generators=generators, frame=frame)
        found.append(RowMoments.of(rows, weights, places, labels))
    return _total(found)


def _label_rows(rows: NDArray[Any], *, generators: NDArray[np.float64], frame: Frame) -> NDArray[np.int32]:
    return assign_rows(rows, generators, pack(rows, np.ones(len(rows)), frame=frame))


def _distinct_block(block: Block, most: int) -> NDArray[Any]:
    return _some_distinct([rows[weights > 0] for rows, weights in block.pieces()], most)


def _some_distinct(several: Sequence[NDArray[Any]], most: int) -> NDArray[Any]:
    """Return some of the distinct rows, as many as there are if these are fewer than `most`."""
    return np.unique(np.concatenate(several), axis=0)[:most]
