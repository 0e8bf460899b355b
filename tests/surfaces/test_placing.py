from dataclasses import astuple
from pathlib import Path

import meshio
import numpy as np
import pytest
from reference import assert_the_guide_tells, cube
from scipy.spatial import KDTree

from cvtimg import surface_points
from cvtimg._shared.types import Floats
from cvtimg.halfedges import edges_around, unique_edges
from cvtimg.surfaces import EFFORTS, ImplicitSurface, SurfacePoints, TriangulatedSurface, VertexDensity, torus

Points = Floats


def ball(p: Points) -> Points:
    return np.linalg.norm(p, axis=1) - 1


@pytest.fixture(scope="module")
def on_torus() -> SurfacePoints:
    return surface_points(torus(), 1000)


def test_points_are_on_the_surface_and_triangles_have_its_shape_and_are_regular(on_torus: SurfacePoints) -> None:
    around = np.hypot(on_torus.points[:, 0], on_torus.points[:, 1])
    assert np.allclose(np.hypot(around - 1, on_torus.points[:, 2]), 0.4, atol=1e-12)
    measures = on_torus.measures()
    assert measures.is_closed
    assert measures.euler_characteristic == 0
    assert on_torus.masses.sum() == pytest.approx(4 * np.pi**2 * 0.4, rel=0.01)
    assert measures.least_angle > 30
    assert measures.mean_quality > 0.96
    assert measures.n_obtuse < 20


def test_points_are_centers_of_mass_of_their_cells(on_torus: SurfacePoints) -> None:
    # An independent sum over samples of the surface, assigned to the nearest point.
    turns = np.random.default_rng(0).random((300_000, 2)) * 2 * np.pi
    radius = 1 + 0.4 * np.cos(turns[:, 1])
    turns, radius = (x[np.random.default_rng(1).random(len(x)) * 1.4 < radius] for x in (turns, radius))
    places = np.stack([radius * np.cos(turns[:, 0]), radius * np.sin(turns[:, 0]), 0.4 * np.sin(turns[:, 1])], axis=1)
    distances, cell = KDTree(on_torus.points).query(places)
    area = 4 * np.pi**2 * 0.4
    assert on_torus.energy == pytest.approx((distances**2).mean() * area, rel=0.01)
    counts = np.bincount(cell, minlength=1000)
    centers = np.stack([np.bincount(cell, x, 1000) / counts for x in places.T], axis=1)
    around = np.hypot(centers[:, 0], centers[:, 1])
    middle = np.stack([centers[:, 0] / around, centers[:, 1] / around, np.zeros(1000)], axis=1)
    outward = (centers - middle) / np.linalg.norm(centers - middle, axis=1, keepdims=True)
    steps = middle + 0.4 * outward - on_torus.points
    size = (area / 1000) ** 0.5
    assert np.sqrt((steps**2).sum(axis=1).mean()) < 0.05 * size


def test_no_opposite_angles_add_up_to_more_than_180_degrees(on_torus: SurfacePoints) -> None:
    corners = on_torus.points[on_torus.triangles]
    u, v = (np.roll(corners, -step, axis=1) - corners for step in (1, 2))
    cosines = np.einsum("tki,tki->tk", u, v) / np.linalg.norm(u, axis=2) / np.linalg.norm(v, axis=2)
    edge = unique_edges(edges_around(on_torus.triangles[:, [1, 2, 0]]))[1]  # opposite to each corner
    assert np.bincount(edge, np.arccos(cosines).ravel()).max() <= np.pi + 1e-6


def test_a_ball_gets_a_sphere() -> None:
    found = surface_points(ImplicitSurface(ball, [-1.1] * 3, [1.1] * 3), 300)
    assert np.allclose(np.linalg.norm(found.points, axis=1), 1, atol=1e-9)
    assert found.measures().euler_characteristic == 2
    # Regular hexagons of the same area would have this.
    assert found.energy * 300 == pytest.approx(5 / (18 * 3**0.5) * (4 * np.pi) ** 2, rel=0.02)
    normals = np.cross(*(found.points[found.triangles[:, k]] - found.points[found.triangles[:, 0]] for k in (1, 2)))
    assert (np.einsum("ij,ij->i", normals, found.points[found.triangles[:, 0]]) > 0).all()


@pytest.mark.slow
def test_distances_follow_the_density() -> None:
    def density(p: Points) -> Points:
        return np.exp(2 * p[:, 2])

    found = surface_points(ImplicitSurface(ball, [-1.1] * 3, [1.1] * 3), 1000, density=density)
    sides = found.points[found.triangles] - found.points[np.roll(found.triangles, 1, axis=1)]
    lengths = np.linalg.norm(sides, axis=2).mean(axis=1)
    height = found.points[found.triangles][:, :, 2].mean(axis=1)
    assert np.corrcoef(np.log(lengths), height)[0, 1] < -0.9
    slope = np.polyfit(height[np.abs(height) < 0.8], np.log(lengths[np.abs(height) < 0.8]), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.05)
    assert found.measures().least_angle > 30


@pytest.mark.slow
def test_densities_at_vertices_are_linear_in_between() -> None:
    fine = surface_points(torus(), 600, effort="fast")
    linear = VertexDensity(fine.points, fine.triangles, 2 + fine.points @ [0.5, 1, -1])
    shares = np.random.default_rng(0).dirichlet(np.ones(3), len(fine.triangles))
    places = np.einsum("tk,tki->ti", shares, fine.points[fine.triangles])
    assert linear(places) == pytest.approx(2 + places @ [0.5, 1, -1], abs=1e-9)
    values = np.where(fine.points[:, 0] > 0, 16.0, 1.0)
    found = surface_points(
        (fine.points, fine.triangles), 300, density=VertexDensity(fine.points, fine.triangles, values)
    )
    assert (found.points[:, 0] > 0).mean() == pytest.approx(0.8, abs=0.05)


@pytest.mark.slow
def test_a_density_is_seen_inside_of_large_triangles() -> None:
    # It is next to nothing at the corners of the cube.
    found = surface_points(cube(), 300, density=lambda p: np.exp(-20 * ((p - [1, 0.3, 0.2]) ** 2).sum(axis=1)))
    assert (found.points[:, 0] > 0.9).mean() > 0.8
    assert found.measures().euler_characteristic == 2


@pytest.mark.slow
def test_more_effort_gives_less_energy() -> None:
    energies = [surface_points(torus(), 200, effort=effort).energy for effort in ("fast", "balanced", "best")]
    assert energies[0] > energies[1] >= energies[2] * 0.999


@pytest.mark.slow
def test_steps_beyond_centers_of_mass_lead_there_sooner() -> None:
    assert surface_points(torus(), 300).n_iter < 100  # 145 by shorter steps


def test_walks_end_at_the_nearest_points_of_a_mesh() -> None:
    mesh = torus().triangulation
    start = np.random.default_rng(0).integers(len(mesh.triangles), size=300).astype(np.int32)
    places = mesh.points[mesh.triangles[start]].mean(axis=1) + np.random.default_rng(1).normal(size=(300, 3)) * 0.02
    found, faces = mesh.nearest(places, start)
    # By many points of every triangle.
    shares = np.array([[i, j, 12 - i - j] for i in range(13) for j in range(13 - i)]) / 12
    samples = np.einsum("sk,tki->tsi", shares, mesh.points[mesh.triangles]).reshape(-1, 3)
    nearest, _ = KDTree(samples).query(places)
    distance = np.linalg.norm(found - places, axis=1)
    assert (distance <= nearest + 1e-12).mean() > 0.95  # a walk ends in the first hollow
    assert np.allclose(distance, nearest, atol=5e-3)
    a, b, c = (mesh.points[mesh.triangles[faces, k]] for k in range(3))
    assert np.allclose(np.einsum("ij,ij->i", np.cross(b - a, c - a), found - a), 0, atol=1e-12)


@pytest.mark.parametrize("suffix", [".vtu", ".obj", ".ply", ".stl", ".off"])
def test_triangles_are_saved(on_torus: SurfacePoints, tmp_path: Path, suffix: str) -> None:
    on_torus.save(tmp_path / f"a{suffix}")
    found = meshio.read(tmp_path / f"a{suffix}")
    places = found.points[found.cells_dict["triangle"]]
    assert np.allclose(places, on_torus.points[on_torus.triangles], atol=1e-6)


@pytest.mark.slow
def test_parts_that_touch_in_a_vertex_are_divided() -> None:
    corners, faces = cube()
    both = np.concatenate([corners, corners + 2])
    far = np.flatnonzero((corners == 1).all(axis=1))[0]  # where the cubes touch
    second = np.where(faces + 8 == 8 + np.flatnonzero((corners == -1).all(axis=1))[0], far, faces + 8)
    surface = TriangulatedSurface(both, np.concatenate([faces, second]))
    assert surface.triangulation.euler_characteristic == 4
    assert surface_points(surface, 200).measures().euler_characteristic == 4


@pytest.mark.slow
def test_cells_wider_than_the_surface_is_thick_keep_its_shape() -> None:
    # The density of the lecture: 256 points, of which three or four go around the tube at its ends.
    found = surface_points(torus(), 256, density=lambda p: np.exp(-5 * np.abs(p[:, 1])))
    measures = found.measures()
    assert (measures.is_closed, measures.euler_characteristic) == (True, 0)
    assert measures.least_angle > 25
    assert found.energy < 0.014


@pytest.mark.parametrize("n", [60, pytest.param(300, marks=pytest.mark.slow)])
def test_a_thin_plate_keeps_both_sides(n: int) -> None:
    corners, faces = cube()
    found = surface_points((corners * [1, 1, 0.01], faces), n, effort="fast")
    measures = found.measures()
    assert (measures.is_closed, measures.euler_characteristic) == (True, 2)
    assert found.offset < 1
    assert (np.abs(found.points[:, 2]) <= 0.01 + 1e-12).all()
    # No move folds a triangle over others: those of the upper side face up.
    above = found.points[found.triangles][(found.points[found.triangles][:, :, 2] > 0.01 - 1e-9).all(axis=1)]
    assert (np.cross(above[:, 1] - above[:, 0], above[:, 2] - above[:, 0])[:, 2] > -1e-9).all()


@pytest.mark.slow
def test_a_density_of_0_on_a_part_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="the density is 0 on about 4.% of the surface"):
        surface_points(torus(), 200, density=lambda p: (p[:, 0] > 0).astype(float), effort="fast")


def test_the_guide_tells_how_much_each_effort_does() -> None:
    assert_the_guide_tells("surfaces.md", {name: astuple(effort) for name, effort in EFFORTS.items()})
