"""Claims about ``cvtimg segment --objects`` and ``-k auto``."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from commands import RowOf, Run
from images import discs

from cvtimg import read_image, segment, write_image
from cvtimg.labels import read_labels
from cvtimg.segmentation import Objects


@pytest.fixture
def cells() -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Two discs that touch and one that does not, in a file of the folder that tests work in."""
    inside = discs([(20, 20, 10), (20, 36, 10), (40, 70, 10)], (60, 90)) > 0
    image = np.clip(40 + 150 * inside + np.random.default_rng(0).normal(0, 9, inside.shape), 0, 255).astype(np.uint8)
    write_image("cells.png", image)
    return image


def test_objects_are_split_and_the_background_is_in_no_table(cells: np.ndarray[Any, Any], row_of: RowOf) -> None:
    how = ["cells.png", "-k", "2", "--edge-weight", "auto", "--objects", "--properties", "eccentricity, solidity"]
    outputs = ["-o", "l.png", "--table", "t.csv", "--overlay", "o.png", "--contours", "c.svg"]
    row = row_of("segment", *how, *outputs)
    labels = read_labels("l.png")
    assert row["k"] == labels.max() == 3
    assert row["left_out"] == (labels == 0).sum() > labels.size / 2
    with Path("t.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["label"]) for row in rows] == [1, 2, 3]
    assert all(float(row["eccentricity"]) < 0.6 and float(row["solidity"]) > 0.9 for row in rows)
    drawn = (read_image("o.png") == [255, 255, 0]).all(axis=2)
    assert drawn.sum() > 3 * 40  # the rims of all three, though their other side has label 0
    assert row_of("segment", *how, "--neck-depth", 9, "-o", "m.png")["k"] == 2
    row_of("segment", *how, "--object-border", "own", "-o", "own.png")
    expected = segment(cells, 2, edge_weight="auto", objects=Objects(border="own")).labels
    np.testing.assert_array_equal(read_labels("own.png"), expected)


def test_auto_counts_what_is_segmented(cells: np.ndarray[Any, Any], row_of: RowOf) -> None:
    known = np.broadcast_to(np.arange(90) < 60, cells.shape)
    write_image("mask.png", known)
    how = ["--averaging", "2", "--edge-weight", "auto", "--mask", "mask.png"]
    row = row_of("segment", "cells.png", "-k", "auto", *how)
    expected = segment(cells, "auto", averaging=2, edge_weight="auto", mask=known)
    assert expected.n_segments != segment(cells, "auto").n_segments
    assert expected.curve is not None
    assert row["k"] == expected.n_segments
    assert row["elbow"] == expected.curve.elbows()
    np.testing.assert_array_equal(read_labels("cells-labels.png"), expected.labels)


@pytest.mark.parametrize(
    ("measure", "columns"),
    [("all", ["mean_DAPI", "mean_GFP"]), ("GFP", ["mean_GFP"]), ("2,DAPI", ["mean_GFP", "mean_DAPI"])],
)
def test_one_channel_is_segmented_and_others_are_measured(run: Run, measure: str, columns: list[str]) -> None:
    down, right = np.mgrid[:60, :90]
    nuclei = np.uint8(20 + 150 * ((np.hypot(down - 30, right - 25) < 9) | (np.hypot(down - 30, right - 65) < 9)))
    metadata = {"axes": "CYX", "Labels": ["DAPI", "GFP"]}
    tifffile.imwrite("a.tif", np.stack([nuclei, right.astype(np.uint8)]), imagej=True, metadata=metadata)
    how = ["--objects", "--channel", "DAPI", "--measure", measure, "--table", "t.csv", "--quiet"]
    assert run("segment", "a.tif", *how).status == 0
    header, *rows = (line.split(",") for line in Path("t.csv").read_text().splitlines())
    assert [name for name in header if name.startswith("mean")] == columns
    means = sorted(float(row[header.index("mean_GFP")]) for row in rows)
    assert means == pytest.approx([25, 65], abs=0.5)
    assert run("segment", "a.tif", *how[:4], "RFP", "--table", "u.csv").status == 1


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_one_table_has_the_objects_of_all_images_and_a_run_that_goes_on_keeps_its_rows(
    cells: np.ndarray[Any, Any], run: Run, suffix: str
) -> None:
    for place, image in {"a/one.png": cells, "a/two.png": 255 - cells, "b/one.png": cells[:30]}.items():
        Path(place).parent.mkdir(exist_ok=True)
        write_image(place, image)
    table, how = Path(f"all.{suffix}"), ["segment", "a", "b", "--objects", "--table", f"all.{suffix}"]
    assert run(*how).status == 0
    assert run(*how).status != 0  # the file is there
    whole, last = table.read_bytes(), Path("b/one.png").read_bytes()
    table.unlink()
    Path("b/one.png").write_bytes(b"")
    assert run(*how).status == 1
    Path("b/one.png").write_bytes(last)
    resumed = run(*how, "--skip-existing", "--json")
    assert [row.get("skipped", False) for row in resumed.rows] == [True, True, False]
    if suffix == "csv":
        assert table.read_bytes() == whole
        Path("other.csv").write_text("a,b\n1,2\n")
        assert "--table: other.csv has no rows of images" in run(*how[:-1], "other.csv", "--skip-existing").err
        with table.open() as file:
            images = Counter(row["image"] for row in csv.DictReader(file))
        assert images == {"a/one.png": 3, "two.png": 3, "b/one.png": 2}
