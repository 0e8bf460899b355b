"""Samples in blocks give what samples in memory give, whoever works on the blocks, and say which block is wrong."""

import pickle
import tracemalloc
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference import squared_distances

from cvtimg import tessellate
from cvtimg._shared.budgets import ROWS_AT_ONCE
from cvtimg._shared.types import Array, Floats
from cvtimg.blocks import BlockError, Blocks, Spread, as_blocks, open_blocks, passes
from cvtimg.blocks.rows import is_blocked
from cvtimg.engine import Tessellation, block_descent, search

dask = pytest.importorskip("dask")
import dask.array as da  # noqa: E402

RNG = np.random.default_rng(12)
ROWS = np.concatenate([RNG.normal(center, 1, (500, 3)) for center in ((0, 0, 0), (9, 0, 0), (0, 9, 3), (5, 5, 20))])
ROWS = RNG.permutation(ROWS)
WEIGHTS = RNG.integers(0, 4, len(ROWS)).astype(np.float64)


@pytest.fixture
def small_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search on fewer rows than there are."""
    monkeypatch.setattr(block_descent, "ROWS_AT_ONCE", 600)
    monkeypatch.setattr(block_descent, "ROWS_PER_GENERATOR", 20)


def blocks(rows: Array = ROWS, weights: Array | None = WEIGHTS, length: int = 170) -> Blocks:
    given = None if weights is None else da.from_array(weights, chunks=length)
    return as_blocks(da.from_array(rows, chunks=(length, 2)), given)


def same_bits(first: Tessellation, second: Tessellation) -> bool:
    arrays = [(first.generators, second.generators), (first.masses, second.masses)]
    return all((a == b).all() for a, b in arrays) and first.energies == second.energies


# The result


@pytest.mark.usefixtures("small_sample")
@pytest.mark.parametrize("n_generators", [4, 45])
def test_it_is_a_tessellation_of_all_samples(n_generators: int) -> None:
    result = tessellate(blocks(), n_generators)
    squares = squared_distances(ROWS, result.generators)
    labels = result.labels.compute()
    assert (squares[np.arange(len(labels)), labels] <= squares.min(axis=1) * (1 + 1e-5)).all()
    np.testing.assert_allclose(result.masses, np.bincount(labels, WEIGHTS, n_generators))
    assert result.energy == pytest.approx((WEIGHTS * squares.min(axis=1)).sum(), rel=1e-6)
    # So few rows are searched with more effort where they are in memory.
    assert result.energy <= 1.05 * tessellate(ROWS, n_generators, density=WEIGHTS).energy


@pytest.mark.parametrize(("effort", "beyond"), [("fast", "fast"), ("balanced", "best"), ("best", "best")])
def test_a_sample_of_many_more_rows_is_worth_the_best_search(effort: Any, beyond: Any) -> None:
    assert search.effort_beyond(search.EFFORTS[effort], 9000, 1000) == search.EFFORTS[beyond]
    assert search.effort_beyond(search.EFFORTS[effort], 1000, 1000) == search.EFFORTS[effort]


@pytest.mark.usefixtures("small_sample")
def test_bits_do_not_depend_on_who_works() -> None:
    found = []
    for scheduler in ("sync", "threads"):
        with dask.config.set(scheduler=scheduler, num_workers=3):
            found.append((result := tessellate(blocks(length=400), 12, rng=3), result.labels.compute()))
    assert same_bits(found[0][0], found[1][0])
    np.testing.assert_array_equal(found[0][1], found[1][1])


@pytest.mark.usefixtures("small_sample")
def test_bits_do_not_depend_on_pieces_of_one_tile(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = RNG.integers(0, 256, (4000, 3)).astype(np.uint8)  # whose sums are exact
    expected = tessellate(as_blocks(da.from_array(rows, chunks=(900, 3))), 7)
    monkeypatch.setattr(passes, "ROWS_AT_ONCE", 100)
    assert same_bits(expected, tessellate(as_blocks(da.from_array(rows, chunks=(900, 3))), 7))


@pytest.mark.usefixtures("small_sample")
def test_integers_give_the_same_for_any_blocks_once_the_start_is_given() -> None:
    rows = RNG.integers(0, 256, (900, 3)).astype(np.uint8)
    results = [tessellate(as_blocks(da.from_array(rows, chunks=n)), 5, init=rows[:5]) for n in (100, 333, 900)]
    assert same_bits(results[0], results[1])
    assert same_bits(results[0], results[2])
    in_memory = tessellate(rows, 5, init=rows[:5])
    np.testing.assert_allclose(results[0].generators, in_memory.generators, rtol=1e-9)


def test_one_dimension_starts_from_the_optimum() -> None:
    rows = ROWS[:, :1]
    result = tessellate(as_blocks(da.from_array(rows, chunks=(300, 1))), 6)
    assert result.energy == pytest.approx(tessellate(rows, 6).energy, rel=1e-4)


def test_locked_generators_stay() -> None:
    locked = [[50.0, 50, 50], [0, 0, 0]]
    result = tessellate(blocks(), 6, locked=locked)
    np.testing.assert_allclose(result.generators[:2], locked, atol=1e-12)
    assert result.masses[0] == 0


def test_empty_cells_are_refilled() -> None:
    start = np.concatenate([ROWS[:3], np.full((2, 3), 1e4)])
    result = tessellate(blocks(), 5, init=start)
    assert (result.masses > 0).all()
    assert np.abs(result.generators).max() < 100


@pytest.mark.slow
@pytest.mark.usefixtures("small_sample")
def test_rare_rows_that_the_sample_misses_are_found() -> None:
    rows = np.zeros((3000, 2))
    rows[::700] = np.arange(5)[:, None] + 7.0
    result = tessellate(as_blocks(da.from_array(rows, chunks=(500, 2))), 6)
    assert result.energy == pytest.approx(0, abs=1e-9)
    with pytest.raises(ValueError, match=r"n_generators=7 must be in 1..6, the number of distinct samples"):
        tessellate(as_blocks(da.from_array(rows, chunks=(500, 2))), 7)


# Where blocks come from


def test_lengths_may_be_unknown() -> None:
    unknown = blocks().rows[da.from_array(np.ones(len(ROWS), bool), chunks=170)]
    weights = blocks().weights[da.from_array(np.ones(len(ROWS), bool), chunks=170)]
    assert as_blocks(unknown).lengths is None
    result = tessellate(as_blocks(unknown, weights), 4)
    assert same_bits(result, tessellate(blocks(), 4))
    assert len(result.labels) == len(ROWS)


def test_a_zarr_array_is_read_in_its_chunks(tmp_path: Path) -> None:
    zarr = pytest.importorskip("zarr")
    stored = zarr.create_array(str(tmp_path / "a.zarr"), shape=ROWS.shape, chunks=(100, 3), dtype="f8")
    stored[:] = ROWS
    assert is_blocked(stored)
    for opened in (as_blocks(stored), open_blocks(tmp_path / "a.zarr")):
        np.testing.assert_array_equal(opened.rows.compute(), ROWS)
        assert opened.lengths is not None
        assert all(length % 100 == 0 for length in opened.lengths)


def test_a_file_of_numpy_is_read_in_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.save(tmp_path / "a.npy", ROWS)
    monkeypatch.setattr("cvtimg.blocks.rows.BLOCK_BYTES", 170 * 24)
    opened = open_blocks(tmp_path / "a.npy")
    assert opened.n_blocks == 12
    np.testing.assert_array_equal(opened.rows.compute(), ROWS)
    assert same_bits(tessellate(opened, 4), tessellate(blocks(weights=None), 4))
    assert len(pickle.dumps(opened)) < ROWS.nbytes / 2  # workers read for themselves
    assert same_bits(tessellate(opened, 4), tessellate(open_blocks(tmp_path / "a.npy", columns=["col0", "1", "2"]), 4))
    np.save(tmp_path / "b.npy", ROWS[:, 0])
    assert open_blocks(tmp_path / "b.npy").rows.shape == (len(ROWS), 1)


def test_columns_of_parquet(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    columns = {"w": WEIGHTS, "x": ROWS[:, 0].astype(np.float32), "y": ROWS[:, 1], "n": np.arange(len(ROWS))}
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet", row_group_size=300)
    opened = open_blocks(tmp_path / "a.parquet", columns=["y", "x"], weight="w")
    np.testing.assert_array_equal(opened.rows.compute(), np.stack([columns["y"], columns["x"]], axis=1))
    np.testing.assert_array_equal(opened.weights.compute(), WEIGHTS)
    assert opened.n_blocks == 7
    assert open_blocks(tmp_path, weight="w").n_dims == 3
    with pytest.raises(ValueError, match=r"column='z' must be one of w, x, y, n"):
        open_blocks(tmp_path / "a.parquet", columns=["z"])
    holed = pa.table({"x": pa.array([1.0, None, 2.0])})
    parquet.write_table(holed, tmp_path / "b.parquet")
    with pytest.raises(BlockError, match=r"block 0: .*column 'x' of row group 0 must have no missing values"):
        tessellate(open_blocks(tmp_path / "b.parquet"), 2)


def test_files_of_one_table_may_have_other_types_of_numbers(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    for number, part in enumerate(([1, 2], [0.5, 1.5])):
        parquet.write_table(pa.table({"x": part}), tmp_path / f"{number}.parquet")
    np.testing.assert_array_equal(open_blocks(tmp_path).rows.compute().ravel(), [1, 2, 0.5, 1.5])
    parquet.write_table(pa.table({"x": [True, None]}), tmp_path / "2.parquet")
    np.testing.assert_array_equal(open_blocks(tmp_path, missing="drop").rows.compute().ravel(), [1, 2, 0.5, 1.5, 1])


def test_what_is_no_table_of_numbers_is_named(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    names = pa.array(["a", "b"])
    for kind, column in (("string", names), ("dictionary", names.dictionary_encode())):
        parquet.write_table(pa.table({"x": [1, 2], "name": column}), tmp_path / "a.parquet")
        assert open_blocks(tmp_path / "a.parquet").names == ("x",)  # what is no number is left out, unless asked for
        with pytest.raises(ValueError, match=rf"a\.parquet: column 'name' of type {kind}.* must be of numbers"):
            open_blocks(tmp_path / "a.parquet", columns=["name"])
    parquet.write_table(pa.table({"x": pa.array([], pa.float64())}), tmp_path / "a.parquet")
    with pytest.raises(ValueError, match=r"a\.parquet must have rows"):
        open_blocks(tmp_path / "a.parquet")
    (tmp_path / "a.parquet").write_bytes(b"PAR1")
    with pytest.raises(OSError, match=r"a\.parquet: is not a Parquet file"):
        open_blocks(tmp_path / "a.parquet")
    (tmp_path / "a.zarr").mkdir()
    pytest.importorskip("zarr")
    with pytest.raises(OSError, match=r"a\.zarr: is not a Zarr array"):
        open_blocks(tmp_path / "a.zarr")


# What is wrong is said with the number of the block


def _unreadable(start: int) -> Floats:
    if start == 8:
        raise OSError("disk on fire")
    return ROWS[start : start + 4]


def promised(read: Callable[[Any], Any], given: Sequence[Any]) -> Any:
    """Return an array of blocks (4, 3), which are read when they are needed."""
    return da.concatenate([da.from_delayed(dask.delayed(read)(one), (4, 3), float) for one in given])


def changed(values: Array, place: Any, value: float) -> Array:
    values = values.copy()
    values[place] = value
    return values


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (lambda: blocks(changed(ROWS, (400, 1), np.nan)), "block 2: samples must be finite: it contains NaN or infin"),
        (lambda: blocks(weights=changed(WEIGHTS, 1000, -1)), "block 5: weights must be finite and >= 0"),
        (lambda: promised(np.ones, [(4, 3), (4, 3), (4, 2)]), r"block 2: samples of shape \(4, 2\) must be \(4, 3\)"),
        (lambda: promised(np.ones, [(4, 3), (5, 3)]), r"block 1: samples of shape \(5, 3\) must be \(4, 3\)"),
        (lambda: promised(_unreadable, range(0, 16, 4)), r"block 2: cannot be read \(OSError: disk on fire\)"),
    ],
)
def test_a_block_that_is_wrong_is_named(samples: Callable[[], Any], message: str) -> None:
    with pytest.raises(BlockError, match=message) as raised:
        tessellate(samples(), 1)
    assert str(raised.value).startswith(f"block {raised.value.number}: ")
    assert str(pickle.loads(pickle.dumps(raised.value))) == str(raised.value)


def test_a_block_that_ends_its_workers_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    tasks: list[str] = []

    def lose(total: Any, **options: Any) -> None:
        keys = [str(key) for key in total.__dask_graph__()]
        tasks.append(next(key for key in keys if key.startswith("cvtimg-block") and key.endswith("-4")))
        raise distributed.KilledWorker(tasks[0], None, 3)

    monkeypatch.setattr(passes, "_compute", lose)
    with pytest.raises(BlockError, match=r"block 4: 4 workers were lost while they worked on it"):
        tessellate(blocks(), 3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tessellate(blocks(), 3, method="macqueen"), r"method='macqueen' does not support samples in blocks;"),
        (lambda: tessellate(blocks(), 3, volume_power=1), r"volume_power=1.0 does not support samples in blocks; 0"),
        (lambda: tessellate(blocks(), 3, density=WEIGHTS), "density must not be given with Blocks, which carry their"),
        (lambda: tessellate(blocks(weights=0 * WEIGHTS), 3), r"density must not be 0 for all samples"),
        (lambda: tessellate(blocks(), 2001), r"n_generators=2001 must be in 1..2000, the number of samples"),
        (lambda: tessellate(da.ones(4), 1), r"samples of shape \(4,\) must be \(N, D\)"),
        (lambda: tessellate(da.ones((4, 2)), 1, density=np.ones(3)), r"density of shape \(3,\) must be \(4,\), one we"),
        (lambda: tessellate(da.ones((4, 2), dtype=complex), 1), "samples of type complex128 must be"),
        (lambda: tessellate(ROWS, 2, checkpoint="a.npz"), "checkpoint needs samples in blocks"),
    ],
)
def test_what_blocks_do_not_have_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        call()


# A run that was cut off


def test_a_checkpoint_of_other_samples_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "state.npz"
    tessellate(blocks(), 3, checkpoint=path)
    for other in (
        lambda: tessellate(blocks(ROWS + 1), 3, checkpoint=path),
        lambda: tessellate(blocks(), 4, checkpoint=path),
    ):
        with pytest.raises(ValueError, match=r"checkpoint=.* must be of the same samples, blocks and options"):
            other()
    path.write_bytes(b"other")
    with pytest.raises(ValueError, match=r"checkpoint=.* must be a file that an earlier run saved"):
        tessellate(blocks(), 3, checkpoint=path)
    assert path.read_bytes() == b"other"


@pytest.mark.usefixtures("small_sample")
def test_the_same_rows_are_drawn_whatever_the_blocks_and_far_ones_always() -> None:
    rows = RNG.integers(0, 256, (20_000, 2)).astype(np.float64)
    rows[777] = 1e6
    surveys = [
        block_descent.survey(as_blocks(da.from_array(rows, chunks=n)), 3, np.random.default_rng(1))
        for n in (333, 4000, 20_000)
    ]
    for found in surveys:
        np.testing.assert_array_equal(found.rows, surveys[0].rows)
        assert len(found.rows) < 2000
        assert found.weights[found.rows[:, 0] == 1e6] == 1
        np.testing.assert_allclose(found.weights.sum(), 20_000, rtol=0.1)
        np.testing.assert_allclose(found.spread.energy(), ((rows - rows.mean(axis=0)) ** 2).sum(), rtol=1e-9)


def test_what_is_made_of_rows_at_once_takes_less_than_100_mb() -> None:
    block = passes.Block(0, np.zeros((3 * ROWS_AT_ONCE, 3), np.uint8), None)
    tracemalloc.start()
    for rows, weights in block.pieces():
        Spread.of(rows, weights)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 50e6 < peak < 110e6
