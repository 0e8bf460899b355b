from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from commands import RowOf

import cvtimg
from cvtimg.cli.app import main
from cvtimg.surfaces import torus


@pytest.fixture
def here(here: Path) -> Path:
    cvtimg.surface_points(torus(), 800, effort="fast").save("ring.stl")
    (here / "broken.stl").write_bytes(b"solid nothing")
    return here


def test_a_surface_is_remeshed_as_by_the_function(row_of: RowOf) -> None:
    row = row_of("surface", "ring.stl", "-n", "300", "-o", "a.obj", "--plot", "a.png")
    wanted = cvtimg.surface_points("ring.stl", 300)
    assert (row["n"], row["triangles"], row["euler_characteristic"], row["is_closed"]) == (300, 600, 0, True)
    assert row["energy"] == pytest.approx(wanted.energy)
    assert row["area"] == pytest.approx(4 * np.pi**2 * 0.4, rel=0.02)
    assert row["output"] == "a.obj"
    assert Path("a.obj").read_text().count("\nf ") == 600
    assert cvtimg.read_image("a.png").std() > 20


@pytest.mark.slow
@pytest.mark.parametrize("encoding", [pytest.param("ascii", marks=pytest.mark.slow), "binary"])
def test_points_gather_by_a_property_of_vertices(capsys: pytest.CaptureFixture[str], encoding: str) -> None:
    ring = trimesh.load_mesh("ring.stl")
    ring.vertex_attributes["want"] = np.where(ring.vertices[:, 0] > 0, 16.0, 1.0)
    ring.vertex_attributes["less"] = -np.ones(len(ring.vertices))
    Path("ring.ply").write_bytes(ring.export(file_type="ply", encoding=encoding))
    assert main(["surface", "ring.ply", "-n", "400", "--density", "want", "-o", "a.off"]) == 0
    points = trimesh.load_mesh("a.off").vertices
    assert (points[:, 0] > 0).mean() == pytest.approx(0.8, abs=0.05)
    capsys.readouterr()
    for name, message in (
        ("none", "vertex property='none' must be one of x, y, z, want, less"),
        ("less", "values must be finite and >= 0"),
    ):
        assert main(["surface", "ring.ply", "-n", "400", "--density", name, "-o", "b.off"]) == 1
        shown = capsys.readouterr().err
        assert message in shown
        assert len(shown.splitlines()) == 1
    assert not Path("b.off").exists()
