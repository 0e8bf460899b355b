"""Lloyd's method over blocks of samples that are larger than memory, on one machine or on many.

The search is on a sample in memory, drawn block by block, and only the descent is over all blocks. Its passes are sums
over the blocks: K x (D + 1) numbers for each, whatever its size. They are added along a fixed tree, so the result
depends on nothing but the samples, their blocks and the seed: it has the same bits for any number of workers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cvtimg._shared.budgets import MOST_IN_MEMORY, ROWS_AT_ONCE
from cvtimg._shared.checks import as_samples, check_count, check_that
from cvtimg._shared.iteration import iterate
from cvtimg._shared.types import Array, Floats, Ints, Ints64
from cvtimg.blocks.passes import Block, map_rows, over_blocks
from cvtimg.blocks.rows import Blocks
from cvtimg.blocks.spread import Spread
from cvtimg.engine.methods import Conditions, Iteration
from cvtimg.engine.points import Frame, RowMoments, assign, assign_rows, pack, scale_within
from cvtimg.engine.search import ROWS_PER_GENERATOR
from cvtimg.engine.seeding import TooFewSamplesError, refill
from cvtimg.files.arrays import UnfitArraysError, load_arrays, save_arrays
from cvtimg.files.remote import exists
from cvtimg.files.whole import StrPath

_CHECKPOINT = "checkpoint"


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What the first pass over the blocks finds, and a sample of rows of positive weight, drawn block by block."""

    lengths: Ints64  # (B,) rows of each block
    spread: Spread  # of all rows
    rows: Array  # (n, D) the sample
    weights: Floats  # (n,)

    @property
    def frame(self) -> Frame:
        """A frame about the mean of all rows, in which every block is packed."""
        spread = self.spread
        if self.rows.dtype.kind == "f":
            return Frame(spread.means, scale_within(spread.low, spread.high, spread.means))
        return Frame(np.rint(spread.means), 1.0)

    def fingerprint(self, *options: object) -> str:
        """Name the samples and some options, for `Checkpoint`."""
        digest = hashlib.sha256(repr((self.spread.mass, self.rows.dtype, *options)).encode())
        for array in (self.lengths, self.spread.means, self.rows, self.weights):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    @staticmethod
    def total(parts: Sequence[Survey]) -> Survey:
        """Join the surveys of consecutive blocks."""
        names = "lengths", "rows", "weights"
        lengths, *sample = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
        return Survey(lengths, Spread.total([part.spread for part in parts]), *sample)


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A file or URL with generators, and the energies that led to them."""

    path: StrPath | None  # The file; None to save nothing
    job: str  # Names the samples and the options. The state of another job is refused.

    def load(self) -> tuple[Floats, list[float]] | None:
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

    def save(self, generators: Floats, energies: Sequence[float]) -> None:
        """Write the state, whole or not at all."""
        if self.path is not None:
            state = {"job": self.job, "generators": generators, "energies": np.array(energies, np.float64)}
            save_arrays(self.path, _CHECKPOINT, state, overwrite=True)


def survey(blocks: Blocks, n_generators: int, rng: np.random.Generator) -> Survey:
    """Check all blocks, measure them, and draw a sample; there must be as many rows as generators."""
    lengths = over_blocks(blocks, _length, np.concatenate) if blocks.lengths is None else blocks.lengths
    n_generators = check_count("n_generators", n_generators, int(sum(lengths)), "the number of samples")
    most = max(ROWS_PER_GENERATOR * n_generators, min(ROWS_AT_ONCE, MOST_IN_MEMORY // 2 // blocks.n_dims))
    seed, n_rows = int(rng.integers(1 << 62)), int(sum(lengths))
    measured = over_blocks(blocks, _survey_block, Survey.total, n_rows <= most)
    check_that("density", measured.spread.mass > 0, "not be 0 for all samples")
    if n_rows <= most:
        return measured
    spread = measured.spread
    rule = seed, np.cumsum([0, *lengths]), most / 2, spread.mass, spread.means, spread.energy()
    rows, weights = over_blocks(blocks, _draw_from_block, _joined, *rule)
    return replace(measured, rows=rows, weights=weights)


def sample_rows(blocks: Blocks, surveyed: Survey, n_generators: int) -> tuple[Array, Floats]:
    """Return the sample and its weights, with rows that it lacks if it has too few that differ."""
    rows, weights = surveyed.rows, surveyed.weights
    if len(_some_distinct([rows], n_generators)) < n_generators:
        rare = over_blocks(blocks, _distinct_block, partial(_some_distinct, most=n_generators), n_generators)
        if len(rare) < n_generators:
            raise TooFewSamplesError(n_generators, len(rare))
        rows, weights = np.concatenate([rows, rare]), np.append(weights, np.ones(len(rare)))
    return rows, weights


def descend(
    blocks: Blocks,
    frame: Frame,
    sample: tuple[Array, Floats],
    generators: Floats,
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
    moments: RowMoments

    def measure() -> float:
        nonlocal moments
        if not conditions.watch.stopped:  # a search that was stopped is to be done again
            checkpoint.save(generators, known)
        # Whole places give sums of integers that are exact, and so the same for any blocks.
        whole = generators if blocks.rows.dtype.kind == "f" else np.rint(generators)
        moments = over_blocks(blocks, _moments_of_block, _total, generators, whole, frame)
        moments = moments.about(generators, generators - whole)
        known.append(float(moments.energies.sum()))
        return known[-1]

    def step() -> float:
        nonlocal generators
        full, moves = moments.masses > 0, np.zeros_like(generators)
        np.divide(moments.steps, moments.masses[:, None], out=moves, where=(free & full)[:, None])
        generators = generators + moves
        if (free & ~full).any():
            points = pack(*sample)
            places = points.frame.inward(generators)
            refilled = refill(points, places, assign(points, places), moments.masses, conditions.n_locked)
            moved = (refilled != places).any(axis=1)
            generators[moved] = points.frame.outward(refilled[moved])
        return measure()

    history = iterate(measure(), step, conditions.stopping, conditions.watch, energies)
    return Iteration(generators, *history), moments


def label_blocks(blocks: Blocks, lengths: Ints64, generators: Floats, frame: Frame) -> Any:
    """Return the (N,) int32 labels as a Dask array, in the same blocks, which is computed when it is needed."""
    label = partial(_label_rows, generators=generators, frame=frame)
    return map_rows(blocks, label, np.int32, lengths=tuple(lengths.tolist()))


def _length(block: Block) -> Ints64:
    return np.array([len(block.rows)])


def _total(parts: Sequence[RowMoments]) -> RowMoments:
    """Add moments in their order."""
    return RowMoments(*(np.sum(some, axis=0) for some in zip(*parts, strict=True)))


def _survey_block(block: Block, all_rows: bool) -> Survey:
    """Measure a block, and keep all rows of positive weight, or none."""
    none = as_samples("samples", block.rows[:0]), np.zeros(0)
    surveys = [Survey(np.zeros(0, np.int64), Spread.of(*none), *none)]
    for rows, weights in block.pieces():
        kept = (rows[weights > 0], weights[weights > 0]) if all_rows else none
        surveys.append(Survey(np.zeros(0, np.int64), Spread.of(rows, weights), *kept))
    return replace(Survey.total(surveys), lengths=_length(block))


def _draw_from_block(
    block: Block, seed: int, ends: Ints64, half: float, mass: float, mean: Floats, energy: float
) -> tuple[Array, Floats]:
    """Draw rows, those that are far from the mean more often, with weights that make up for it, as `thin` does."""
    # By a number for each row of all, so that the sample is the same for any blocks of the same rows.
    numbers = np.random.Generator(np.random.PCG64(seed).advance(int(ends[block.number])))
    samples = [(as_samples("samples", block.rows[:0]), np.zeros(0))]
    for rows, weights in block.pieces():
        steps = rows - mean
        chances = half * weights / mass + half * weights * np.einsum("nd,nd->n", steps, steps) / (energy or 1.0)
        drawn = numbers.random(len(rows)) < chances
        samples.append((rows[drawn], weights[drawn] / np.minimum(chances[drawn], 1.0)))
    return _joined(samples)


def _joined(parts: Sequence[tuple[Array, Floats]]) -> tuple[Array, Floats]:
    rows, weights = zip(*parts, strict=True)
    return np.concatenate(rows), np.concatenate(weights)


def _moments_of_block(block: Block, generators: Floats, places: Floats, frame: Frame) -> RowMoments:
    """Sum about the places, by the nearest generators."""
    none = np.zeros(len(generators))
    moments = [RowMoments(none, np.zeros_like(generators), none)]
    for rows, weights in block.pieces():
        labels = _label_rows(rows, generators=generators, frame=frame)
        moments.append(RowMoments.of(rows, weights, places, labels))
    return _total(moments)


def _label_rows(rows: Array, *, generators: Floats, frame: Frame) -> Ints:
    return assign_rows(rows, generators, pack(rows, np.ones(len(rows)), frame=frame))


def _distinct_block(block: Block, most: int) -> Array:
    return _some_distinct([rows[weights > 0] for rows, weights in block.pieces()], most)


def _some_distinct(several: Sequence[Array], most: int) -> Array:
    """Return some of the distinct rows, as many as there are if these are fewer than `most`."""
    return np.unique(np.concatenate(several), axis=0)[:most]
