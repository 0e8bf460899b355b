import json
from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import RowOf, Run

import cvtimg
from cvtimg.meshes import mesh_volume
from cvtimg.pictures import write_pages
from cvtimg.surfaces import torus

SQUARE = {"type": "Polygon", "coordinates": [[[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]]]}


@pytest.fixture(autouse=True)
def here(here: Path) -> Path:
    (here / "a.geojson").write_text(json.dumps({"type": "Feature", "geometry": SQUARE, "properties": {}}))
    (here / "a.wkt").write_text("POLYGON ((0 0, 2 0, 2 1, 0 1, 0 0))")
    (here / "a.csv").write_text("x,y\n0,0\n2,0\n2,1\n0,1\n")
    y, x = np.mgrid[:40, :50]
    cvtimg.write_image("mask.png", np.where(np.hypot(x - 25, y - 20) < 15, np.uint8(255), np.uint8(0)))
    cvtimg.write_image("labels.png", (1 + (x > 20) + (y > 25)).astype(np.uint8))
    return here


@pytest.mark.parametrize(
    "name", ["a.geojson", pytest.param("a.wkt", marks=pytest.mark.slow), pytest.param("a.csv", marks=pytest.mark.slow)]
)
def test_polygons_are_meshed_as_by_the_function(name: str, row_of: RowOf) -> None:
    row = row_of("mesh", name, "-n", "25", "-o", "a.obj")
    assert (row["n"], row["n_wanted"], row["area"]) == (25, 25, pytest.approx(2))
    wanted = cvtimg.mesh_region([[0, 0], [2, 0], [2, 1], [0, 1]], n=25)
    assert row["triangles"] == len(wanted.triangles)
    assert Path("a.obj").read_text().count("\nf ") == row["triangles"]


@pytest.mark.slow
def test_a_mask_is_meshed_with_a_plot(row_of: RowOf) -> None:
    row = row_of("mesh", "mask.png", "--edge-length", 2.5, "--plot", "a.png", "--over", "mask.png", "--measures")
    assert row["area"] == pytest.approx(np.pi * 225, rel=0.03)
    assert row["output"] == "mask-mesh.vtu"
    assert row["beta"] == pytest.approx(60 / row["least_angle"])
    assert cvtimg.read_image("a.png").shape[2] in (3, 4)


def test_label_images_keep_their_tags(run: Run) -> None:
    assert run("mesh", "labels.png", "-n", 300, "-o", "a.msh", "--quiet") == (0, "", "")
    text = Path("a.msh").read_text()
    assert all(f'2 {tag} "{tag}"' in text for tag in (1, 2, 3))


def test_sizes_come_from_an_image(row_of: RowOf) -> None:
    size = np.where(np.arange(50) < 25, 1.0, 4.0).astype(np.float32) * np.ones((40, 1), np.float32)
    cvtimg.write_image("size.tif", size)
    assert row_of("mesh", "mask.png", "--size", "size.tif", "-o", "a.vtu")["n"] > 300
    assert row_of("mesh", "mask.png", "--size", "size.tif", "-n", 200, "-o", "b.vtu")["n"] == 200


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ball.tif", pytest.param("ball.npy", marks=pytest.mark.slow)])
def test_stacks_of_voxels_are_filled_with_tetrahedra(name: str, run: Run, row_of: RowOf) -> None:
    z, y, x = np.mgrid[:20, :24, :28]
    ball = (x - 14) ** 2 + (y - 12) ** 2 + (z - 10) ** 2 < 64
    stack = np.where(ball, np.uint8(2), np.uint8(1))
    np.save("ball.npy", stack)
    write_pages("ball.tif", stack)
    outcome = run("mesh", name, "-n", 400, "--label", 2, "--plot", "a.png", "-o", "a.vtu")
    assert (outcome.status, "has voxels, to which --plot cannot be applied" in outcome.err) == (1, True)
    row = row_of("mesh", name, "-n", "400", "--label", "2", "-o", "a.vtu")
    wanted = mesh_volume(ball, n=400)
    assert (row["n"], row["tetrahedra"]) == (len(wanted.points), len(wanted.tetrahedra))
    row = row_of("mesh", name, "-n", "900", "-o", "b.vtu", "--measures")
    assert [row["labels"][tag]["volume"] for tag in "12"] == pytest.approx(np.bincount(stack.ravel())[1:], rel=0.003)
    assert min(one["least_angle"] for one in row["labels"].values()) == row["least_angle"] > 14
    assert np.unique(meshio.read("b.vtu").cell_data["tag"]).tolist() == [1, 2]
    assert (meshio.read("a.vtu").cells_dict["tetra"] == wanted.tetrahedra).all()


def test_one_label_is_meshed(row_of: RowOf) -> None:
    row = row_of("mesh", "labels.png", "-n", "90", "--label", "2", "-o", "a.vtu")
    assert row["area"] == pytest.approx((cvtimg.read_image("labels.png") == 2).sum())
    assert "n_straight" not in row
    row = row_of("mesh", "labels.png", "-n", "90", "--label", "3", "-o", "c.vtu", "--order", "2")
    assert (row["n"], row["n_straight"]) == (90, 0)
    assert len(meshio.read("c.vtu").cells_dict["triangle6"]) == row["triangles"]


def test_names_of_regions_and_borders_are_groups(row_of: RowOf) -> None:
    row = row_of("mesh", "a.wkt", "-n", 30, "-o", "a.msh", "--name", "steel=1", "--name", "left=0,1,0,0")
    assert row["names"] == {"steel": 1, "left": 2}
    found = meshio.read("a.msh")
    left = found.cells_dict["line"][found.cell_data_dict["gmsh:physical"]["line"] == 2]
    assert found.field_data["left"].tolist() == [2, 1]
    assert (found.points[left, 0] == 0).all()
    assert np.ptp(found.points[left, 1]) == 1


def test_properties_of_features_name_regions(row_of: RowOf) -> None:
    features = []
    for x, name in enumerate(["North Sea", "land"]):
        square = {"type": "Polygon", "coordinates": [[[x, 0], [x + 1, 0], [x + 1, 1], [x, 1], [x, 0]]]}
        features.append({"type": "Feature", "properties": {"name": name, "kind": "metal"}, "geometry": square})
    Path("map.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    for words, names in (([], {"North_Sea": 1, "land": 2}), (["--name-by", "kind"], {"metal": 1})):
        assert row_of("mesh", "map.geojson", "-n", 60, "-o", "b.msh", "--overwrite", *words)["names"] == names
        assert {name: number for name, (number, kind) in meshio.read("b.msh").field_data.items() if kind == 2} == names


# Surfaces


@pytest.fixture
def ring() -> None:
    cvtimg.surface_points(torus(), 800, effort="fast").save("ring.stl")


@pytest.mark.slow
@pytest.mark.usefixtures("ring")
def test_a_surface_is_remeshed_as_by_the_function(row_of: RowOf) -> None:
    row = row_of("surface", "ring.stl", "-n", "300", "-o", "a.obj", "--plot", "a.png")
    wanted = cvtimg.surface_points("ring.stl", 300)
    assert (row["n"], row["triangles"], row["euler_characteristic"], row["is_closed"]) == (300, 600, 0, True)
    assert row["energy"] == pytest.approx(wanted.energy)
    assert row["area"] == pytest.approx(4 * np.pi**2 * 0.4, rel=0.02)
    assert row["output"] == "a.obj"
    assert Path("a.obj").read_text().count("\nf ") == 600
    assert cvtimg.read_image("a.png").std() > 20
