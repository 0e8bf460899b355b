from pathlib import Path

import meshio
import numpy as np
import pytest

from cvtimg import mesh_labels
from cvtimg.halfedges import boundary_edges
from cvtimg.meshes import Mesh


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return mesh_labels(np.repeat([[3, 5]], 6, axis=0).repeat(6, axis=1), n=50)


@pytest.mark.parametrize("suffix", [".vtu", ".msh", ".obj", ".ply", ".stl", ".vtk", ".off", ".su2"])
def test_other_programs_read_the_same_triangles_tags_and_borders(mesh: Mesh, tmp_path: Path, suffix: str) -> None:
    mesh.save(tmp_path / f"a{suffix}")
    found = meshio.read(tmp_path / f"a{suffix}")
    triangles = np.concatenate([cells.data for cells in found.cells if cells.type == "triangle"])
    places, expected = found.points[triangles][:, :, :2].mean(axis=1), mesh.points[mesh.triangles].mean(axis=1)
    off = np.abs(np.sort(places, axis=0) - np.sort(expected, axis=0)).max()
    assert off < (1e-5 if suffix == ".stl" else 1e-12)  # of single precision
    if suffix in (".vtu", ".msh", ".vtk"):
        tags = found.cell_data_dict["gmsh:physical" if suffix == ".msh" else "tag"]["triangle"]
        assert (np.ravel(tags) == mesh.tags).all()
    if suffix == ".msh":
        assert (np.sort(found.cells_dict["line"], axis=1) == np.sort(mesh.edges, axis=1)).all()


def test_groups_of_regions_and_borders_have_different_numbers(mesh: Mesh, tmp_path: Path) -> None:
    mesh.save(tmp_path / "a.msh")
    numbers = [int(number) for number, _ in meshio.read(tmp_path / "a.msh").field_data.values()]
    assert len({*numbers}) == len(numbers) == 3


def test_nastran_holds_any_coordinates(mesh: Mesh, tmp_path: Path) -> None:
    from dataclasses import replace

    far = replace(mesh, points=-1e3 * np.pi * mesh.points)
    far.save(tmp_path / "a.bdf")
    np.testing.assert_allclose(meshio.read(tmp_path / "a.bdf").points[:, :2], far.points, rtol=1e-9)


def test_other_suffixes_are_refused(mesh: Mesh, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"suffix='\.xyz' must be one of"):
        mesh.save(tmp_path / "a.xyz")


@pytest.fixture(scope="module")
def named(mesh: Mesh) -> Mesh:
    return mesh.named(regions={3: "left"}, borders={"top": lambda p: p[:, 1] == 0, "rest": lambda p: p[:, 1] > 0})


def test_solvers_read_the_names_of_regions_and_borders(named: Mesh, tmp_path: Path) -> None:
    skfem = pytest.importorskip("skfem")
    named.save(tmp_path / "a.msh")
    found = skfem.MeshTri.load(tmp_path / "a.msh")
    assert found.boundaries is not None
    assert found.subdomains is not None
    assert np.allclose(found.p[1, found.facets[:, found.boundaries["top"]]], 0)
    assert len(found.boundaries["top"]) + len(found.boundaries["rest"]) == len(boundary_edges(named.triangles))
    assert len(found.subdomains["left"]) == (named.tags == 3).sum()


def test_names_are_arrays_in_vtu_files(named: Mesh, tmp_path: Path) -> None:
    named.save(tmp_path / "a.vtu")
    found = meshio.read(tmp_path / "a.vtu")
    triangles, lines = found.cells
    assert (triangles.data == named.triangles).all()
    assert (lines.data == named.edges).all()
    assert (found.cell_data["left"][0].ravel() == (named.tags == 3)).all()
    for name in ("top", "rest"):
        in_triangles, in_lines = found.cell_data[name]
        assert not in_triangles.any()
        of_name = lines.data[in_lines.ravel() == 1]
        assert ((found.points[of_name, 1] == 0).all(axis=1) == (name == "top")).all()
    assert named.edge_tags is not None
    assert np.concatenate(found.cell_data["tag"]).ravel().tolist() == [*named.tags, *named.edge_tags]


def test_names_are_sets_in_abaqus_files(named: Mesh, tmp_path: Path) -> None:
    named.save(tmp_path / "a.inp")
    found = meshio.read(tmp_path / "a.inp")
    assert found.cell_sets["left"][0].tolist() == np.flatnonzero(named.tags == 3).tolist()
    assert found.point_sets["top"].tolist() == np.flatnonzero(named.points[:, 1] == 0).tolist()
    assert "*ELEMENT, TYPE=CPS3\n" in (tmp_path / "a.inp").read_text()


def test_wrong_names_are_told(mesh: Mesh) -> None:
    with pytest.raises(ValueError, match="borders has 'none', which must be true for the middle of some edge"):
        mesh.named(borders={"none": lambda p: p[:, 0] < -1})
    with pytest.raises(ValueError, match="regions has 9, which must be a label in tags"):
        mesh.named(regions={9: "none"})
    for word in ("two words", "tag", "left"):
        with pytest.raises(ValueError, match=f"the name '{word}' must be a word, given once, and none of"):
            mesh.named(regions={3: "left"}, borders={word: lambda p: p[:, 0] == 0})
