"""``cvtimg cluster`` on tables larger than memory: what it finds is what it finds in memory, here or by a URL."""

import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import RowOf, Run

from cvtimg._shared.types import Array
from cvtimg.files.remote import local_copy

pytest.importorskip("dask")
pa = pytest.importorskip("pyarrow")
zarr = pytest.importorskip("zarr")
from pyarrow import parquet  # noqa: E402

RNG = np.random.default_rng(4)
ROWS = np.concatenate([RNG.normal(at, 1, (200, 2)) for at in ((0, 0), (30, 0), (0, 40))])
ROWS = RNG.permutation(ROWS).round(3)
WEIGHTS = RNG.integers(1, 4, len(ROWS))
FILES = ("a.parquet", "a.zarr", "a.npy", "a.csv")


def write_tables(folder: Path, rows: Array = ROWS) -> None:
    columns = np.column_stack([rows, WEIGHTS])
    missing = np.isnan(rows[:, 0])
    table = pa.table({"x": pa.array(rows[:, 0], mask=missing), "y": rows[:, 1], "n": WEIGHTS})
    parquet.write_table(table, folder / "a.parquet", row_group_size=170)
    zarr.create_array(str(folder / "a.zarr"), data=columns, chunks=(100, 3), overwrite=True)
    np.save(folder / "a.npy", columns)
    np.savetxt(folder / "a.csv", columns, "%.17g", ",", header="x,y,n", comments="")


@pytest.fixture(autouse=True)
def here(here: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("cvtimg.tables.files._LARGE_BYTES", 1000)
    monkeypatch.setattr("cvtimg.blocks.rows.BLOCK_BYTES", 200 * 24)
    write_tables(here)
    return here


@pytest.fixture
def memory() -> Iterator[Any]:
    files = pytest.importorskip("fsspec").filesystem("memory")
    yield files
    files.store.clear()
    files.pseudo_dirs[:] = [""]


@pytest.fixture
def cluster(row_of: RowOf) -> RowOf:
    return partial(row_of, "cluster", "-k", "3")


@pytest.mark.parametrize("options", [[], ["--standardize"], ["--weighted"]], ids=str)
def test_all_kinds_of_tables_give_the_same(here: Path, cluster: RowOf, options: list[str]) -> None:
    found = []
    for name in FILES:
        named = name.endswith((".parquet", ".csv"))
        columns = ["--columns", "x,y" if named else "col0,1"]
        given = ["--weight", "n" if named else "col2"] if options == ["--weighted"] else options
        row = cluster(name, *columns, *given, "--generators", f"{name}-means.csv")
        Path(row["output"]).unlink()
        assert row["columns"] == (["x", "y"] if named else ["col0", "col1"])
        means = np.loadtxt(f"{name}-means.csv", delimiter=",", skiprows=1)
        assert means[:, 2].sum() == (WEIGHTS.sum() if options == ["--weighted"] else len(ROWS))
        found.append((row["energy"], row["explained"], means[np.lexsort(means.T[:2])].tolist(), row["output"]))
    for energy, explained, means, _ in found[:3]:
        assert energy == pytest.approx(found[3][0], rel=1e-3)
        assert explained == pytest.approx(found[3][1], rel=1e-3)
        np.testing.assert_allclose(means, found[3][2], atol=0.2)
    assert [output for *_, output in found] == ["a-labels.parquet", "a-labels.npy", "a-clusters.csv", "a-clusters.csv"]


def test_rows_without_a_value_are_dropped_or_named(here: Path, cluster: RowOf, run: Run) -> None:
    holed = ROWS.copy()
    holed[5, 0] = holed[200:400, 0] = np.nan  # among them all rows of a block
    write_tables(here, holed)
    for name in FILES[:3]:
        row = cluster(name, "--missing", "drop", "-o", f"{name}.csv")
        assert (row["rows"], row["left_out"]) == (len(ROWS) - 201, 201)
        labels = Path(f"{name}.csv").read_text().splitlines()[1:]
        assert [row for row, label in enumerate(labels) if label == '""'] == [5, *range(200, 400)]
    assert run("cluster", FILES[0], "-k", "3", "-o", "none.csv").err.startswith(f"cvtimg: {FILES[0]}: block 0: ")
    assert not Path("none.csv").exists()


def test_weights_that_are_all_zero_are_refused(run: Run) -> None:
    parquet.write_table(pa.table({"x": ROWS[:, 0], "n": 0 * WEIGHTS}), "zero.parquet")
    message = "cvtimg: zero.parquet: at least one row must be complete and of positive weight\n"
    assert run("cluster", "zero.parquet", "-k", "3", "--weight", "n", "--standardize") == (1, "", message)


@pytest.mark.slow
def test_the_number_is_read_from_a_sample(row_of: RowOf) -> None:
    assert row_of("cluster", "a.parquet", "-k", "auto", "--columns", "x,y")["k"] == 3


def test_folders_of_tables(here: Path, run: Run) -> None:
    (here / "many.parquet").mkdir()
    for number, part in enumerate(np.array_split(ROWS, 3)):
        parquet.write_table(pa.table({"x": part[:, 0], "y": part[:, 1]}), here / "many.parquet" / f"{number}.parquet")
    for name in FILES[2:]:
        Path(name).unlink()
    shutil.copytree("many.parquet", ".hidden/many.parquet")
    rows = run("cluster", ".", "-k", "3", "--out-dir", "out", "--json").rows
    assert [row["input"] for row in rows] == ["a.parquet", "a.zarr", "many.parquet"]
    assert {row["rows"] for row in rows} == {len(ROWS)}


def test_tables_elsewhere_are_read_in_parts(
    memory: Any, cluster: RowOf, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    copied = []

    def spy(path: Path) -> AbstractContextManager[Path]:
        copied.append(path.name)
        return local_copy(path)

    monkeypatch.setattr("cvtimg.batch.runner.local_copy", spy)
    for name in FILES:
        memory.put(name, f"/in/{name}", recursive=True)
    outcome = run("cluster", "memory://in", "-k", "3", "--out-dir", "memory://out", "--json")
    assert sorted(copied) == ["a.csv", "a.npy"]
    rows = {row["input"]: row for row in outcome.rows}
    assert list(rows) == [f"memory://in/{name}" for name in sorted(FILES)]
    for name in FILES:
        local = cluster(name)
        row = rows[f"memory://in/{name}"]
        assert row["energy"] == pytest.approx(local["energy"], rel=1e-6)
        memory.get(row["output"].removeprefix("memory:/"), "copy")
        assert Path("copy").read_bytes() == Path(local["output"]).read_bytes()
        Path(local["output"]).unlink()
    with memory.open("/in/broken.parquet", "wb") as file:
        file.write(b"no table")
    broken = "memory://in/broken.parquet"
    assert run("cluster", broken, "-k", "3", "-o", "b.csv").err.startswith(f"cvtimg: {broken}: ")


@pytest.mark.slow
@pytest.mark.timeout(280)
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_all_workers_of_a_cluster_share_the_blocks(here: Path, cluster: RowOf) -> None:
    pytest.importorskip("distributed")
    shared = cluster("a.parquet", "--dask", "local", "--jobs", "2", "-o", "shared.npy")
    alone = cluster("a.parquet", "-o", "alone.npy")
    assert shared["energy"] == alone["energy"]
    np.testing.assert_array_equal(np.load("shared.npy"), np.load("alone.npy"))


@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
def test_the_silhouette_is_that_of_scikit_learn(name: str, here: Path, cluster: RowOf) -> None:
    from sklearn.metrics import silhouette_score

    from cvtimg import tessellate

    row = cluster(name, "--columns", "x,y", "--silhouette", "--out-dir", "out")
    assert row["silhouette"] == pytest.approx(silhouette_score(ROWS, tessellate(ROWS, 3).labels), rel=0.02)
