from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cvtimg import design
from cvtimg.cli.app import main

BOUNDS = "name,low,high\nspeed,0,30\nheat,20,90\n"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bounds.csv").write_text(BOUNDS)
    return tmp_path


def test_points_are_printed_as_the_function_finds_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "-n", "6", "-d", "2", "--effort", "fast", "--seed", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "x1,x2"
    found = np.array([[float(value) for value in line.split(",")] for line in lines[1:]])
    assert (found == design(6, 2, effort="fast", rng=3).points).all()


def test_files_have_named_axes_within_their_bounds(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    arguments = ["design", "-n", "9", "--bounds", "bounds.csv", "-o", "runs.csv", "--effort", "fast"]
    assert main([*arguments, "--json", "--measures", "--plot", "runs.svg"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["n"], row["names"], row["latin"], row["output"]) == (9, ["speed", "heat"], True, "runs.csv")
    assert 0 < row["discrepancy"] < 0.3
    assert row["exact_discrepancy"]
    text = (here / "runs.csv").read_text().splitlines()
    points = np.loadtxt(text[1:], delimiter=",")
    assert text[0] == "speed,heat"
    assert ((points > [0, 20]) & (points < [30, 90])).all()
    assert "heat" in (here / "runs.svg").read_text()
    assert main(arguments) == 1  # runs.csv is there already
    assert "exists" in capsys.readouterr().err


def test_points_that_exist_are_taken_into_account(capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--bounds", "bounds.csv", "--effort", "fast", "--quiet"]
    assert main(["design", "-n", "8", *options, "-o", "runs.csv"]) == 0
    assert main(["design", "-n", "8", *options, "--existing", "runs.csv", "-o", "more.npy"]) == 0
    old = np.loadtxt("runs.csv", delimiter=",", skiprows=1)
    unit = (np.concatenate([old, np.load("more.npy")]) - [0, 20]) / [30, 70]
    assert (np.load("more.npy") != old).any(axis=1).all()
    nearest = np.sqrt(((unit[:8, None] - unit[8:]) ** 2).sum(axis=2)).min()
    assert nearest > 0.08


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-n", "3"], "give either -d or --bounds"),
        (["-n", "3", "-d", "2", "--bounds", "bounds.csv"], "give either -d or --bounds"),
        (["-n", "0", "-d", "2"], "'0' must be a whole number in 1..65536"),
        (["-n", "3", "-d", "2", "-o", "a.txt"], ".csv, .npy"),
    ],
)
def test_wrong_usage_is_named(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_file_of_bounds_with_other_columns_is_named(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    (here / "bad.csv").write_text("axis,from,to\na,0,1\n")
    assert main(["design", "-n", "3", "--bounds", "bad.csv", "-o", "a.csv"]) == 1
    assert "bad.csv: must have the columns name, low and high" in capsys.readouterr().err
    assert not (here / "a.csv").exists()


@pytest.mark.parametrize("output", [[], ["-o", "a.csv"]])
@pytest.mark.parametrize("option", ["--bounds", "--existing"])
def test_a_missing_file_is_named(
    option: str, output: list[str], capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    others = [] if option == "--bounds" else ["-d", "2"]
    assert main(["design", "-n", "3", option, "missing.csv", *others, *output]) == 1
    assert capsys.readouterr().err.startswith("cvtimg: missing.csv: no such file")


@pytest.mark.parametrize(
    ("lines", "message"),
    [("heat,90,20", "heat from 90 to 20 must be finite, the first below the second"), ("", "must have a line")],
)
def test_bounds_without_a_box_are_refused_by_their_file(
    lines: str, message: str, capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    (here / "bad.csv").write_text(f"name,low,high\n{lines}\n")
    assert main(["design", "-n", "3", "--bounds", "bad.csv"]) == 1
    assert f"cvtimg: bad.csv: {message}" in capsys.readouterr().err


def test_errors_of_a_design_that_is_printed_are_told(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    (here / "old.csv").write_text("x1,x2\n5,5\n")
    assert main(["design", "-n", "3", "-d", "2", "--existing", "old.csv"]) == 1
    assert capsys.readouterr().err == "cvtimg: existing must be finite and lie within the bounds\n"
