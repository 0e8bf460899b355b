"""Placement in regions of every kind."""

from functools import partial
from typing import Any

import numpy as np
import pytest
import shapely
from scipy.optimize import approx_fprime

from cvtimg import place_generators
from cvtimg.placement import (
    Box,
    ConstantDensity,
    ImplicitRegion,
    PolygonMoments,
    PolygonRegion,
    SampleMoments,
    as_density,
    measure_cells,
    voronoi_cells,
)
from cvtimg.placement.moments import norms

SQUARE = Box([0, 0], [1, 1])
CUBE = Box([0, 0, 0], [1, 1, 1])
FRAME = PolygonRegion([[[0, 0], [4, 0], [4, 4], [0, 4]], [[1, 1], [3, 1], [3, 3], [1, 3]]])
POINTS = np.random.default_rng(0).random((60, 2)) * 4


def exact_polygon(cell: Any, generator: Any) -> tuple[float, Any, float]:
    """Area, center of mass and energy of one polygon, by its triangles: a second way."""
    area, first, energy = 0.0, np.zeros(2), 0.0
    for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(cell)):
        corners = shapely.get_coordinates(triangle)[:3]
        middles = (corners + np.roll(corners, 1, axis=0)) / 2
        area += triangle.area
        first += triangle.area * corners.mean(axis=0)
        energy += triangle.area * ((middles - generator) ** 2).sum(axis=1).mean()  # exact for squares
    return area, first / area, energy


@pytest.mark.parametrize("region", [FRAME, Box([0, 0], [4, 4])], ids=str)
def test_moments_of_polygons_are_exact(region: Any) -> None:
    points = region.draw(60)
    moments = PolygonMoments(region, ConstantDensity(3.0))(points)
    expected = [exact_polygon(*each) for each in zip(voronoi_cells(points, region), points, strict=True)]
    np.testing.assert_allclose(moments.masses, [3 * area for area, _, _ in expected], atol=1e-12)
    np.testing.assert_allclose(moments.centroids, [center for _, center, _ in expected], atol=1e-9)
    assert moments.energy == pytest.approx(3 * sum(energy for _, _, energy in expected), rel=1e-12)


def test_quadrature_is_exact_for_cubic_densities() -> None:
    constant = PolygonMoments(FRAME, ConstantDensity())(POINTS)
    as_function = PolygonMoments(FRAME, as_density(lambda p: np.ones(len(p))))(POINTS)
    np.testing.assert_allclose(as_function.masses, constant.masses, rtol=1e-12)
    np.testing.assert_allclose(as_function.centroids, constant.centroids, atol=1e-12)
    assert as_function.energy == pytest.approx(constant.energy, rel=1e-12)
    cubic = PolygonMoments(Box([0, 0], [1, 1]), as_density(lambda p: p[:, 0] ** 3))(POINTS / 4)
    assert cubic.masses.sum() == pytest.approx(1 / 4, rel=1e-12)
    assert (cubic.masses * cubic.centroids[:, 0]).sum() == pytest.approx(1 / 5, rel=1e-12)


@pytest.mark.parametrize("periodic", [True, [True, False], [False, True]])
def test_periodic_cells_fill_the_box_and_agree_with_wrapped_samples(periodic: Any) -> None:
    box = Box([0, 0], [2, 1], periodic)
    points = np.random.default_rng(1).random((20, 2)) * [2, 1]
    polygons = PolygonMoments(box, ConstantDensity())(points)
    samples = SampleMoments(box.sample(200_000), region=box)(points)
    assert polygons.masses.sum() == pytest.approx(2)
    np.testing.assert_allclose(samples.masses, polygons.masses, atol=0.01)
    np.testing.assert_allclose(samples.centroids, polygons.centroids, atol=0.01)


@pytest.mark.parametrize(
    "region",
    [
        *(SQUARE, FRAME, Box([0, 0], [1, 1], periodic=True), CUBE, Box(0, 1), np.ones((30, 40), bool)),
        ImplicitRegion(lambda p: np.hypot(*p.T) - 1, [-1, -1], [1, 1]),
    ],
    ids=str,
)
def test_generators_end_at_their_centroids_and_energy_never_rises(region: Any) -> None:
    placement = place_generators(region, 20)
    size = (placement.region.measure / 20) ** (1 / placement.points.shape[1])
    np.testing.assert_allclose(placement.points, placement.centroids, atol=0.02 * size)
    assert (np.diff(placement.energies) < 0).all()
    assert placement.masses.sum() == pytest.approx(placement.region.measure, rel=1e-9)


@pytest.mark.parametrize(
    ("region", "density", "n", "middle"),
    [
        (SQUARE, lambda p: np.where(p[:, 0] < 0.5, 1.0, 16.0), 100, 0.5),
        (None, np.repeat([[1, 16]], 100, axis=0).repeat(100, axis=1), 1000, 100),
    ],
    ids=["function", "image"],
)
def test_there_are_about_as_many_generators_as_the_root_of_the_density(
    region: Any, density: Any, n: int, middle: float
) -> None:
    placement = place_generators(region, n, density=density)
    assert (placement.points[:, 0] > middle).mean() == pytest.approx(0.8, abs=0.025)


@pytest.mark.parametrize("region", [SQUARE, FRAME, np.ones((40, 40), bool)], ids=["square", "frame", "pixels"])
def test_boundary_points_are_found_and_hold_the_corners(region: Any) -> None:
    placement = place_generators(region, 60, on_boundary="auto", effort="fast")
    where = placement.region
    off = np.linalg.norm(where.to_boundary(placement.points) - placement.points, axis=1)
    assert 10 < (off < 1e-9).sum() < 60
    for corner in where.corners:
        assert np.linalg.norm(placement.points - corner, axis=1).min() < 1e-9


def test_given_boundary_points_and_fixed_ones_stay() -> None:
    given = [[0, 0], [4, 4], [2, 1]]
    placement = place_generators(FRAME, 40, on_boundary=given, fixed=[[0.5, 0.5]])
    assert placement.points[:4].tolist() == [[0.5, 0.5], *given]
    with pytest.raises(ValueError, match=r"on_boundary=\[0\.5, 0\.5\] must be on the boundary, which is 0\.5 away"):
        place_generators(FRAME, 40, on_boundary=[[0.5, 0.5]])


@pytest.mark.parametrize("metric", [1, *(pytest.param(p, marks=pytest.mark.slow) for p in (20, np.inf))])
def test_other_metrics_end_lower_than_means_do(metric: float) -> None:
    placement = place_generators(SQUARE, 20, metric=metric, effort="fast")
    moments = SampleMoments(SQUARE.sample(10_000, rng=5), metric)
    euclidean = place_generators(SQUARE, 20, effort="fast")
    assert moments(placement.points).energy < moments(euclidean.points).energy


@pytest.mark.parametrize("p", [1, 2, 3.5, 20, np.inf])
def test_slopes_are_those_of_norms_of_any_size(p: float) -> None:
    steps = np.random.default_rng(0).standard_normal((40, 2))
    slopes = norms(1e-60 * steps, p)[1]
    for step, slope in zip(steps, slopes, strict=True):
        np.testing.assert_allclose(slope, approx_fprime(step, partial(np.linalg.norm, ord=p), 1e-7), atol=1e-5)


def test_cells_are_polygons_that_fill_the_region() -> None:
    placement = place_generators(FRAME, 40)
    cells = placement.cells()
    assert sum(cell.area for cell in cells) == pytest.approx(12)
    assert {cell.label for cell in cells} == set(range(1, 41))
    for cell in cells:
        assert shapely.Polygon(cell.rings[0]).distance(shapely.Point(placement.points[cell.label - 1])) < 0.3


def test_measures_of_a_square_grid_are_known() -> None:
    grid = np.stack(np.meshgrid(np.arange(5) + 0.5, np.arange(5) + 0.5), axis=-1).reshape(-1, 2)
    exact = measure_cells(grid, Box([0, 0], [5, 5]))
    assert (exact.h, exact.chi) == pytest.approx((0.5**0.5, 2**0.5))
    assert (exact.h_ratio, exact.gap_ratio, exact.area_ratio) == pytest.approx((1, 1, 1))
    assert (exact.tau, exact.d, exact.gap_variation) == pytest.approx((0, 0, 0), abs=1e-12)


def test_measures_of_a_cubic_grid_are_known_by_samples() -> None:
    axis = np.arange(4) + 0.5
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    for periodic in (False, True):
        found = measure_cells(grid, Box([0] * 3, [4] * 3, periodic=periodic))
        assert found.h == pytest.approx(3**0.5 / 2, rel=0.05)
        assert found.h <= 3**0.5 / 2
        assert found.chi == pytest.approx(3**0.5, rel=0.05)
        assert (found.gap_ratio, found.area_ratio) == pytest.approx((1, 1), rel=0.03)
        assert (found.tau, found.d) == pytest.approx((0, 0), abs=0.01)


def test_cells_with_corners_apart_by_rounding_are_integrated_and_gaps_go_around_a_periodic_box() -> None:
    points = np.array([[0.1, 0.5], [0.9, 0.5], [0.5, 0.0]])
    moments = PolygonMoments(Box([0, 0], [1, 1], periodic=True), as_density(lambda p: np.ones(len(p))))
    assert moments(points).masses == pytest.approx([0.29, 0.29, 0.42])
    apart = measure_cells(points, Box([0, 0], [1, 1])).gap_ratio
    around = measure_cells(points, Box([0, 0], [1, 1], periodic=True)).gap_ratio
    assert apart == pytest.approx(1)
    assert around == pytest.approx(0.41**0.5 / 0.2)


@pytest.mark.parametrize("region", [Box([0] * 3, [1] * 3), np.ones((3, 3, 3), bool)])
def test_cells_beyond_the_plane_are_refused_by_name(region: Any) -> None:
    placement = place_generators(region, 3, effort="fast")
    with pytest.raises(ValueError, match="must be in the plane: cells are polygons there"):
        placement.cells()
    corners = np.stack(np.meshgrid(*[[0, 3 if isinstance(region, np.ndarray) else 1]] * 3), -1).reshape(-1, 3)
    from_corners = np.linalg.norm(corners[:, None] - placement.points, axis=2).min(axis=1).max()
    assert placement.measures().h == pytest.approx(from_corners, rel=0.05)


@pytest.mark.parametrize("n", [1, 3, 9])
def test_generators_stay_out_of_holes_and_bays(n: int) -> None:
    bay = PolygonRegion([[0, 0], [4, 0], [4, 4], [3.8, 4], [3.8, 0.2], [0.2, 0.2], [0.2, 4], [0, 4]])
    placement = place_generators(bay, n)
    assert (np.linalg.norm(bay.project(placement.points) - placement.points, axis=1) < 1e-9).all()


@pytest.mark.parametrize("method", ["lloyd", "over-relaxed", "l-bfgs"])
def test_a_density_that_is_0_in_most_of_a_region_leaves_no_cell_empty(method: str) -> None:
    box = Box([0, 0], [1, 1])
    for seed in range(2):
        placement = place_generators(
            box, 30, density=lambda p: (p[:, 0] > 0.9) * 1.0, method=method, effort="fast", rng=seed
        )
        assert placement.masses.min() > 1e-4
        assert placement.masses.sum() == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize("value", [1e300, 1e-300])
def test_densities_that_single_precision_does_not_hold_are_refused_over_pixels(value: float) -> None:
    with pytest.raises(ValueError, match=r"the largest density=1e.300 must be in 1e-30\.\.1e\+30"):
        place_generators(np.ones((20, 40), bool), 10, density=lambda p: np.full(len(p), value))
    energy = place_generators(Box([0, 0], [1, 1]), 4, density=lambda p: np.full(len(p), value), effort="fast").energy
    assert 0 < energy < np.inf
