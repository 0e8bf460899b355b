"""``cvtimg stipple`` and ``cvtimg mosaic``: images to dots and tiles."""

import csv
import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from commands import RowOf

from cvtimg import mosaic, read_image, write_image

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


def test_pixels_without_data_stay_paper(tmp_path: Path, row_of: RowOf) -> None:
    shades = RAMP.astype(np.float32) / 255
    shades[:, :40] = np.nan
    np.save(tmp_path / "holes.npy", shades)
    row_of("stipple", tmp_path / "holes.npy", "-n", 50, "-o", tmp_path / "dots.csv")
    with (tmp_path / "dots.csv").open() as file:
        assert min(float(line["x"]) for line in csv.DictReader(file)) >= 40


def test_tiles_of_measurements_have_their_unit_and_those_without_data_are_clear() -> None:
    heights = np.where(np.arange(60) < 30, 1e6, 1e6 + 2.0) + np.zeros((40, 1))
    heights[:, 50:] = np.nan
    with pytest.warns(UserWarning, match="measurements"):
        tiles = mosaic(heights, 12)
    seen = tiles.colors[tiles.colors[:, 1] > 0]
    assert np.abs(np.unique(seen[:, 0])[[0, -1]] - [1e6, 1e6 + 2]).max() < 0.1
    assert not tiles.image[:, 52:, 1].any()
    assert np.ptp(tiles.draw()[:, :48, 0].astype(int)) == 255
