from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from commands import RowOf
from PIL import Image

from cvtimg import energy_curve, quantize, read_image
from cvtimg.cli.app import main
from cvtimg.segmentation import segment_curve

SAMPLES = Path(__file__).parents[2] / "sample_images"


@pytest.fixture
def drawing(tmp_path: Path) -> Path:
    path = tmp_path / "drawing.png"
    path.write_bytes((SAMPLES / "drawing.png").read_bytes())
    return path


@pytest.fixture
def table(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    path = tmp_path / "table.npy"
    np.save(path, np.concatenate([rng.normal(center, 0.3, (50, 2)) for center in ([0, 0], [5, 1], [2, 7])]))
    return path


def test_the_table_shows_the_curve_and_what_each_rule_picks(drawing: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["elbow", str(drawing)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "chord 6" in lines[1]
    assert re.fullmatch(r" +6 +0 +100.00% +exact  chord", lines[-1])
    assert len([line for line in lines if "%" in line]) == 7


def test_json_has_the_curve_and_the_picks(drawing: Path, table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["elbow", str(drawing), str(table), "--json", "--k-max", "10", "--rule", "variance"]) == 0
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    curve = energy_curve(read_image(drawing), 10)
    assert first["energies"] == curve.energies.tolist()
    assert first["elbow"] == curve.elbows()
    assert first["k"] == curve.elbow("variance")
    assert (second["k"], second["n_max"], second["psnr"]) == (3, 10, None)


def test_with_effort_no_energy_is_higher(capsys: pytest.CaptureFixture[str]) -> None:
    energies = []
    for effort in ("fast", "balanced"):
        assert main(["elbow", str(SAMPLES / "chelsea.png"), "--k-max", "12", "--effort", effort, "--json"]) == 0
        energies.append(json.loads(capsys.readouterr().out)["energies"])
    assert all(balanced <= fast for fast, balanced in zip(*energies, strict=True))
    assert energies[0] != energies[1]


def test_the_csv_has_a_line_for_each_k_of_each_input(drawing: Path, table: Path, tmp_path: Path) -> None:
    out = tmp_path / "curves.csv"
    assert main(["elbow", str(drawing), str(table), "--k-max", "8", "--csv", str(out), "--quiet"]) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [row["input"] for row in rows] == ["drawing"] * 6 + ["table"] * 8
    assert [(row["input"], row["k"]) for row in rows if row["chosen"] == "1"] == [("drawing", "6"), ("table", "3")]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_one_plot_has_all_curves(drawing: Path, table: Path, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"plot{suffix}"
    assert main(["elbow", str(drawing), str(table), "--k-max", "8", "--plot", str(out), "--quiet"]) == 0
    if suffix == ".svg":
        text = out.read_text()
        for shown in ("drawing: 6 by chord", "table: 3 by chord", "k = 2", "k = 4", "original", "generators k"):
            assert shown in text
    else:
        with Image.open(out) as image:
            assert image.width == 1200


def test_a_bad_input_stops_no_other(drawing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = tmp_path / "bad.png"
    bad.write_bytes(b"no picture")
    out = tmp_path / "curves.csv"
    assert main(["elbow", str(bad), str(drawing), "--csv", str(out)]) == 1
    assert "bad.png" in capsys.readouterr().err
    assert "drawing,6" in out.read_text()


def test_nothing_is_overwritten_unasked(drawing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "curves.csv"
    out.write_text("mine")
    assert main(["elbow", str(drawing), "--csv", str(out)]) == 1
    assert "curves.csv" in capsys.readouterr().err
    assert out.read_text() == "mine"
    assert main(["elbow", str(drawing), "--csv", str(out), "--overwrite", "--quiet"]) == 0
    assert out.read_text() != "mine"
    before = drawing.read_bytes()
    assert main(["elbow", str(tmp_path), "--csv", str(drawing), "--overwrite"]) == 2
    assert drawing.read_bytes() == before


def test_tables_are_read_as_cluster_reads_them(tmp_path: Path, row_of: RowOf) -> None:
    rng = np.random.default_rng(0)
    rows = np.concatenate([rng.normal(center, 0.3, (50, 2)) for center in ([0, 0], [5, 1000], [2, 7000])])
    lines = [f"x,{a},{b},{n}\n" for n, (a, b) in enumerate(rows.tolist())]
    (tmp_path / "a.csv").write_text("".join(["who,a,b,n\n", *lines]))
    options = ["--columns", "b,a", "--weight", "n", "--standardize", "--k-max", "8"]
    found = row_of("elbow", str(tmp_path / "a.csv"), *options)
    weights = np.arange(150)
    middle = np.average(rows, axis=0, weights=weights)
    scaled = (rows - middle) / np.sqrt(np.average((rows - middle) ** 2, axis=0, weights=weights))
    expected = energy_curve(scaled[:, ::-1], 8, density=weights)
    np.testing.assert_allclose(found["energies"], expected.energies, rtol=1e-6)


def test_tables_have_columns_and_images_have_none(drawing: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["elbow", str(drawing), "--columns", "a"]) == 1
    assert "--columns must not be given for images" in capsys.readouterr().err


def test_quantize_takes_the_elbow_and_says_why(drawing: Path, row_of: RowOf) -> None:
    image = read_image(drawing)
    result = quantize(image, "auto")
    assert result.curve is not None
    assert len(result.palette) == result.curve.elbow() == 6
    assert (result.image == image).all()
    row = row_of("quantize", str(drawing), "-k", "auto")
    assert (row["k"], row["elbow"]["chord"]) == (6, 6)
    with pytest.raises(ValueError, match="must be a number with psnr"):
        quantize(image, "auto", psnr=30)


def test_transparent_pixels_count_as_a_color(drawing: Path) -> None:
    image = read_image(drawing)
    alpha = np.full(image.shape[:2], 255, np.uint8)
    alpha[:40] = 0
    result = quantize(np.dstack([image, alpha]), "auto", alpha=True)
    left = np.unique(image[40:].reshape(-1, 3), axis=0)
    assert len(result.palette) == len(left) + 1


def test_cluster_takes_the_elbow_and_says_why(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cluster", str(table), "-k", "auto"]) == 0
    out = capsys.readouterr().out
    assert "chord 3" in out
    assert main(["cluster", str(table), "-k", "many"]) == 2
    assert "must be auto or a whole number" in capsys.readouterr().err


def test_edges_count_as_in_segment(drawing: Path, table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--edge-weight", "30", "--k-max", "8", "--json"]
    assert main(["elbow", str(drawing), *options]) == 0
    row = json.loads(capsys.readouterr().out)
    assert row["energies"] == segment_curve(read_image(drawing), 8, edge_weight=30).energies.tolist()
    assert row["energies"] != energy_curve(read_image(drawing), 8).energies.tolist()
    assert main(["elbow", str(table), *options]) == 1
    assert "for images, not for tables" in capsys.readouterr().err


def test_max_pixels_guards_and_the_report_tells(
    drawing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = tmp_path / "rows.csv"
    assert main(["elbow", str(drawing), "--max-pixels", "99", "--report", str(rows)]) == 1
    assert "has over 99 pixels" in capsys.readouterr().err
    assert [row["status"] for row in csv.DictReader(rows.read_text().splitlines())] == ["failed"]
    assert main(["elbow", str(drawing), "--csv", str(rows), "--report", str(rows), "--overwrite"]) == 2
    assert "--csv and --report would both become" in capsys.readouterr().err


def test_a_plot_without_matplotlib_is_refused_before_the_work(
    drawing: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("cvtimg.options.record.find_spec", lambda name: None)
    assert main(["elbow", str(drawing), "--plot", "a.png"]) == 2
    assert "--plot needs matplotlib: pip install 'cvtimg[plot]'" in capsys.readouterr().err
