"""A Dask cluster does the same work to the same bits, and a lost worker costs nothing but time."""

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cvtimg import write_image
from cvtimg.batch import executors
from cvtimg.batch.tasks import Outcome, Task
from cvtimg.cli import app as cli

distributed = pytest.importorskip("distributed")
import dask  # noqa: E402

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
def folder(here: Path) -> Path:
    Path("in").mkdir()
    for number, picture in enumerate(PICTURES):
        write_image(f"in/{number}.png", picture)
    return here


@pytest.mark.parametrize("options", [[], ["--shared-palette"]])
def test_a_cluster_gives_the_same_files_and_errors_and_rows_tell_which_worker_did_what(
    scheduler: str, folder: Path, capsys: pytest.CaptureFixture[str], options: list[str]
) -> None:
    Path("in/bad.png").write_text("no picture")
    for out, more in (("one", []), ("two", ["--dask", scheduler, "--report", "r.jsonl"])):
        assert cli.main(["quantize", "in", "-k", "9", "--quiet", *options, *more, "--out-dir", out]) == 1
        assert capsys.readouterr().err == "cvtimg: in/bad.png: cannot be read: unknown image format\n"
    assert len(list(Path("two").iterdir())) == len(PICTURES)
    for number in range(len(PICTURES)):
        assert Path(f"one/{number}.png").read_bytes() == Path(f"two/{number}.png").read_bytes()
    rows = [json.loads(line) for line in Path("r.jsonl").read_text().splitlines()]
    assert {row["worker"] for row in rows if row["status"] == "done"} <= {"0", "1"}


def _ends_its_worker(task: Task) -> Outcome:
    if task.source.name == "bad":
        os._exit(9)
    task.output.write_text(task.source.name)
    return Outcome({"input": task.source.name})


@pytest.mark.slow
def test_a_task_that_ends_its_workers_fails_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Workers are processes that import this module.
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path(__file__).parents[2])])
    names = ["a", "b", "bad", "c", "d", "e", "f", "g"]
    tasks = [Task((Path(name),), {"-o": tmp_path / name}) for name in names]
    with dask.config.set({"distributed.scheduler.allowed-failures": 1}):
        found = dict(executors.on_dask(_ends_its_worker, tasks, "local", 2))
    assert sorted(found) == list(range(len(tasks)))
    assert [names[place] for place, outcome in found.items() if outcome.failures] == ["bad"]
    assert found[2].failures == (("bad", "2 workers were lost while they worked on it"),)
    assert {path.name for path in tmp_path.iterdir()} == {*names} - {"bad"}


def test_no_scheduler_is_wrong_usage(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cvtimg.batch.executors._PATIENCE", 0.2)
    assert cli.main(["info", "in", "--dask", "tcp://127.0.0.1:9"]) == 2
    assert "no scheduler answers at 'tcp://127.0.0.1:9'" in capsys.readouterr().err
