"""Widths of cells in km: what they mean, how many points they take, and that grids reach them."""

from __future__ import annotations

import numpy as np
import pytest

from cvtimg import sphere_grid
from cvtimg.sphere import CellWidth, SphereGrid, WidthCircle, width_map
from cvtimg.sphere.densities import from_degrees

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
