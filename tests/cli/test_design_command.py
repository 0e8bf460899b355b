from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import RowOf

from cvtimg import design
from cvtimg.cli.app import main

BOUNDS = "name,low,high\nspeed,0,30\nheat,20,90\n"


@pytest.fixture
def here(here: Path) -> Path:
    (here / "bounds.csv").write_text(BOUNDS)
    return here


def test_points_are_printed_as_the_function_finds_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "-n", "6", "-d", "2", "--effort", "fast", "--seed", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "x1,x2"
    found = np.array([[float(value) for value in line.split(",")] for line in lines[1:]])
    assert (found == design(6, 2, effort="fast", rng=3).points).all()


def test_files_have_named_axes_within_their_bounds(
    row_of: RowOf, capsys: pytest.CaptureFixture[str], here: Path
) -> None:
    arguments = ["design", "-n", "9", "--bounds", "bounds.csv", "-o", "runs.csv", "--effort", "fast"]
    row = row_of(*arguments, "--measures", "--plot", "runs.svg")
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


def test_points_that_exist_are_taken_into_account() -> None:
    options = ["--bounds", "bounds.csv", "--effort", "fast", "--quiet"]
    assert main(["design", "-n", "8", *options, "-o", "runs.csv"]) == 0
    assert main(["design", "-n", "8", *options, "--existing", "runs.csv", "-o", "more.npy"]) == 0
    old = np.loadtxt("runs.csv", delimiter=",", skiprows=1)
    unit = (np.concatenate([old, np.load("more.npy")]) - [0, 20]) / [30, 70]
    assert (np.load("more.npy") != old).any(axis=1).all()
    nearest = np.sqrt(((unit[:8, None] - unit[8:]) ** 2).sum(axis=2)).min()
    assert nearest > 0.08


FACTORS = "name,low,high,kind,levels,unit\nheat,20,90,,,C\nrounds,1,4,integer,,\nalloy,,,,A|B|C,\n"


def test_axes_on_the_command_line_are_those_of_a_file(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "factors.csv").write_text("name,low,high,kind,levels\nheat,20,90,,\nrounds,1,4,integer,\nalloy,,,,A|B|C\n")
    options = ["design", "-n", "6", "--effort", "fast", "--quiet"]
    axes = ["--axis", "heat,20,90", "--axis", "rounds, 1, 4, integer", "--axis", "alloy,A|B|C"]
    assert main([*options, "--bounds", "factors.csv", "-o", "one.csv"]) == 0
    assert main([*options, *axes, "-o", "other.csv"]) == 0
    assert (here / "one.csv").read_bytes() == (here / "other.csv").read_bytes()
    for wrong in ("heat", "heat,1", "heat,9,1", "heat,0,x", "alloy,A|A"):
        assert main([*options, "--axis", wrong]) == 2
        assert wrong.partition(",")[0] in capsys.readouterr().err


def table(path: str) -> list[list[str]]:
    return [line.split(",") for line in Path(path).read_text().splitlines()]


def test_levels_and_whole_numbers_are_balanced_and_units_are_in_the_header(here: Path) -> None:
    (here / "factors.csv").write_text(FACTORS)
    assert main(["design", "-n", "12", "--bounds", "factors.csv", "-o", "runs.csv", "--effort", "fast"]) == 0
    header, *rows = table("runs.csv")
    assert header == ["heat [C]", "rounds", "alloy"]
    assert sorted(row[1] for row in rows) == sorted("1234" * 3)
    assert sorted(row[2] for row in rows) == sorted("ABC" * 4)
    more = ["design", "-n", "12", "--bounds", "factors.csv", "--existing", "runs.csv", "-o", "more.csv"]
    assert main([*more, "--effort", "fast"]) == 0
    assert sorted(row[2] for row in table("more.csv")[1:]) == sorted("ABC" * 4)
    assert not {row[0] for row in rows} & {row[0] for row in table("more.csv")[1:]}


@pytest.mark.slow
def test_conditions_are_given_the_numbers_of_levels_and_results_may_stand_beside_runs(here: Path) -> None:
    (here / "factors.csv").write_text(FACTORS)
    options = ["design", "--bounds", "factors.csv", "--effort", "fast"]
    assert (
        main([*options, "-n", "8", "--feasible", "rounds < 3", "--batches", "2", "-o", "runs.csv", "--plot", "a.svg"])
        == 0
    )
    assert ">C</text>" in (here / "a.svg").read_text()
    header, *rows = table("runs.csv")
    assert header == ["batch", "heat [C]", "rounds", "alloy"]
    assert {row[2] for row in rows} == {"1", "2"}
    (here / "results.csv").write_text("\n".join(f"{','.join(row)},{i}" for i, row in enumerate([header, *rows])))
    assert main([*options, "-n", "4", "--existing", "results.csv", "-o", "more.csv", "--quiet"]) == 0


def test_criteria_and_functions_are_those_of_python(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    def points(*words: str) -> np.ndarray:
        assert main(["design", "-n", "9", *words, "--effort", "fast"]) == 0, capsys.readouterr().err
        return np.loadtxt(capsys.readouterr().out.splitlines()[1:], delimiter=",")

    spread = points("-d", "3", "--criterion", "maximin")
    assert (spread == design(9, 3, criterion="maximin", effort="fast").points).all()
    below = points("--bounds", "bounds.csv", "--feasible", "(speed * heat < 900) & (x1 > 3)")
    assert (below.prod(axis=1) < 900).all()
    assert (below[:, 0] > 3).all()
    dense = points("-d", "2", "--density", "exp(-9 * x1)")
    assert (dense[:, 0] < 0.5).sum() > 7


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--feasible", "speed < 1"], "--feasible 'speed < 1' has no axis 'speed'; there are x1, x2"),
        (["--density", "exp("], "--density 'exp(' cannot be computed"),
        (["--feasible", "x1 < 0"], "feasible must hold for more of the box"),
        (["--criterion", "maximin", "--no-latin"], "must not be given with latin=False"),
    ],
)
def test_wrong_functions_are_named(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "-n", "5", "-d", "2", *words]) == 1
    assert message in capsys.readouterr().err


def test_shuffled_runs_are_the_same_in_another_order() -> None:
    options = ["design", "-n", "12", "-d", "2", "--effort", "fast"]
    for name, more in (("plain", []), ("one", ["--shuffle", "1"]), ("again", ["--shuffle", "1"])):
        assert main([*options, *more, "-o", f"{name}.csv"]) == 0
    plain, one, again = (table(f"{name}.csv") for name in ("plain", "one", "again"))
    assert sorted(plain) == sorted(one)
    assert plain != one == again


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("a,,,,A,", "a must have two or more levels"),
        ("a,0,1,,A|B,", "a must have two or more levels"),
        ("a,0,1.5,integer,,", "a of kind integer must be"),
        ("a,0,1,odd,,", "a of kind odd must be"),
    ],
)
def test_wrong_factors_are_named(line: str, message: str, capsys: pytest.CaptureFixture[str], here: Path) -> None:
    (here / "factors.csv").write_text(f"name,low,high,kind,levels,unit\n{line}\n")
    assert main(["design", "-n", "3", "--bounds", "factors.csv"]) == 1
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-n", "3"], "give one of -d, --bounds and --axis"),
        (["-n", "3", "-d", "2", "--bounds", "bounds.csv"], "give one of -d, --bounds and --axis"),
        (["-n", "0", "-d", "2"], "'0' must be a whole number in 1..65536"),
        (["-n", "3", "-d", "2", "-o", "a.txt"], ".csv, .npy"),
        (["-n", "3", "-d", "2", "--criterion", "best"], "'best' must be one of cvt"),
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
    [
        ("a,0,1\na,0,1", "there must be one axis named a, not 2"),
        ("heat,90,20", "heat from 90 to 20 must be finite, the first below the second"),
        ("", "must have a line"),
    ],
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
    assert capsys.readouterr().err == "cvtimg: x1 of existing[0]=5.0 must be within its bounds, 0..1\n"
