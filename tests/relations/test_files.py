"""What must not change when a run is ended and resumed, or when its files are those of another run."""

import csv
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from cvtimg import write_image
from cvtimg.cli.app import main

pytestmark = pytest.mark.timeout(120)
N_PICTURES = 12


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of pictures that are done one after the other, slowly."""
    folder, rng = tmp_path_factory.mktemp("pictures"), np.random.default_rng(3)
    for number in range(N_PICTURES):
        write_image(folder / f"{number:02}.png", rng.integers(0, 256, (96, 96, 3), np.uint8))
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    """Read a report, of which each line must be whole."""
    text = path.read_text()
    assert text.endswith("\n")
    table = list(csv.DictReader(text.splitlines()))
    assert all(None not in row.values() and None not in row for row in table)
    return table


def command(pictures: Path, out: Path, report: Path) -> list[str]:
    names = [str(pictures), "--out-dir", str(out), "--report", str(report)]
    return ["quantize", *names, "-k", "32", "--jobs", "2", "--quiet"]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="POSIX signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGKILL"])
def test_a_batch_that_is_ended_and_resumed_has_the_report_of_one_that_is_not(
    name: str, pictures: Path, tmp_path: Path
) -> None:
    out, report, number = tmp_path / "out", tmp_path / "r.csv", getattr(signal, name)
    words = command(pictures, out, report)
    process = subprocess.Popen([sys.executable, "-P", "-m", "cvtimg", *words], stderr=subprocess.PIPE)
    while process.poll() is None and len(list(out.glob("[0-9]*.png")) if out.exists() else []) < 4:
        if report.exists():
            rows(report)  # it can be read at any moment
        time.sleep(0.01)
    process.send_signal(number)
    process.communicate()
    assert process.returncode == (-number if name == "SIGKILL" else 128 + number)
    files, told = {path.name for path in out.glob("[0-9]*.png")}, rows(report)
    assert 4 <= len(files) < N_PICTURES
    lost = files - {Path(row["output"]).name for row in told}  # written, but not told before the end
    assert len(lost) <= (2 if name == "SIGKILL" else 0)
    assert main([*words, "--skip-existing"]) == 0
    again = rows(report)
    assert sorted(row["input"] for row in again) == sorted(map(str, pictures.iterdir()))
    counts = Counter(row["status"] for row in again)
    assert counts["skipped"] == len(lost)
    assert counts["done"] == N_PICTURES - len(lost)
    assert {row["k"] for row in again if row["status"] == "done"} <= {"32", ""}


@pytest.mark.parametrize("suffix", [pytest.param("csv", marks=pytest.mark.slow), "jsonl"])
def test_rows_that_are_known_early_stand_in_the_order_of_the_inputs(
    suffix: str, pictures: Path, tmp_path: Path
) -> None:
    texts = []
    for jobs in ("1", "2"):
        report = tmp_path / f"{jobs}.{suffix}"
        words = ["palette", f"{pictures}/0*.png", str(pictures / "none.png"), "-k", "2", "--jobs", jobs]
        assert main([*words, "--quiet", "--report", str(report)]) == 1
        texts.append([line.split("seconds")[0][:60] for line in report.read_text().splitlines()])
    assert texts[0] == texts[1]
    assert len(texts[0]) == 11 + (suffix == "csv")


def test_files_are_written_though_nobody_reads_what_is_printed(pictures: Path, tmp_path: Path) -> None:
    words = [str(pictures), "-k", "4", "--effort", "fast", "--json", "--out-dir", str(tmp_path / "out")]
    process = subprocess.Popen([sys.executable, "-P", "-m", "cvtimg", "quantize", *words], stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait() == 0
    assert len(list((tmp_path / "out").iterdir())) == N_PICTURES
