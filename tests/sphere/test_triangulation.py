"""Delaunay triangulations of the sphere."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import sets_of, uniform_cell_moments
from scipy.spatial import ConvexHull, SphericalVoronoi

from cvtimg._shared.types import Floats, Ints
from cvtimg.halfedges import edges_around
from cvtimg.sphere import triangulate
from cvtimg.sphere.triangulation import SphereTriangulation, unit

Points = Floats


def random_points(n: int, seed: int = 0) -> Points:
    return unit(np.random.default_rng(seed).normal(size=(n, 3)))


def lattice(n_lon: int, n_lat: int) -> Points:
    """Points of a latitude-longitude grid with both poles: four and more of them on one circle everywhere."""
    lon = 2 * np.pi * np.arange(n_lon) / n_lon
    lat = np.pi * (np.arange(1, n_lat) / n_lat - 0.5)
    ring = np.stack(
        [np.outer(np.cos(lat), np.cos(lon)), np.outer(np.cos(lat), np.sin(lon)), np.outer(np.sin(lat), lon**0)], axis=-1
    )
    return np.concatenate([[[0, 0, -1.0]], ring.reshape(-1, 3), [[0, 0, 1.0]]])


def assert_is_delaunay(points: Points, triangles: Ints) -> None:
    """No point is above the plane of a triangle, and the triangles form a closed, oriented sphere."""
    assert triangles.shape == (2 * len(points) - 4, 3)
    edges = edges_around(triangles)
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert {tuple(edge) for edge in edges} == {tuple(edge[::-1]) for edge in edges}
    assert len(np.unique(triangles)) == len(points)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    heights = points @ normals.T - np.einsum("ij,ij->i", a, normals)
    assert heights.max() < 1e-12


CUBE = unit(np.array(list(itertools.product([-1.0, 1.0], repeat=3))))


@pytest.mark.parametrize("points", [*(lattice(*n) for n in ((3, 2), (4, 2), (5, 3), (36, 18), (90, 7))), CUBE])
def test_points_of_a_lattice_and_of_regular_bodies_are_triangulated(points: Points) -> None:
    assert_is_delaunay(points, triangulate(points))


@given(
    seed=st.integers(0, 10**6),
    n=st.integers(4, 60),
    width=st.sampled_from([1e-3, 0.03, 0.3, 3.0]),
    digits=st.sampled_from([1, 2, 16]),
)
@settings(max_examples=50, deadline=None)
def test_clusters_hemispheres_and_points_on_circles_are_triangulated(
    seed: int, n: int, width: float, digits: int
) -> None:
    rng = np.random.default_rng(seed)
    center = rng.normal(size=3)
    center /= np.linalg.norm(center)
    # Rounded, so that many points are on one plane.
    points = unit(center + (width * rng.normal(size=(n, 3)).round(digits)))
    points = points[np.unique(points.round(6), axis=0, return_index=True)[1]]
    if len(points) < 4 or np.linalg.svd(points - points[0], compute_uv=False)[2] < 1e-7:
        return
    assert_is_delaunay(points, triangulate(points))


def test_flips_follow_moving_points() -> None:
    mesh = SphereTriangulation(random_points(2000))
    for _ in range(5):
        mesh.replace(unit(uniform_cell_moments(mesh)))
    step = 0.1 * np.sqrt(mesh.areas())[:, None]
    assert mesh.move(unit(mesh.points + step * np.random.default_rng(1).normal(size=mesh.points.shape)))
    assert sets_of(mesh.triangles) == sets_of(ConvexHull(mesh.points).simplices)


def test_a_move_that_turns_triangles_over_changes_nothing() -> None:
    mesh = SphereTriangulation(random_points(50))
    before, triangles = mesh.points, mesh.triangles.copy()
    assert not mesh.move(random_points(50, 1))
    assert mesh.points is before
    assert (mesh.triangles == triangles).all()


def test_areas_and_cells_agree_with_scipy() -> None:
    points = random_points(300)
    mesh, oracle = SphereTriangulation(points), SphericalVoronoi(points)
    oracle.sort_vertices_of_regions()
    assert mesh.areas() == pytest.approx(oracle.calculate_areas(), abs=1e-12)
    cells = mesh.cells()
    assert [len(corners) for corners in cells] == np.diff(cells.offsets).tolist()
    for i in (0, 7, 299):
        expected = oracle.vertices[oracle.regions[i]]
        assert np.sort(cells[i], axis=0) == pytest.approx(np.sort(expected, axis=0))
        turn = np.cross(cells[i] - points[i], np.roll(cells[i], -1, axis=0) - points[i]) @ points[i]
        assert (turn > 0).all()


@pytest.mark.parametrize("width", [0.01, 0.3, 1.0])
def test_moments_of_points_on_one_side_agree_with_their_cells(width: float) -> None:
    points = unit(np.array([0.0, 0.0, 1.0]) + width * np.random.default_rng(7).normal(size=(40, 3)))
    mesh = SphereTriangulation(points)
    cells, moments = mesh.cells(), uniform_cell_moments(mesh)
    for i, point in enumerate(points):
        corners = cells[i]
        following = np.roll(corners, -1, axis=0)
        normals = np.cross(corners, following)
        arcs = np.arctan2(np.linalg.norm(normals, axis=1), np.einsum("ij,ij->i", corners, following))
        expected = 0.5 * arcs @ unit(normals)
        assert moments[i] == pytest.approx(expected, abs=1e-9), point


def test_triangles_are_near_each_other_in_memory() -> None:
    mesh = SphereTriangulation(random_points(20_000))
    places = mesh.points[mesh.triangles].mean(axis=1)
    gaps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert np.median(gaps) < 1.2 * np.sqrt(4 * np.pi / 20_000)
    edges = np.arange(mesh.triangles.size)
    assert (mesh.twins.ravel()[mesh.twins.ravel()] == edges).all()


@pytest.mark.slow
def test_weighted_moments_of_a_constant_density_agree_with_exact_ones() -> None:
    mesh = SphereTriangulation(random_points(20_000))
    for _ in range(3):
        mesh.replace(unit(uniform_cell_moments(mesh)))
    centers = mesh.circumcenters()
    masses, moments, energies = mesh.weighted_moments(np.full(20_000, 3.0), centers, np.full(len(centers), 3.0))
    assert masses == pytest.approx(3 * mesh.areas())
    exact = 3 * uniform_cell_moments(mesh)
    assert np.abs(unit(moments) - unit(exact)).max() < 1e-6
    assert energies.sum() == pytest.approx(24 * np.pi - 2 * np.einsum("ij,ij", exact, mesh.points), rel=1e-3)
