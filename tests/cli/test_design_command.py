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


def test_files_have_named_axes_within_their_bounds(row_of: RowOf, here: Path) -> None:
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


FACTORS = "name,low,high,kind,levels,unit\nheat,20,90,,,C\nrounds,1,4,integer,,\nalloy,,,,A|B|C,\n"


def test_axes_on_the_command_line_are_those_of_a_file(here: Path) -> None:
    (here / "factors.csv").write_text("name,low,high,kind,levels\nheat,20,90,,\nrounds,1,4,integer,\nalloy,,,,A|B|C\n")
    options = ["design", "-n", "6", "--effort", "fast", "--quiet"]
    axes = ["--axis", "heat,20,90", "--axis", "rounds, 1, 4, integer", "--axis", "alloy,A|B|C"]
    assert main([*options, "--bounds", "factors.csv", "-o", "one.csv"]) == 0
    assert main([*options, *axes, "-o", "other.csv"]) == 0
    assert (here / "one.csv").read_bytes() == (here / "other.csv").read_bytes()


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
    assert main([*options, "-n", "8", "--feasible", "rounds < 3", "-o", "runs.csv", "--plot", "a.svg"]) == 0
    assert ">C</text>" in (here / "a.svg").read_text()
    header, *rows = table("runs.csv")
    assert header == ["heat [C]", "rounds", "alloy"]
    assert {row[1] for row in rows} == {"1", "2"}
    (here / "results.csv").write_text("\n".join(f"{','.join(row)},{i}" for i, row in enumerate([header, *rows])))
    assert main([*options, "-n", "4", "--existing", "results.csv", "-o", "more.csv", "--quiet"]) == 0


def test_criteria_and_functions_are_those_of_python(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    def points(*words: str) -> np.ndarray:
        assert main(["design", "-n", "9", *words, "--effort", "fast"]) == 0, capsys.readouterr().err
        return np.loadtxt(capsys.readouterr().out.splitlines()[1:], delimiter=",")

    below = points("--bounds", "bounds.csv", "--feasible", "(speed * heat < 900) & (x1 > 3)")
    assert (below.prod(axis=1) < 900).all()
    assert (below[:, 0] > 3).all()
    dense = points("-d", "2", "--density", "exp(-9 * x1)")
    assert (dense[:, 0] < 0.5).sum() > 7


def test_shuffled_runs_are_the_same_in_another_order() -> None:
    options = ["design", "-n", "12", "-d", "2", "--effort", "fast"]
    for name, more in (("plain", []), ("one", ["--shuffle", "1"]), ("again", ["--shuffle", "1"])):
        assert main([*options, *more, "-o", f"{name}.csv"]) == 0
    plain, one, again = (table(f"{name}.csv") for name in ("plain", "one", "again"))
    assert sorted(plain) == sorted(one)
    assert plain != one == again
