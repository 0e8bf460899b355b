"""A batch finds its inputs, loses nothing, goes on after what fails, and is the same however many work at it."""

import csv
import io
import json
import multiprocessing
import os
import signal
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import works

from cvtimg import find_images, write_image
from cvtimg.batch.plans import Plan, find
from cvtimg.batch.report import Report
from cvtimg.batch.runner import Running, run
from cvtimg.batch.tasks import Task, WrongUsageError
from cvtimg.cli import app as cli
from cvtimg.files.whole import whole_file

#: Workers that hang must not hang the tests.
pytestmark = pytest.mark.timeout(120)
RNG = np.random.default_rng(11)
posix = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")


def inputs(n: int) -> list[Task]:
    """Make inputs and the tasks to copy each into out/."""
    Path("in").mkdir(exist_ok=True)
    for number in range(n):
        Path(f"in/{number}").write_text(f"content {number}")
    return [Task((Path(f"in/{number}"),), {"copy": Path(f"out/{number}")}) for number in range(n)]


def report() -> Report:
    return Report((), as_json=True)


def rows(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def picture(path: str, size: int = 12) -> Path:
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    write_image(path, RNG.integers(0, 256, (size, size, 3), np.uint8))
    return Path(path)


# Inputs


def test_folders_and_patterns_keep_their_tree_below_the_output_folder(here: Path) -> None:
    for name in ("a/1.png", "a/b/1.png", "a/b/c/1.png", "d/x/2.png", "e.png"):
        picture(name)
    sources, missing, _ = find(["a", "d/*/2.png", "e.png", "a/b/1.png"], find_images, Path("out"))
    assert not missing
    assert {str(path): str(folder) for path, folder in sources.items()} == {
        "a/1.png": "out",
        "a/b/1.png": "out/b",
        "a/b/c/1.png": "out/b/c",
        "d/x/2.png": "out/x",
        "e.png": "out",
    }
    assert find(["a"], find_images)[0][Path("a/b/1.png")] == Path("a/b")


@pytest.mark.parametrize("end", ["\n", "\0"])
def test_a_list_on_standard_input_keeps_its_folders(here: Path, monkeypatch: pytest.MonkeyPatch, end: str) -> None:
    names = ["a/1.png", "a/b/1.png", f"../{here.name}-outside.png"]
    for name in (*names, here / "c.png"):
        picture(str(name))
    listed = end.join([*names, str(here / "c.png"), "no.png", ""]).encode()
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(listed)))
    sources, missing, _ = find(["@-"], find_images, Path("out"))
    assert [str(folder) for folder in sources.values()] == ["out/a", "out/a/b", "out", "out"]
    assert [text for text, _ in missing] == ["no.png"]


# Workers


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_results_come_in_the_order_of_the_inputs(here: Path, capsys: pytest.CaptureFixture[str], jobs: int) -> None:
    tasks = inputs(7)
    assert run(Plan(tasks, out_dir=Path("out")), works.copy, report(), Running(jobs)) == 0
    found = rows(capsys)
    assert [row["input"] for row in found] == [str(task.source) for task in tasks]
    if sys.platform == "linux":  # where workers begin with what reads pictures, and import it but once
        assert all(row["reads"] for row in found)
    assert all(Path(f"out/{number}").read_text() == f"content {number}" for number in range(7))


@pytest.mark.slow
@pytest.mark.parametrize("cores", [2, 8])
def test_jobs_take_as_many_cores_and_no_more(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, cores: int
) -> None:
    monkeypatch.setattr("cvtimg.batch.runner.n_threads", lambda: cores)
    run(Plan(inputs(6), out_dir=Path("out")), works.threads, report(), Running(3))
    found = rows(capsys)
    assert {row["threads"] for row in found} == {1}
    assert os.getpid() not in {row["process"] for row in found}


@posix
def test_a_worker_that_dies_takes_only_its_own_input_with_it(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tasks = inputs(6)
    for number in (0, 4, 5):
        tasks[number].source.write_bytes(b"die")
    assert run(Plan(tasks, out_dir=Path("out")), works.copy_or_die, report(), Running(2)) == 1
    failed = {row["input"]: row["error"] for row in rows(capsys) if "error" in row}
    assert set(failed) == {"in/0", "in/4", "in/5"}
    assert all("worker process was lost" in str(why) for why in failed.values())
    assert sorted(path.name for path in Path("out").iterdir()) == ["1", "2", "3"]


def test_a_row_that_cannot_be_sent_fails_its_own_input(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(Plan(inputs(2), out_dir=Path("out")), works.unsendable, report(), Running(2)) == 1
    assert [list(row) for row in rows(capsys)] == [["input", "error"]] * 2


@posix
def test_an_interrupt_stops_all_workers_and_leaves_no_half_file(here: Path) -> None:
    tasks = inputs(4)

    def interrupt_once_all_write() -> None:
        while len(list(Path("out").glob(".cvtimg-*"))) < 2:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    watcher = threading.Thread(target=interrupt_once_all_write)
    watcher.start()
    assert run(Plan(tasks, out_dir=Path("out")), works.half_a_copy, report(), Running(2)) == 130
    watcher.join()
    assert not Path("out").exists()
    assert not multiprocessing.active_children()


def test_an_output_finished_before_an_interrupt_is_told(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = Plan(inputs(3), out_dir=Path("out"))
    assert run(plan, works.copied_then_interrupted, report(), Running(1, report_file=Path("rows.csv"))) == 130
    assert "interrupted: 1 done, 0 skipped, 0 failed, 2 of 3 inputs left" in capsys.readouterr().err
    assert Path("rows.csv").read_text().splitlines()[1].startswith("done,in/0,out/0")


# Going on, and telling


def test_an_input_with_some_of_its_outputs_is_done_again(here: Path) -> None:
    Path("in").write_text("content")
    Path("one").write_text("of a run that was killed before it wrote the other")
    task = Task((Path("in"),), {"one": Path("one"), "two": Path("two")})
    assert run(Plan([task]), works.copy, report(), Running(skip_existing=True)) == 0
    assert Path("one").read_text() == Path("two").read_text() == "content"


def test_the_report_has_a_row_for_every_input(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture("a/1.png")
    picture("a/2.png")
    Path("a/bad.png").write_text("no picture")
    arguments = ["quantize", "a", "missing.png", "-k", "4", "--out-dir", "out"]
    assert cli.main(["quantize", "a/1.png", "-k", "4", "--out-dir", "out"]) == 0
    for name in ("r.csv", "r.jsonl"):
        Path("out/2.png").unlink(missing_ok=True)
        capsys.readouterr()
        assert cli.main([*arguments, "--skip-existing", "--report", name]) == 1
        assert capsys.readouterr().err.splitlines()[-1] == "1 done, 1 skipped, 2 failed"
    with Path("r.csv").open(newline="") as file:
        table = {row["input"]: row for row in csv.DictReader(file)}
    lines = {row["input"]: row for row in map(json.loads, Path("r.jsonl").read_text().splitlines())}
    status = {"missing.png": "failed", "a/1.png": "skipped", "a/2.png": "done", "a/bad.png": "failed"}
    assert {name: row["status"] for name, row in table.items()} == status
    assert {name: row["status"] for name, row in lines.items()} == status
    assert float(table["a/2.png"]["energy"]) == lines["a/2.png"]["energy"]
    assert float(table["a/2.png"]["seconds_read"]) >= 0
    assert "unknown image format" in table["a/bad.png"]["error"]


def test_a_report_replaces_no_file_unasked_and_says_so_before_any_work(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture("1.png")
    Path("r.csv").write_text("mine")
    options = ["quantize", "1.png", "-k", "4", "-o", "out.png", "--report"]
    assert cli.main([*options, "r.csv"]) == 1
    assert capsys.readouterr().err.startswith("cvtimg: r.csv: exists already")
    assert cli.main([*options, "r.txt"]) == 2
    assert Path("r.csv").read_text() == "mine"
    assert not Path("out.png").exists()
    assert cli.main([*options, "r.csv", "--overwrite"]) == 0


# Faults


def test_leftovers_of_killed_runs_go_and_those_of_live_ones_stay(here: Path) -> None:
    tasks = inputs(1)
    Path("out").mkdir()
    Path("out/.cvtimg-0123.part").write_text("half")
    with whole_file("out/other") as file:
        assert run(Plan(tasks, out_dir=Path("out")), works.copy, report(), Running()) == 0
        file.write(b"whole")
    assert {path.name for path in Path("out").iterdir()} == {"0", "other"}
    assert Path("out/other").read_text() == "whole"


def test_an_input_is_never_replaced_in_a_batch(here: Path) -> None:
    tasks = inputs(2)
    Path("out").symlink_to("in")
    with pytest.raises(WrongUsageError, match="is an input"):
        run(Plan(tasks), works.copy, report(), Running(2, overwrite=True))
    assert Path("in/0").read_text() == "content 0"


@pytest.mark.slow
@pytest.mark.parametrize("command", ["quantize -k 3", "segment -k 2", "stipple -n 9", "palette", "info"])
def test_every_command_works_in_processes(here: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    for number in range(3):
        picture(f"in/{number}.png")
    output = ["--out-dir", "out"] if command not in ("palette", "info") else []
    assert cli.main([*command.split(), "in", *output, "--jobs", "2", "--report", "r.jsonl"]) == 0
    rows = [json.loads(line) for line in Path("r.jsonl").read_text().splitlines()]
    assert [row["input"] for row in rows] == [f"in/{number}.png" for number in range(3)]
    assert capsys.readouterr().err == "3 done, 0 skipped, 0 failed\n"
