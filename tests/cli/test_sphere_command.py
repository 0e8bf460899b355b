"""``cvtimg sphere`` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from commands import RowOf
from PIL import Image
from scipy.io import netcdf_file

from cvtimg import sphere_grid
from cvtimg.cli.app import main
from cvtimg.cli.grid_inputs import read_grid_points
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
    lat, lon = np.linspace(-90, 90, 19), np.linspace(-180, 180, 37)
    with netcdf_file("widths.nc", "w") as file:
        for name, dimensions, values in (
            ("lat", ("lat",), lat),
            ("lon", ("lon",), lon),
            ("cellWidth", ("lat", "lon"), np.full((19, 37), 1500.0)),
        ):
            if name in dimensions:
                file.createDimension(name, len(values))
            file.createVariable(name, "d", dimensions)[:] = values
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


def test_a_nested_grid_keeps_the_points_outside(row_of: RowOf) -> None:
    row_of("sphere", "-n", "642", "-o", "parent.nc")
    row = row_of("sphere", "-n", "200", "--parent", "parent.nc", "--within", "0,90,20", "-o", "nested.nc")
    parent, nested = read_grid_points(Path("parent.nc")), read_grid_points(Path("nested.nc"))
    kept = parent[parent[:, 2] <= np.cos(np.radians(20))]
    assert row["fixed"] == len(kept)
    assert (nested[: len(kept)] == kept).all()


def test_points_lie_on_the_coast_of_a_map(row_of: RowOf) -> None:
    row_of("sphere", "-n", "642", "--coast", "north.png", "-o", "grid.csv")
    heights = np.abs(read_grid_points(Path("grid.csv"))[:, 2])
    assert (heights < 0.01).sum() > 20


@pytest.mark.slow
def test_plots_are_maps_or_globes(row_of: RowOf, here: Path) -> None:
    row_of("sphere", "-n", "200", "-o", "a.csv", "--plot", "map.png", "--over", "north.png")
    row_of("sphere", "-n", "200", "-o", "b.csv", "--plot", "globe.png", "--view", "10", "50", "--histograms", "h.svg")
    assert "cell width (km)" in Path("h.svg").read_text()
    with Image.open(here / "map.png") as drawn_map, Image.open(here / "globe.png") as globe:
        assert drawn_map.size != globe.size


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["-o", "a.nc"], 2, "-n"),
        (["-n", "100"], 2, "-o"),
        (["-n", "100", "-o", "a.txt"], 2, "must end in"),
        (["-n", "100", "-o", "a.nc", "--refine", "1,2,3"], 2, "must be LON,LAT,RADIUS,RATIO"),
        (["-n", "100", "-o", "a.nc", "--refine", "1,2,3,x"], 2, "must be LON,LAT,RADIUS,RATIO"),
        (["-n", "100", "-o", "a.nc", "--within", "1,2,3"], 2, "--within needs --parent"),
        (["-n", "100", "-o", "a.nc", "--view", "1", "2"], 2, "--view needs --plot"),
        (
            ["-n", "100", "-o", "a.nc", "--refine", "10,50"],
            2,
            "must be LON,LAT,RADIUS,RATIO, all numbers, or IMAGE,RATIO",
        ),
        (["-n", "99", "-o", "a.nc", "--plot", "a.png", "--view", "10", "100"], 2, "'100' must be a number in -90..90"),
        (["-o", "a.nc", "--cell-width", "30km", "--refine", "1,2,3"], 2, "must be LON,LAT,RADIUS,WIDTH"),
        (["-o", "a.nc", "--cell-width", "-3"], 1, "width=-3.0 must be a finite number > 0, in km"),
        (["-o", "a.nc", "--cell-width", "thirty"], 1, "thirty"),
        (["-o", "a.nc", "--cell-width", "bare.nc"], 1, "it has no lon"),
        (["-n", "99", "-o", "a.nc", "--region", "1,2"], 2, "--region 1,2 must be WEST,SOUTH,EAST,NORTH"),
        (["-n", "99", "-o", "a.nc", "--region", "no.geojson"], 1, "--region no.geojson: no such file"),
        (["-n", "99", "-o", "a.nc", "--strait", "1,2"], 2, "--strait needs --land"),
        (["-n", "99", "-o", "a.nc", "--land", "north.png", "--strait", "1,2,3"], 1, "--strait 1,2,3 must be LON,LAT"),
        (["-n", "99", "-o", "a.nc", "--radius", "moon"], 2, "'moon' must be a number > 0, or mpas, cesm"),
        (["-n", "3", "-o", "a.nc"], 1, "n=3 must be an integer >= 4"),
        (["-n", "100", "-o", "a.nc", "--refine", "0,0,10,0.5"], 1, "ratio=0.5 must be in 1..100"),
        (["-n", "100", "-o", "a.nc", "--density", "square.png"], 1, "must be twice as wide as high"),
        (["-n", "100", "-o", "a.nc", "--density", "black.png"], 1, "--density black.png must not be 0 everywhere"),
        (["-n", "100", "-o", "a.nc", "--refine", "black.png,3"], 1, "--refine black.png must not be 0 everywhere"),
        (["-n", "100", "-o", "a.nc", "--density", "nan.tif"], 1, "--density nan.tif must be finite"),
        (["-n", "100", "-o", "a.nc", "--coast", "square.png"], 1, "must be twice as wide as high"),
        (["-n", "100", "-o", "a.nc", "--coast", "black.png"], 1, "--coast black.png must not be 0 everywhere"),
        (
            ["-n", "9", "-o", "a.nc", "--parent", "twice.csv", "--within", "0,0,60"],
            1,
            "points 0 and 6 must be at least",
        ),
        (
            ["-n", "9", "-o", "a.nc", "--parent", "off.csv", "--within", "0,0,60"],
            1,
            "on a sphere: point 1 is 3 from the",
        ),
        (["-n", "9", "-o", "a.nc", "--parent", "few.csv", "--within", "0,0,60"], 1, "must have at least 4 points"),
        (["-n", "9", "-o", "a.nc", "--parent", "empty.csv", "--within", "0,0,60"], 1, "it has no rows"),
        (["-n", "100", "-o", "a.nc", "--parent", "no.csv", "--within", "0,0,9"], 1, "no.csv"),
        (["-n", "100", "-o", "a.nc", "--parent", "bad.csv", "--within", "0,0,9"], 1, "neither an MPAS mesh"),
    ],
)
def test_wrong_usage_and_bad_files_are_one_line(
    capsys: pytest.CaptureFixture[str], arguments: list[str], status: int, message: str
) -> None:
    Image.new("L", (40, 40), 9).save("square.png")
    Image.new("L", (40, 20)).save("black.png")
    Image.fromarray(np.full((20, 40), np.nan, np.float32)).save("nan.tif")
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    off = np.where(np.arange(6)[:, None] == 1, 3, 1) * corners
    tables = {"twice": np.concatenate([corners, corners[:1]]), "off": off, "few": corners[:3], "empty": corners[:0]}
    for name, points in tables.items():
        np.savetxt(f"{name}.csv", points, delimiter=",", header="x,y,z", comments="")
    netcdf_file("bare.nc", "w").close()
    Path("bad.csv").write_text("a,b\n1,2\n")
    assert main(["sphere", *arguments]) == status
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
    assert not Path("a.nc").exists()
