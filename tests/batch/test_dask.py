"""A Dask cluster does the same work to the same bits, and a lost worker costs nothing but time."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cvtimg import find_palette, quantize, read_image, tessellate, write_image
from cvtimg.batch import Task, on_dask
from cvtimg.batch.tasks import Outcome
from cvtimg.cli import app as cli
from cvtimg.colors import color_samples

distributed = pytest.importorskip("distributed")
import dask  # noqa: E402
import dask.array as da  # noqa: E402

RNG = np.random.default_rng(41)
PICTURES = [RNG.normal(center, 25, (20, 30, 3)).clip(0, 255).astype(np.uint8) for center in (40, 90, 150, 220, 60)]
# Distributed leaves sockets to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.timeout(120),
]


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Run a scheduler and two workers in threads of this process."""
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
    threads = os.environ.get("CVTIMG_THREADS")
    with distributed.LocalCluster(protocol="tcp", **options) as cluster:
        yield cluster.scheduler_address
    from cvtimg._shared.threads import _pool, n_threads

    if threads is None:
        os.environ.pop("CVTIMG_THREADS", None)
    n_threads.cache_clear()
    _pool.cache_clear()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("in").mkdir()
    for number, picture in enumerate(PICTURES):
        write_image(f"in/{number}.png", picture)
    return tmp_path


@pytest.mark.parametrize("options", [[], ["--shared-palette"]])
def test_a_cluster_gives_the_same_files(scheduler: str, folder: Path, options: list[str]) -> None:
    command = ["quantize", "in", "-k", "9", "--quiet", *options, "--out-dir"]
    assert cli.main([*command, "one"]) == 0
    assert cli.main([*command, "two", "--dask", scheduler]) == 0
    for number in range(len(PICTURES)):
        assert Path(f"one/{number}.png").read_bytes() == Path(f"two/{number}.png").read_bytes()


@pytest.mark.parametrize("options", [[], ["--shared-palette"]])
def test_a_bad_picture_fails_alone(
    scheduler: str, folder: Path, capsys: pytest.CaptureFixture[str], options: list[str]
) -> None:
    Path("in/bad.png").write_text("no picture")
    assert cli.main(["quantize", "in", "-k", "9", "--out-dir", "out", "--dask", scheduler, "--quiet", *options]) == 1
    assert capsys.readouterr().err == "cvtimg: in/bad.png: cannot be read: unknown image format\n"
    assert len(list(Path("out").iterdir())) == len(PICTURES)


def test_rows_tell_which_worker_did_what(scheduler: str, folder: Path) -> None:
    command = ["quantize", "in", "-k", "9", "--quiet", "--report", "r.jsonl", "--out-dir", "out", "--dask", scheduler]
    assert cli.main(command) == 0
    rows = [json.loads(line) for line in Path("r.jsonl").read_text().splitlines()]
    assert len(rows) == len(PICTURES)
    assert {row["worker"] for row in rows} <= {"0", "1"}


def _ends_its_worker(task: Task) -> Outcome:
    if task.source.name == "bad":
        os._exit(9)
    task.output.write_text(task.source.name)
    return Outcome({"input": task.source.name})


@pytest.mark.slow
def test_a_task_that_ends_its_workers_fails_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Workers are processes that import this module.
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path(__file__).parents[2])])
    monkeypatch.setattr(on_dask, "_GROUPS_PER_THREAD", 1)
    names = ["a", "b", "bad", "c", "d", "e", "f", "g"]
    tasks = [Task((Path(name),), {"-o": tmp_path / name}) for name in names]
    with dask.config.set({"distributed.scheduler.allowed-failures": 1}):
        found = dict(on_dask.on_dask(_ends_its_worker, tasks, "local", 2))
    assert sorted(found) == list(range(len(tasks)))
    assert [names[place] for place, outcome in found.items() if outcome.why] == ["bad"]
    assert found[2].why == "2 workers were lost while they worked on it"
    assert {path.name for path in tmp_path.iterdir()} == {*names} - {"bad"}


def test_several_small_tasks_are_handed_over_at_a_time() -> None:
    assert on_dask._tasks_at_a_time(200, 2) == 6
    assert on_dask._tasks_at_a_time(5, 2) == 1
    assert on_dask._tasks_at_a_time(10**6, 2) == 16


def test_no_scheduler_is_wrong_usage(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cvtimg.batch.on_dask._PATIENCE", 0.2)
    assert cli.main(["info", "in", "--dask", "tcp://127.0.0.1:9"]) == 2
    assert "no scheduler answers at 'tcp://127.0.0.1:9'" in capsys.readouterr().err


@pytest.mark.slow
def test_a_local_cluster_needs_no_scheduler(folder: Path) -> None:
    assert cli.main(["quantize", "in", "-k", "9", "--out-dir", "out", "--dask", "local", "--jobs", "1", "--quiet"]) == 0
    assert len(list(Path("out").iterdir())) == len(PICTURES)


@pytest.mark.parametrize("chunks", [(20, 30, 3), (7, 11, 2), (20, 4, 1)])
def test_blocks_give_the_palette_and_the_indices_of_the_whole(chunks: tuple[int, ...]) -> None:
    for picture in (PICTURES[0], PICTURES[0][..., 0], np.dstack([PICTURES[0], PICTURES[1][..., 0]])):
        blocks = da.from_array(picture, chunks=chunks[: picture.ndim])
        alpha = picture.shape[2:] == (4,)
        result = quantize(blocks, 6, alpha=alpha)
        assert isinstance(result.indices, da.Array)
        whole = quantize(picture, 6, alpha=alpha)
        np.testing.assert_array_equal(result.palette, whole.palette)
        np.testing.assert_array_equal(result.indices.compute(), whole.indices)


def test_the_engine_takes_dask_arrays() -> None:
    rows = PICTURES[0].reshape(-1, 3).astype(np.float64)
    blocks = da.from_array(rows, chunks=(100, 3))
    np.testing.assert_array_equal(tessellate(blocks, 5).labels, tessellate(rows, 5).labels)
    picture = da.from_array(PICTURES[0], chunks=(7, 11, 3))
    np.testing.assert_array_equal(quantize(picture, 5).indices, quantize(PICTURES[0], 5).indices)
    assert find_palette(color_samples(picture), 5).colors.shape == (5, 3)


def test_pictures_come_back_readable(scheduler: str, folder: Path) -> None:
    assert cli.main(["quantize", "in/0.png", "-k", "4", "-o", "a.png", "--dask", scheduler, "--quiet"]) == 0
    np.testing.assert_array_equal(read_image("a.png"), quantize(PICTURES[0], 4).image)
