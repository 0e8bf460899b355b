"""``cvtimg stipple`` and ``cvtimg mosaic``: images to dots and tiles."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from commands import RowOf

from cvtimg import read_image, write_image
from cvtimg._shared.types import Array

RAMP = np.tile(np.linspace(0, 255, 80).astype(np.uint8), (50, 1))


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    write_image(tmp_path / "ramp.png", np.dstack([RAMP, RAMP[::-1], RAMP]))
    return tmp_path / "ramp.png"


def test_stipple_draws_dots_in_the_width_asked_for(picture: Path, row_of: RowOf) -> None:
    told = row_of("stipple", picture, "-n", 200, "--width", "16cm", "--marks", "points")
    assert (told["n"], told["max_ink"]) == (200, 0.9)
    root = ElementTree.parse(picture.with_name("ramp-stippled.svg")).getroot()
    assert root.get("width") == "160mm"
    assert len(list(root.iter("{http://www.w3.org/2000/svg}path"))) == 200


def test_stipple_fills_dots_that_the_frame_may_cut_by_spirals(picture: Path, row_of: RowOf) -> None:
    cells = picture.with_name("cells.svg")
    row_of("stipple", picture, "-n", 200, "--fill", "spiral", "--bleed", "--pen-width", 0.2, "--cells", cells)
    for path in (picture.with_name("ramp-stippled.svg"), cells):
        assert len(list(ElementTree.parse(path).getroot().iter("{http://www.w3.org/2000/svg}path"))) == 200


def test_stipple_writes_tables_and_cells(picture: Path, row_of: RowOf) -> None:
    output, cells = picture.with_name("dots.csv"), picture.with_name("cells.geojson")
    row_of("stipple", picture, "-n", 50, "--dots", "sized", "--radius-range", 1, 4, "-o", output, "--cells", cells)
    with output.open() as file:
        radii = [float(line["radius"]) for line in csv.DictReader(file)]
    assert len(radii) == 50
    assert 1 <= min(radii) <= max(radii) <= 4
    assert len(json.loads(cells.read_text())["features"]) == 50


def test_mosaic_is_written_as_pixels_and_polygons(picture: Path, row_of: RowOf) -> None:
    told = row_of("mosaic", picture, "-n", 60)
    assert told["n"] == 60
    assert read_image(picture.with_name("ramp-mosaic.png")).shape == (50, 80, 3)
    output = picture.with_name("a.geojson")
    row_of("mosaic", picture, "-n", 60, "--shape", "triangles", "-k", 4, "-o", output)
    fills = {feature["properties"]["fill"] for feature in json.loads(output.read_text())["features"]}
    assert len(fills) == 4


@pytest.mark.parametrize("verb", ["stipple", "mosaic"])
@pytest.mark.parametrize("values", [RAMP * np.uint16(16), RAMP * np.float32(-1e-5), RAMP.astype(np.int32) - 90])
def test_measurements_are_drawn_as_in_the_range_that_they_fill(
    values: Array, verb: str, tmp_path: Path, row_of: RowOf
) -> None:
    np.save(tmp_path / "measured.npy", values)
    for name, more in (("alone.svg", []), ("stretched.svg", ["--composite", "white"])):
        told = row_of(verb, tmp_path / "measured.npy", "-n", 40, "-o", tmp_path / name, *more)
        assert ("measurements" in told.get("warning", "")) == (not more)
    assert (tmp_path / "alone.svg").read_bytes() == (tmp_path / "stretched.svg").read_bytes()


def test_pixels_without_data_stay_paper(tmp_path: Path, row_of: RowOf) -> None:
    shades = RAMP.astype(np.float32) / 255
    shades[:, :40] = np.nan
    np.save(tmp_path / "holes.npy", shades)
    row_of("stipple", tmp_path / "holes.npy", "-n", 50, "-o", tmp_path / "dots.csv")
    with (tmp_path / "dots.csv").open() as file:
        assert min(float(line["x"]) for line in csv.DictReader(file)) >= 40
