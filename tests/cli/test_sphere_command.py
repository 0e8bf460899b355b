"""``cvtimg sphere`` from the command line."""

import json
from pathlib import Path

import numpy as np
import pytest
from commands import RowOf
from PIL import Image
from scipy.io import netcdf_file

from cvtimg import sphere_grid
from cvtimg.cli.app import main
from cvtimg.cli.gridding import read_grid_points
from cvtimg.sphere import CellWidth


@pytest.fixture
def here(here: Path) -> Path:
    north = np.zeros((60, 120), np.uint8)
    north[:30] = 255
    Image.fromarray(north).save("north.png")
    return here


@pytest.mark.parametrize("name", ["grid.nc", "grid.csv"])
def test_files_hold_what_the_function_finds(row_of: RowOf, name: str) -> None:
    row = row_of("sphere", "-n", "300", "--seed", "3", "-o", name)
    expected = sphere_grid(300, rng=3)
    assert (row["n"], row["triangles"], row["n_obtuse"]) == (300, 596, 0)
    assert row["energy"] == pytest.approx(expected.energy)
    assert (read_grid_points(Path(name)) == expected.points).all()


def test_coasts_are_those_of_polygons(row_of: RowOf) -> None:
    ring = [[-30, -20], [50, -20], [50, 40], [-30, 40], [-30, -20]]
    Path("land.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    row_of("sphere", "-n", "300", "--coast", "land.geojson", "-o", "coast.nc")
    with netcdf_file("coast.nc", mmap=False) as grid:
        on = grid.variables["coastCell"][:] == 1
        lon, lat = (np.degrees(grid.variables[name][on]) for name in ("lonCell", "latCell"))
    off = np.maximum(np.abs((lon + 180) % 360 - 190) - 40, np.abs(lat - 10) - 30)
    assert on.sum() > 8
    assert np.abs(off).max() < 8  # of cells 11 degrees wide


@pytest.mark.slow
def test_points_gather_in_circles_and_where_maps_are_bright(row_of: RowOf) -> None:
    for options in (["--density", "north.png"], ["--refine", "north.png,3"], ["--refine", "0,90,80,3"]):
        row_of("sphere", "-n", "500", *options, "-o", "grid.csv", "--overwrite")
        points = read_grid_points(Path("grid.csv"))
        assert (points[:, 2] > 0).mean() > 0.65


@pytest.mark.slow
def test_widths_in_km_say_how_many_points(row_of: RowOf) -> None:
    row = row_of("sphere", "--cell-width", "1500km", "--refine", "0,90,2000km,800km,900", "-o", "a.csv")
    assert 250 < row["n"] < 320
    assert row["least_width_km"] == pytest.approx(800, rel=0.1)
    assert row["largest_width_km"] == pytest.approx(1500, rel=0.15)
    places = {"lat": np.linspace(-90, 90, 19), "lon": np.linspace(-180, 180, 37)}
    widths = pytest.importorskip("xarray").DataArray(np.full((19, 37), 1500.0), places, name="cellWidth")
    widths.to_netcdf("widths.nc", engine="scipy")
    by_file = row_of("sphere", "--cell-width", "widths.nc", "-o", "b.csv")
    assert by_file["n"] == CellWidth(1500).n_points
    assert row_of("sphere", "--cell-width", "1500", "-n", "99", "-o", "c.csv")["n"] == 99


@pytest.mark.slow
def test_land_and_regions_are_cut_out(row_of: RowOf, capsys: pytest.CaptureFixture[str]) -> None:
    south = row_of("sphere", "-n", "300", "--land", "north.png", "-o", "a.nc", "--plot", "a.png")
    open_ = row_of("sphere", "-n", "300", "--land", "north.png", "--strait", "0,0,0,60", "-o", "b.nc")
    line = {"type": "LineString", "coordinates": [[0, 0], [0, 60]]}
    Path("strait.geojson").write_text(json.dumps({"type": "Feature", "properties": {}, "geometry": line}))
    by_file = row_of("sphere", "-n", "300", "--land", "north.png", "--strait", "strait.geojson", "-o", "c.nc")
    assert south["kept"] == pytest.approx(150, abs=8)
    assert south["kept"] < open_["kept"] == by_file["kept"]
    ring = [[-30, -30], [30, -30], [30, 30], [-30, 30], [-30, -30]]
    Path("box.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    box = row_of("sphere", "-n", "300", "--region", "-30,-30,30,30", "--layers", "1", "-o", "d.nc")
    same = row_of("sphere", "-n", "300", "--region", "box.geojson", "--layers", "1", "-o", "e.nc")
    circle = row_of("sphere", "-n", "300", "--region", "0,0,30", "--layers", "1", "-o", "f.nc")
    assert circle["kept"] < box["kept"] == same["kept"] < 100
    both = row_of("sphere", "-n", "300", "--land", "north.png", "--region", "0,0,30", "--layers", "1", "-o", "g.nc")
    assert 0.4 * circle["kept"] < both["kept"] < 0.6 * circle["kept"]
    assert main(["sphere", "-n", "9", "--parent", "a.nc", "--within", "0,0,9", "-o", "h.nc"]) == 1
    assert "a.nc is a part of a grid" in capsys.readouterr().err


def test_files_say_what_made_them_and_from_what(row_of: RowOf) -> None:
    row_of("sphere", "-n", "642", "--radius", "mpas", "-o", "parent.nc")
    row_of("sphere", "-n", "99", "--parent", "parent.nc", "--within", "0,90,20", "--land", "earth", "-o", "part.nc")
    with netcdf_file("parent.nc", mmap=False) as parent, netcdf_file("part.nc", mmap=False) as part:
        assert parent.sphere_radius == 6371229.0
        assert parent.history == b"cvtimg sphere -n 642 --radius mpas -o parent.nc --json"
        whole, *older = part.parent_id.split()
        assert older == [parent.file_id]
        assert whole not in (part.file_id, parent.file_id)


@pytest.mark.slow
def test_plots_are_maps_or_globes(row_of: RowOf, here: Path) -> None:
    row_of("sphere", "-n", "200", "-o", "a.csv", "--plot", "map.png")
    row_of("sphere", "-n", "200", "-o", "b.csv", "--plot", "globe.png", "--view", "10", "50", "--histograms", "h.svg")
    assert "cell width (km)" in Path("h.svg").read_text()
    with Image.open(here / "map.png") as drawn_map, Image.open(here / "globe.png") as globe:
        assert drawn_map.size != globe.size
