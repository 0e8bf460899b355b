from pathlib import Path

import meshio
import numpy as np
import pytest
import shapely
from reference import ring

from cvtimg import mesh_labels, mesh_region
from cvtimg.meshes import Mesh, QuadraticTriangles
from cvtimg.meshes.outlines import label_outline


@pytest.fixture(scope="module")
def disk() -> Mesh:
    return mesh_region(ring(400), n=60, order=2, effort="fast")


def six(mesh: Mesh) -> QuadraticTriangles:
    assert mesh.quadratic is not None
    return mesh.quadratic


def check_inner_sides(mesh: Mesh) -> None:
    """Check that they are straight."""
    found = six(mesh)
    inner = ~np.isin(found.triangles[:, 3:], found.edges[:, 2])
    straight = (mesh.points[mesh.triangles] + mesh.points[np.roll(mesh.triangles, -1, axis=1)]) / 2
    assert np.allclose(found.nodes[found.triangles[:, 3:]][inner], straight[inner], atol=1e-13)


def test_sides_on_borders_bend_with_them_and_the_others_are_straight(disk: Mesh) -> None:
    found = six(disk)
    assert len(disk.points) == 60
    assert (found.nodes[:60] == disk.points).all()
    assert (found.triangles[:, :3] == disk.triangles).all()
    assert np.abs(np.linalg.norm(found.nodes[found.edges], axis=2) - 1).max() < 5e-5
    check_inner_sides(disk)
    assert (found.jacobians > 0).all()
    assert found.n_straight == 0
    assert disk.area == pytest.approx(np.pi, rel=3e-4)  # sides that are straight miss 50 times as much


def test_jacobians_are_bounded_by_their_coefficients(disk: Mesh) -> None:
    found = six(disk)
    shares = np.random.default_rng(0).dirichlet(np.ones(3), 50)
    a, b, c = shares.T
    # Derivatives of the six shape functions by the second and third share.
    zero = np.zeros_like(a)
    by_b = np.stack([1 - 4 * a, 4 * b - 1, zero, 4 * (a - b), 4 * c, -4 * c])
    by_c = np.stack([1 - 4 * a, zero, 4 * c - 1, -4 * b, 4 * b, 4 * (a - c)])
    u, v = (np.einsum("tkx,ks->tsx", found.nodes[found.triangles], by) for by in (by_b, by_c))
    jacobians = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    low, high = found.jacobians.min(axis=1), found.jacobians.max(axis=1)
    assert (jacobians >= low[:, None] - 1e-12).all()
    assert (jacobians <= high[:, None] + 1e-12).all()


def test_sides_that_would_fold_a_triangle_over_stay_straight() -> None:
    half = ring(400)[:201]
    thin = np.concatenate([half, 0.99 * half[::-1]])
    mesh = mesh_region(thin, edge_length=0.5, order=2, effort="fast")
    assert (six(mesh).jacobians > 0).all()


def test_segments_keep_their_areas_and_bend_with_smooth_borders() -> None:
    y, x = np.mgrid[:40, :50]
    labels = 1 + (np.hypot(x - 25, y - 20) < 14).astype(np.int32)
    mesh = mesh_labels(labels, edge_length=6, order=2)
    check_inner_sides(mesh)
    areas = np.bincount(mesh.tags, six(mesh).areas)[1:]
    assert np.allclose(areas, np.bincount(labels.ravel())[1:], rtol=1e-6)
    contours = shapely.MultiLineString(list(label_outline(labels, None, 0.7).lines))
    assert shapely.distance(contours, shapely.points(six(mesh).nodes[six(mesh).edges])).max() < 0.1


@pytest.mark.parametrize("suffix", [".vtu", ".msh", ".inp", ".xdmf", ".vtk"])
def test_other_programs_read_six_nodes(disk: Mesh, tmp_path: Path, suffix: str) -> None:
    if suffix == ".xdmf":
        pytest.importorskip("h5py")  # which meshio needs for it
    disk.save(tmp_path / f"a{suffix}")
    found = meshio.read(tmp_path / f"a{suffix}")
    assert (found.cells_dict["triangle6"] == six(disk).triangles).all()
    assert np.allclose(found.points[:, :2], six(disk).nodes, atol=1e-15)
    if suffix == ".msh":
        assert (found.cells_dict["line3"] == six(disk).edges).all()


def test_formats_of_straight_triangles_are_refused(disk: Mesh, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"suffix='\.stl' must be one of \.vtu, \.msh"):
        disk.save(tmp_path / "a.stl")
