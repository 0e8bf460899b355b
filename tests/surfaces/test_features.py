import numpy as np
import pytest
from reference import cube, ring

from cvtimg import surface_points
from cvtimg._shared.types import Floats, Ints
from cvtimg.halfedges import boundary_edges, edges_around, measure_triangles, unique_edges
from cvtimg.surfaces import ImplicitSurface, SurfacePoints, measure_surface
from cvtimg.surfaces.features import find_features
from cvtimg.surfaces.triangulation import SurfaceTriangulation

Points = Floats
Triangles = Ints


def grid(n_x: int, n_y: int, *, wraps: bool = False) -> Triangles:
    """Two triangles in each square between (n_x, n_y) vertices."""
    number = np.arange(n_x * n_y).reshape(n_x, n_y)
    number = np.concatenate([number, number[:1]]) if wraps else number
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def sheet(height: float = 0.0) -> tuple[Points, Triangles]:
    """2 x 1, with a fold along y = 0.5 of the given height at one end, that has gone in the middle."""
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0, 2, 41), np.linspace(0, 1, 21), indexing="ij"))
    return np.stack([x, y, height * np.clip(1 - x, 0, None) * (1 - np.abs(2 * y - 1))], axis=1), grid(41, 21)


def sphere(noise: float) -> tuple[Points, Triangles]:
    ball = ImplicitSurface(lambda p: np.linalg.norm(p, axis=1) - 1, [-1.1] * 3, [1.1] * 3, spacing=0.15).triangulation
    rng = np.random.default_rng(0)
    return ball.points * (1 + noise * rng.normal(size=(len(ball.points), 1))), ball.triangles


def area(found: SurfacePoints) -> float:
    return float(measure_triangles(found.points, found.triangles).areas.sum())


def test_corners_edges_and_faces_of_a_cube_are_kept() -> None:
    found = surface_points(cube(), 300, effort="fast")
    assert found.points.shape == (300, 3)
    measures = found.measures()
    assert (measures.is_closed, measures.euler_characteristic) == (True, 2)
    assert measures.least_angle > 30
    assert area(found) == pytest.approx(24, abs=1e-9)
    assert found.masses.sum() == pytest.approx(24)
    assert np.isclose(np.abs(found.points), 1).all(axis=1).sum() == 8
    # Each triangle is in one face.
    assert np.allclose(np.abs(found.points[found.triangles].sum(axis=1)).max(axis=1), 3)


@pytest.mark.slow
def test_points_divide_circles_evenly() -> None:
    rings = np.concatenate([np.c_[ring(48), np.full(48, z)] for z in (0.0, 1)]).reshape(2, 48, 3)
    walls = rings.transpose(1, 0, 2).reshape(-1, 3)
    ends = np.array([[0, 2 * i, 2 * i - 2] for i in range(2, 48)])
    faces = np.concatenate([grid(48, 2, wraps=True), ends, ends[:, ::-1] + 1])
    found = surface_points((walls, faces), 400, effort="fast")
    for z in (0, 1):
        rim = found.points[(found.points[:, 2] == z) & (np.hypot(*found.points[:, :2].T) > 0.99)]
        angles = np.sort(np.arctan2(rim[:, 1], rim[:, 0]))
        assert np.ptp(np.diff(angles)) < 0.1 * np.diff(angles).mean()
        assert len(rim) == pytest.approx(2 * np.pi / (4 * np.pi / 400 / 0.75**0.5) ** 0.5, rel=0.1)
    assert found.measures().euler_characteristic == 2


def test_borders_and_areas_of_open_surfaces_are_kept() -> None:
    found = surface_points(sheet(), 200, effort="fast")
    ends = found.points[boundary_edges(found.triangles)]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(6)
    assert area(found) == pytest.approx(2)
    assert found.measures().least_angle > 30
    assert len(found.points) == 200


@pytest.mark.slow
def test_creases_may_end_within_a_face() -> None:
    found = surface_points(sheet(1.0), 400, effort="fast", feature_angle=60)
    mesh = SurfaceTriangulation(found.points, found.triangles)
    on_fold = np.isclose(found.points[:, 1], 0.5) & (found.points[:, 0] < 0.65)
    ends = np.unique(np.sort(mesh.edges[on_fold[mesh.edges].all(axis=1)], axis=1), axis=0)
    lengths = np.abs(np.diff(found.points[ends][:, :, 0], axis=1)).sum()
    assert lengths == pytest.approx(found.points[on_fold, 0].max())
    assert lengths > 0.5
    assert found.measures().euler_characteristic == 1


def test_curves_follow_the_density() -> None:
    found = surface_points(sheet(), 400, density=lambda p: np.exp(4 * p[:, 0]), effort="fast")
    x = np.sort(found.points[np.abs(found.points[:, 1]) < 1e-9, 0])
    slope = np.polyfit((x[1:] + x[:-1]) / 2, np.log(np.diff(x)), 1)[0]
    assert slope == pytest.approx(-1, abs=0.1)  # exp(4 x)^(-1/4)


def test_three_sheets_meet_in_one_curve() -> None:
    ends = np.array([[0, 0], [1, 0], [-0.5, 0.8], [-0.5, -0.8]])
    points = np.concatenate([np.c_[ends, np.full(4, z)] for z in (0.0, 1)])
    faces = np.array([corner for k in (1, 2, 3) for corner in ([0, k, k + 4], [0, k + 4, 4])])
    found = surface_points((points, faces), 150, effort="fast")
    edges, _, counts = unique_edges(edges_around(found.triangles))
    assert np.allclose(found.points[edges[counts == 3]][:, :, :2], 0)
    corners, sides = cube()
    fin = np.append(corners, [[2.0, 2, 2]], axis=0), np.append(sides, [[*sides[0, :2], 8]], axis=0)
    assert surface_points(fin, 200, effort="fast").measures().n_borders == 1
    heights = found.points[edges[counts == 3]][:, :, 2]
    assert np.abs(np.diff(heights, axis=1)).sum() == pytest.approx(1)
    assert area(found) == pytest.approx(measure_triangles(points, faces).areas.sum())


@pytest.mark.slow
def test_creases_of_noise_are_left_out_or_whole() -> None:
    points, faces = sphere(0.002)
    mesh = SurfaceTriangulation(points, faces)
    assert find_features(mesh, 12, np.full(len(points), 1e-3), len(faces)).any()
    assert not find_features(mesh, 12, np.full(len(points), 9.0), len(faces)).any()
    rough = SurfaceTriangulation(*sphere(0.03))  # whose faces are about as wide as points are apart
    assert not find_features(rough, 40, np.full(len(points), 0.2), len(faces)).any()
    found = surface_points((points, faces), 500, feature_angle=15, effort="fast")
    measures = found.measures()
    assert (len(found.points), measures.is_closed, measures.euler_characteristic) == (500, True, 2)
    assert measures.least_angle > 30


def test_a_crease_among_those_of_noise_is_kept() -> None:
    points, faces = sheet()
    noise = np.random.default_rng(0).normal(size=len(points))
    points[:, 2] = np.abs(points[:, 1] - 0.5) + 0.006 * noise
    mesh = SurfaceTriangulation(points, faces)
    normals, twins = mesh.face_normals(), mesh.twins.ravel()
    cosines = np.einsum("ij,ij->i", normals.repeat(3, axis=0), normals[twins // 3])
    ridge = (np.abs(points[mesh.edges][:, :, 1] - 0.5) < 1e-9).all(axis=1)
    assert ((cosines < np.cos(np.radians(20))) & ~ridge & (twins >= 0)).sum() > 100
    found = find_features(mesh, 20, np.full(len(points), 0.25), len(faces))
    assert (found == (ridge | (twins < 0))).all()


def test_the_steps_of_a_scan_are_no_corners() -> None:
    points, faces = sheet()
    x = points[:, 0].copy()
    points[points[:, 1] == 0, 1] = 0.02 * (np.rint(x[points[:, 1] == 0] * 20) % 2)
    found = surface_points((points, faces), 60, effort="fast")
    assert (found.points[:, 1] < 0.03).sum() < 15


def test_components_and_borders_are_counted() -> None:
    points, faces = sheet()
    whole = measure_surface(points, faces)
    holed = np.delete(faces, [305, 510], axis=0)
    both = np.concatenate([holed, faces + len(points)])
    two = measure_surface(np.concatenate([points, points + 5]), both)
    assert (whole.n_components, whole.n_borders, two.n_components, two.n_borders) == (1, 1, 2, 4)


def test_cells_share_what_is_within_a_boundary() -> None:
    # The apex is near the side on the boundary: beyond that there is nothing.
    corners, density = np.array([[0, 0, 0], [3, 0, 0], [1, 0.4, 0]]), np.array([1.0, 2, 4])
    masses, steps = SurfaceTriangulation(corners, np.array([[0, 1, 2]])).moments(density)
    assert (masses > 0).all()
    assert masses.sum() == pytest.approx(0.6 * 7 / 3)
    whole = 0.6 / 12 * (density[:, None] + density.sum()) * corners  # the moment of a linear density
    assert masses @ (corners + steps) == pytest.approx(whole.sum(axis=0))
