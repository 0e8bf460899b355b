"""Grids of the sphere by their properties."""

from typing import Any

import numpy as np
import pytest
from reference import sets_of, uniform_cell_moments
from scipy.spatial import ConvexHull

from cvtimg import sphere_grid
from cvtimg._shared.types import Floats
from cvtimg.halfedges import measure_triangles
from cvtimg.sphere import CellWidth, Refinement, SphereGrid, WidthCircle, measure_grid, triangulate, width_map
from cvtimg.sphere.densities import fibonacci, from_degrees
from cvtimg.sphere.starts import Lattice, drawn, nearest_twelve
from cvtimg.sphere.triangulation import SphereTriangulation, unit

Points = Floats


def assert_is_a_grid(grid: SphereGrid, n: int) -> None:
    assert grid.points.shape == (n, 3)
    assert np.einsum("ij,ij->i", grid.points, grid.points) == pytest.approx(1, abs=1e-14)
    assert grid.triangles.shape == (2 * n - 4, 3)
    hull, own = sets_of(ConvexHull(grid.points).simplices), sets_of(grid.triangles)
    # Where four points are on one circle, which triangles they have is open.
    assert len(hull ^ own) <= 0.01 * len(own)


@pytest.mark.parametrize("n", [12, 42, 72, 92, 362, 642, 1272, pytest.param(11_172, marks=pytest.mark.slow)])
def test_grids_of_twelve_pentagons_and_no_heptagon_rest_at_centers_of_mass(n: int) -> None:
    grid = sphere_grid(n)
    measures = grid.measures()
    centers = unit(uniform_cell_moments(SphereTriangulation(grid.points)))
    assert np.linalg.norm(centers - grid.points, axis=1).max() < 1e-4 * np.sqrt(4 * np.pi / n)
    assert (measures.n_pentagons, measures.n_hexagons) == (12, n - 12)
    assert measures.least_angle > 50
    assert measures.largest_angle < 80


def test_a_lattice_is_moved_as_a_coarser_one_is() -> None:
    lattice, coarse = Lattice(4, 3), Lattice(3, 0)
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    moved = lattice.points(coarse, coarse.points() @ turn)
    assert moved == pytest.approx(lattice.points(coarse, coarse.points()) @ turn, abs=1e-12)
    assert np.linalg.norm(moved - lattice.points() @ turn, axis=1).max() < 0.05
    assert [nearest_twelve(n) for n in (1, 12, 20, 60, 1000)] == [12, 12, 12, 72, 1002]


@pytest.mark.parametrize("n", [4, 5, 12, 13, 42, 99, 642, 1000])
def test_grids_of_any_number_of_points_are_regular(n: int) -> None:
    grid = sphere_grid(n)
    assert_is_a_grid(grid, n)
    measures = grid.measures()
    if n >= 12:
        assert measures.n_obtuse == 0
        assert measures.least_angle > 40
        assert grid.areas.max() < 2 * grid.areas.min()


def test_the_energy_is_the_mean_squared_distance_times_the_area() -> None:
    grid, places = sphere_grid(100, density=lambda x: 1 + x[:, 2] ** 2), fibonacci(100_000)
    squares = 2 - 2 * (places @ grid.points.T).max(axis=1)
    assert grid.energy == pytest.approx(4 * np.pi * (squares * (1 + places[:, 2] ** 2)).mean(), rel=0.02)
    uniform = sphere_grid(100)
    squares = 2 - 2 * (places @ uniform.points.T).max(axis=1)
    assert uniform.energy == pytest.approx(4 * np.pi * squares.mean(), rel=1e-4)


def test_cells_are_smaller_by_the_ratio_of_a_refinement() -> None:
    refinement = Refinement(-100, 40, radius=25, ratio=4)
    grid = sphere_grid(2562, density=refinement)
    assert_is_a_grid(grid, 2562)
    distance = np.degrees(np.arccos(grid.points @ from_degrees(-100, 40)[0]))
    sizes = np.sqrt(grid.areas)
    assert np.median(sizes[distance > 60]) / np.median(sizes[distance < 12]) == pytest.approx(4, rel=0.08)
    assert grid.measures().n_obtuse == 0


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_points_gather_where_a_picture_is_bright(dtype: Any) -> None:
    picture = np.ones((30, 60), dtype)
    picture[:15] = 16  # the northern half, where cells get half the size
    grid = sphere_grid(700, density=picture, effort="fast")
    north = grid.points[:, 2] > 0
    assert 0.65 < north.mean() < 0.85  # 0.8 but for the belt where sizes grow


@pytest.mark.slow
def test_a_picture_that_is_black_somewhere_gives_a_grid_without_obtuse_triangles() -> None:
    picture = np.zeros((64, 128))
    picture[20:30, 30:60] = 1
    grid = sphere_grid(3000, density=picture)
    assert_is_a_grid(grid, 3000)
    inside = (grid.lat < 32) & (grid.lat > 7) & (grid.lon > -94) & (grid.lon < -13)
    assert inside.mean() > 0.4
    assert grid.measures().n_obtuse == 0


def test_the_callback_sees_falling_energies_and_stops() -> None:
    energies: list[float] = []

    def callback(step: int, energy: float) -> bool:
        assert step == len(energies)
        energies.append(energy)
        return step == 4

    sphere_grid(500, density=lambda x: 2 + x[:, 2], callback=callback)
    assert len(energies) == 5
    assert energies[-1] < energies[0]


def test_draws_follow_the_root_of_the_density() -> None:
    points = drawn(lambda x: np.where(x[:, 2] > 0, 9.0, 1.0), 4000, np.random.default_rng(0))
    assert len(np.unique(points, axis=0)) == 4000
    assert (points[:, 2] > 0).mean() == pytest.approx(0.75, abs=0.01)


@pytest.mark.parametrize("factor", [1e-300, 1e300])
def test_a_density_of_any_size_makes_the_same_grid(factor: float) -> None:
    grids = [sphere_grid(300, density=lambda p, f=f: f * (1 + p[:, 2] ** 2), effort="fast") for f in (1.0, factor)]
    assert np.allclose(grids[0].points, grids[1].points, atol=1e-4)
    assert grids[1].offset < 0.1
    assert grids[1].density == pytest.approx(factor * grids[0].density, rel=1e-3)
    assert grids[1].energy == pytest.approx(factor * grids[0].energy)


def test_a_density_of_0_on_a_part_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="the density is 0 on 50% of the sphere"):
        sphere_grid(300, density=lambda p: (p[:, 2] > 0).astype(float), effort="fast")


def test_measures_agree_with_their_definitions() -> None:
    points = unit(np.random.default_rng(2).normal(size=(40, 3)))
    triangles = triangulate(points)
    measures = measure_grid(points, triangles)
    each = measure_triangles(points, triangles)
    assert (measures.least_angle, measures.largest_angle) == (each.angles.min(), each.angles.max())
    assert measures.n_obtuse == (each.angles > 90).sum()
    assert (measures.least_quality, measures.mean_quality) == (each.qualities.min(), each.qualities.mean())
    neighbors = [set(triangles[(triangles == i).any(axis=1)].ravel()) - {i} for i in range(40)]
    gaps = [[np.linalg.norm(points[i] - points[j]) for j in near] for i, near in enumerate(neighbors)]
    assert measures.uniformity == pytest.approx(min(min(gap) / max(gap) for gap in gaps))
    assert measures.shortest_edge == pytest.approx(2 * np.arcsin(min(map(min, gaps)) / 2))
    assert measures.longest_edge == pytest.approx(2 * np.arcsin(max(map(max, gaps)) / 2))
    sizes = [len(near) for near in neighbors]
    assert [sizes.count(5), sizes.count(6), sizes.count(7)] == [
        measures.n_pentagons, measures.n_hexagons, measures.n_heptagons,
    ]  # fmt: skip


#: Widths in km: 700 in the north and 1400 in the south, with a jump at the equator.
HALVES = np.where(np.arange(90)[:, None] < 45, 700.0, 1400.0) * np.ones((1, 180))


@pytest.mark.parametrize(
    "width",
    [
        CellWidth(900),
        CellWidth(1500, [WidthCircle(10, 50, 3000, 600)]),
        CellWidth(lambda lon, lat: 1200 - 6 * np.abs(lat) + 0 * lon),
        CellWidth(HALVES),
    ],
    ids=["even", "circle", "function", "map"],
)
def test_grids_reach_widths_within_2_percent_in_the_median_and_10_at_the_ninth_decile(width: CellWidth) -> None:
    grid = sphere_grid(density=width)
    ratios = grid.widths() / width.at(grid.points)
    assert len(grid.points) == width.n_points
    assert abs(np.median(ratios) - 1) < 0.02
    assert np.quantile(np.abs(ratios - 1), 0.9) < 0.1


def test_n_scales_all_widths_alike() -> None:
    width = CellWidth(2000, [WidthCircle(10, 50, 3000, 900)])
    grid = sphere_grid(2 * width.n_points, density=width, effort="fast")
    assert np.median(grid.widths() / width.at(grid.points)) == pytest.approx(0.5**0.5, rel=0.02)


def test_the_width_of_a_cell_is_the_mean_distance_to_its_neighbors() -> None:
    grid: SphereGrid = sphere_grid(42)
    for cell in (0, 17):
        around = np.unique(grid.triangles[(grid.triangles == cell).any(axis=1)])
        around = around[around != cell]
        distances = np.arccos(grid.points[around] @ grid.points[cell])
        assert grid.widths(radius=2.0)[cell] == pytest.approx(2 * distances.mean())


def test_a_circle_has_its_width_as_far_as_its_radius_and_none_beyond_its_transition() -> None:
    width = CellWidth(60, [WidthCircle(0, 0, 1000, 15, transition=500)])
    degrees = np.degrees(np.array([0, 999, 1250, 1501]) / 6371.229)
    np.testing.assert_allclose(width.at(from_degrees(degrees, 0 * degrees)), [15, 15, 37.5, 60])


def test_cells_widen_by_at_most_15_percent_through_a_cell_where_nothing_else_is_said() -> None:
    lon = np.linspace(0, 90, 2001)
    step = np.radians(lon[1]) * 6371.229
    for width in (CellWidth(240, [WidthCircle(0, 0, 500, 30)]), CellWidth(HALVES)):
        there = from_degrees(lon, 0 * lon) if width.circles else from_degrees(0 * lon, lon - 45)
        assert np.abs(np.diff(width.at(there))).max() < 0.151 * step


@pytest.mark.parametrize("flip", [1, -1])
@pytest.mark.parametrize("west", [-180, 0])
def test_maps_of_any_longitudes_and_latitudes_are_maps_of_the_globe(west: int, flip: int) -> None:
    lon, lat = np.arange(west, west + 360, 5.0), np.arange(-90, 90.1, 5)[::flip]
    found = width_map(lon, lat, 100 + lat[:, None] + 10 * np.cos(np.radians(lon)))
    rows, columns = 87.5 - 5 * np.arange(36.0), 5 * np.arange(72.0) - 177.5
    np.testing.assert_allclose(found, 100 + rows[:, None] + 10 * np.cos(np.radians(columns)), atol=0.02)
