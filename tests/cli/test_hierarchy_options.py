"""Claims about ``cvtimg segment --hierarchy``."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import RowOf
from numpy.typing import NDArray
from PIL import Image

from cvtimg import read_image, segment_hierarchy, write_image
from cvtimg.segmentation import RegionHierarchy


@pytest.fixture
def small(photograph: NDArray[Any]) -> NDArray[Any]:
    image = np.asarray(Image.fromarray(photograph).resize((96, 80)))
    write_image("photo.png", image)
    return image


@pytest.fixture
def row_of(row_of: RowOf) -> RowOf:
    return partial(row_of, "segment", "photo.png", "--hierarchy")


def test_all_outputs_of_a_hierarchy_are_written(small: NDArray[Any], row_of: RowOf) -> None:
    row = row_of("-k", "7", "--write", "labels.npy,table,tree,strengths,strengths.npy,overlay")
    hierarchy = segment_hierarchy(small)
    assert row["k"] == 7
    np.testing.assert_array_equal(np.load("photo-labels.npy"), hierarchy.cut(7))
    np.testing.assert_array_equal(RegionHierarchy.load("photo-tree.npz").cut(30), hierarchy.cut(30))
    strengths = np.load("photo-strengths.npy")
    np.testing.assert_array_equal(strengths, hierarchy.find_edges(strength=True))
    np.testing.assert_array_equal(read_image("photo-strengths.png"), np.rint(255 * strengths))
    assert Path("photo-table.csv").read_text().count("\n") == 8


def test_a_space_that_is_named_is_taken(small: NDArray[Any], row_of: RowOf) -> None:
    cuts = {}
    for space in ("rgb", "lab"):
        row_of("-k", "7", "--space", space, "-o", f"{space}.npy")
        cuts[space] = segment_hierarchy(small, space=space).cut(7)
        np.testing.assert_array_equal(np.load(f"{space}.npy"), cuts[space])
    assert (cuts["rgb"] != cuts["lab"]).any()


def test_auto_cuts_at_the_threshold(small: NDArray[Any], row_of: RowOf) -> None:
    hierarchy = segment_hierarchy(small)
    for number in (["-k", "auto"], []):
        assert row_of(*number, "-o", "a.png", "--overwrite")["k"] == hierarchy.n_regions()
        row = row_of(*number, "--threshold", "0.6", "-o", "b.png", "--overwrite")
        assert row["k"] == hierarchy.n_regions(0.6)


def test_contours_by_chance_are_lines_that_tell_it(small: NDArray[Any], row_of: RowOf) -> None:
    row_of("--chance", "0.2", "--contours", "lines.geojson", "--write", "contours.svg")
    found = segment_hierarchy(small).find_lines(0.2)
    features = json.loads(Path("lines.geojson").read_text())["features"]
    assert [feature["geometry"]["coordinates"] for feature in features] == [line.tolist() for line in found.lines]
    np.testing.assert_allclose([feature["properties"]["chance"] for feature in features], found.chances, atol=1e-4)
    assert Path("photo-contours.svg").read_text().count("data-chance=") == len(found.lines)
    row_of("--strongest", "3", "--contours", "lines.svg", "--simplify", "1")
    assert Path("lines.svg").read_text().count("data-chance=") == 3
