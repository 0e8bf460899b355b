from __future__ import annotations

import json
from pathlib import Path

import meshio
import numpy as np
import pytest

import cvtimg
from cvtimg.cli.app import main
from cvtimg.meshes import mesh_volume
from cvtimg.pictures import write_pages

SQUARE = {"type": "Polygon", "coordinates": [[[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]]]}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.geojson").write_text(json.dumps({"type": "Feature", "geometry": SQUARE, "properties": {}}))
    (tmp_path / "a.wkt").write_text("POLYGON ((0 0, 2 0, 2 1, 0 1, 0 0))")
    (tmp_path / "a.csv").write_text("x,y\n0,0\n2,0\n2,1\n0,1\n")
    y, x = np.mgrid[:40, :50]
    cvtimg.write_image("mask.png", np.where(np.hypot(x - 25, y - 20) < 15, np.uint8(255), np.uint8(0)))
    cvtimg.write_image("labels.png", (1 + (x > 20) + (y > 25)).astype(np.uint8))
    return tmp_path


@pytest.mark.parametrize("name", ["a.geojson", "a.wkt", "a.csv"])
def test_polygons_are_meshed_as_by_the_function(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mesh", name, "-n", "25", "-o", "a.obj", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["n"], row["n_wanted"], row["area"]) == (25, 25, pytest.approx(2))
    wanted = cvtimg.mesh_region([[0, 0], [2, 0], [2, 1], [0, 1]], n=25)
    assert row["triangles"] == len(wanted.triangles)
    assert Path("a.obj").read_text().count("\nf ") == row["triangles"]


@pytest.mark.slow
def test_a_mask_is_meshed_with_a_plot(capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "mesh",
        "mask.png",
        "--edge-length",
        "2.5",
        "--plot",
        "a.png",
        "--over",
        "mask.png",
        "--measures",
        "--json",
    ]
    assert main(words) == 0
    row = json.loads(capsys.readouterr().out)
    assert row["area"] == pytest.approx(np.pi * 225, rel=0.03)
    assert row["output"] == "mask-mesh.vtu"
    assert row["beta"] == pytest.approx(60 / row["least_angle"])
    assert cvtimg.read_image("a.png").shape[2] in (3, 4)


def test_label_images_keep_their_tags(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mesh", "labels.png", "-n", "300", "-o", "a.msh", "--quiet"]) == 0
    text = Path("a.msh").read_text()
    assert all(f'2 {tag} "{tag}"' in text for tag in (1, 2, 3))
    assert capsys.readouterr().out == ""


def test_sizes_come_from_an_image(capsys: pytest.CaptureFixture[str]) -> None:
    size = np.where(np.arange(50) < 25, 1.0, 4.0).astype(np.float32) * np.ones((40, 1), np.float32)
    cvtimg.write_image("size.tif", size)
    assert main(["mesh", "mask.png", "--size", "size.tif", "-o", "a.vtu", "--json"]) == 0
    many = json.loads(capsys.readouterr().out)["n"]
    assert main(["mesh", "mask.png", "--size", "size.tif", "-n", "200", "-o", "b.vtu", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["n"] == 200
    assert many > 300


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ball.tif", pytest.param("ball.npy", marks=pytest.mark.slow)])
def test_stacks_of_voxels_are_filled_with_tetrahedra(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    z, y, x = np.mgrid[:20, :24, :28]
    ball = (x - 14) ** 2 + (y - 12) ** 2 + (z - 10) ** 2 < 64
    stack = np.where(ball, np.uint8(2), np.uint8(1))
    np.save("ball.npy", stack)
    write_pages("ball.tif", stack)
    assert main(["mesh", name, "-n", "400", "--label", "2", "--plot", "a.png", "-o", "a.vtu"]) == 1
    assert "has voxels, to which --plot cannot be applied" in capsys.readouterr().err
    assert main(["mesh", name, "-n", "400", "--label", "2", "-o", "a.vtu", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    wanted = mesh_volume(ball, n=400)
    assert (row["n"], row["tetrahedra"]) == (len(wanted.points), len(wanted.tetrahedra))
    assert row["volume"] == pytest.approx(ball.sum(), rel=0.01)
    assert row["is_manifold"]
    assert main(["mesh", name, "-n", "900", "-o", "b.vtu", "--json", "--measures"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert [row["labels"][tag]["volume"] for tag in "12"] == pytest.approx(np.bincount(stack.ravel())[1:], rel=0.003)
    assert min(one["least_angle"] for one in row["labels"].values()) == row["least_angle"] > 14
    assert np.unique(meshio.read("b.vtu").cell_data["tag"]).tolist() == [1, 2]
    assert (meshio.read("a.vtu").cells_dict["tetra"] == wanted.tetrahedra).all()


def test_one_label_is_meshed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mesh", "labels.png", "-n", "90", "--label", "2", "-o", "a.vtu", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert row["area"] == pytest.approx((cvtimg.read_image("labels.png") == 2).sum())
    assert "n_straight" not in row
    words = ["mesh", "labels.png", "-n", "90", "--label", "3", "-o", "c.vtu", "--json"]
    assert main([*words, "--order", "2"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["n"], row["n_straight"]) == (90, 0)
    assert len(meshio.read("c.vtu").cells_dict["triangle6"]) == row["triangles"]
    assert main(["mesh", "labels.png", "-n", "90", "--label", "9", "-o", "b.vtu"]) == 1
    assert "labels.png: holds no label 9" in capsys.readouterr().err


def test_names_of_regions_and_borders_are_groups(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["mesh", "a.wkt", "-n", "30", "-o", "a.msh", "--json", "--name", "steel=1", "--name", "left=0,1,0,0"]
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["names"] == {"steel": 1, "left": 2}
    found = meshio.read("a.msh")
    left = found.cells_dict["line"][found.cell_data_dict["gmsh:physical"]["line"] == 2]
    assert found.field_data["left"].tolist() == [2, 1]
    assert (found.points[left, 0] == 0).all()
    assert np.ptp(found.points[left, 1]) == 1


def test_properties_of_features_name_regions(capsys: pytest.CaptureFixture[str]) -> None:
    features = [
        {
            "type": "Feature",
            "properties": {"name": name, "kind": "metal"},
            "geometry": {"type": "Polygon", "coordinates": [[[x, 0], [x + 1, 0], [x + 1, 1], [x, 1], [x, 0]]]},
        }
        for x, name in enumerate(["North Sea", "land"])
    ]
    Path("map.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    for words, names in (([], {"North_Sea": 1, "land": 2}), (["--name-by", "kind"], {"metal": 1})):
        assert main(["mesh", "map.geojson", "-n", "60", "-o", "b.msh", "--overwrite", "--json", *words]) == 0
        assert json.loads(capsys.readouterr().out)["names"] == names
        assert {name: number for name, (number, kind) in meshio.read("b.msh").field_data.items() if kind == 2} == names


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (["mesh", "mask.png", "-n", "9", "--edge-length", "1"], 2, "-n and --edge-length exclude each other"),
        (["mesh", "mask.png", "-n", "9", "--over", "mask.png"], 2, "--over needs --plot"),
        (["mesh", "mask.png", "-n", "9", "-o", "a.txt"], 2, ".vtu"),
        (["mesh", "bad.geojson", "-n", "9"], 1, "bad.geojson: is not a .geojson file of polygons"),
        (["mesh", "cross.csv", "-n", "9"], 1, "cross.csv: polygons must not cross themselves"),
        (["mesh", "hole.wkt", "-n", "9"], 1, "hole.wkt: a hole at (5, 5) must lie inside"),
        (["mesh", "mask.png", "--edge-length", "0"], 2, "--edge-length"),
        (["mesh", "mask.png", "--periodic", "x"], 1, "--periodic 'x' must be for borders on the left and right"),
        (["mesh", "mask.png", "--order", "2", "-o", "a.stl"], 2, "--order 2: 'a.stl' must end in one of .vtu, .msh"),
        (["mesh", "mask.png", "--size", "nan.tif"], 1, "size is nan at x=25, y=20"),
        (["mesh", "mask.png", "--size", "zero.tif", "-n", "90"], 1, "size is 0 at x="),
        (["mesh", "a.wkt", "-n", "9", "--label", "1"], 1, "a.wkt: has polygons; --label is for images of labels"),
        (["mesh", "mask.png", "--keep-points"], 1, "mask.png: has pixels; --keep-points is for polygons"),
        (["mesh", "a.wkt", "--keep-points", "-n", "3"], 1, "-n 3 must be at least 4, the vertices that"),
        (["mesh", "a.wkt", "--name", "a=b"], 2, "'a=b' must be NAME=LABEL or NAME=X0,Y0,X1,Y1"),
        (
            ["mesh", "a.wkt", "--name", "a=1,2,3,4"],
            1,
            "borders has 'a', which must be true for the middle of some edge",
        ),
        (["mesh", "a.wkt", "--name", "a=1", "--name", "b=1"], 1, "--name must have each name and each label once"),
        (["mesh", "black.png", "-n", "9"], 1, "the region is empty"),
        (["mesh", "labels.png", "-n", "3"], 1, "-n 3 must be at least"),
    ],
)
def test_wrong_usage_and_bad_inputs_are_named(
    words: list[str], status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("bad.geojson").write_text("{")
    Path("cross.csv").write_text("0,0\n1,1\n1,0\n0,1\n")
    Path("hole.wkt").write_text("POLYGON ((0 0, 4 0, 4 4, 0 4, 0 0), (5 5, 6 5, 6 6, 5 5))")
    size = np.ones((40, 50), np.float32)
    size[20, 25] = np.nan
    cvtimg.write_image("nan.tif", size)
    cvtimg.write_image("zero.tif", np.zeros((40, 50), np.float32))
    cvtimg.write_image("black.png", np.zeros((5, 5), np.uint8))
    assert main(words) == status
    assert message in capsys.readouterr().err
    assert not list(Path().glob("*mesh.vtu"))
