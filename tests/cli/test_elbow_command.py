import csv
import re
from pathlib import Path

import numpy as np
import pytest
from commands import SAMPLES, RowOf, Run
from PIL import Image

from cvtimg import energy_curve, read_image


@pytest.fixture(autouse=True)
def inputs(here: Path) -> None:
    """Write drawing.png and table.npy."""
    Path("drawing.png").write_bytes((SAMPLES / "drawing.png").read_bytes())
    rng = np.random.default_rng(0)
    np.save("table.npy", np.concatenate([rng.normal(center, 0.3, (50, 2)) for center in ([0, 0], [5, 1], [2, 7])]))


def test_the_table_shows_the_curve_and_what_each_rule_picks(run: Run) -> None:
    lines = run("elbow", "drawing.png").out.splitlines()
    assert "chord 6" in lines[1]
    assert re.fullmatch(r" +6 +0 +100.00% +exact  chord", lines[-1])
    assert len([line for line in lines if "%" in line]) == 7


def test_json_has_the_curve_and_the_picks(run: Run) -> None:
    first, second = run("elbow", "drawing.png", "table.npy", "--json", "--k-max", 10, "--rule", "variance").rows
    curve = energy_curve(read_image("drawing.png"), 10)
    assert first["energies"] == curve.energies.tolist()
    assert first["elbow"] == curve.elbows()
    assert first["k"] == curve.elbow("variance")
    assert (second["k"], second["n_max"], second["psnr"]) == (3, 10, None)


def test_the_csv_has_a_line_for_each_k_of_each_input_and_a_bad_one_stops_no_other(run: Run) -> None:
    Path("bad.png").write_bytes(b"no picture")
    outcome = run("elbow", "bad.png", "drawing.png", "table.npy", "--k-max", 8, "--csv", "curves.csv", "--quiet")
    assert (outcome.status, "bad.png" in outcome.err) == (1, True)
    rows = list(csv.DictReader(Path("curves.csv").read_text().splitlines()))
    assert [row["input"] for row in rows] == ["drawing"] * 6 + ["table"] * 8
    assert [(row["input"], row["k"]) for row in rows if row["chosen"] == "1"] == [("drawing", "6"), ("table", "3")]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_one_plot_has_all_curves(run: Run, suffix: str) -> None:
    out = f"plot{suffix}"
    assert run("elbow", "drawing.png", "table.npy", "--k-max", 8, "--plot", out, "--quiet").status == 0
    if suffix == ".svg":
        text = Path(out).read_text()
        for shown in ("drawing: elbow at k=6", "table: elbow at k=3", "k = 2", "k = 4", "original", "generators k"):
            assert shown in text
    else:
        with Image.open(out) as image:
            assert image.width == 1200


def test_tables_are_read_as_cluster_reads_them(row_of: RowOf) -> None:
    rng = np.random.default_rng(0)
    rows = np.concatenate([rng.normal(center, 0.3, (50, 2)) for center in ([0, 0], [5, 1000], [2, 7000])])
    lines = [f"x,{a},{b},{n}\n" for n, (a, b) in enumerate(rows.tolist())]
    Path("a.csv").write_text("".join(["who,a,b,n\n", "y,,1,2\n", *lines]))
    options = ["--columns", "b,a", "--weight", "n", "--standardize", "--missing", "drop"]
    found = row_of("elbow", "a.csv", *options, "--k-max", 8)
    weights = np.arange(150)
    middle = np.average(rows, axis=0, weights=weights)
    scaled = (rows - middle) / np.sqrt(np.average((rows - middle) ** 2, axis=0, weights=weights))
    expected = energy_curve(scaled[:, ::-1], 8, density=weights)
    np.testing.assert_allclose(found["energies"], expected.energies, rtol=1e-6)


def test_other_commands_take_the_elbow_and_say_why(run: Run, row_of: RowOf) -> None:
    row = row_of("quantize", "drawing.png", "-k", "auto", "-o", "few.png")
    assert (row["k"], row["elbow"]["chord"]) == (6, 6)
    np.testing.assert_array_equal(read_image("few.png"), read_image("drawing.png"))
    assert "chord 3" in run("cluster", "table.npy", "-k", "auto").out


def test_a_folder_of_tables_gives_a_line_for_each(run: Run) -> None:
    Path("tables/inner").mkdir(parents=True)
    Path("tables/inner/one.npy").write_bytes(Path("table.npy").read_bytes())
    Path("tables/two.csv").write_text("a,b\n1,2\n3,4\n5,9\n")
    lines = run("elbow", "tables").out.splitlines()
    assert [name for name in ("one.npy", "two.csv") if any(name in line for line in lines)] == ["one.npy", "two.csv"]
