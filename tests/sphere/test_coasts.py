"""Grids that follow coasts."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from cvtimg import sphere_grid
from cvtimg._shared.types import Floats
from cvtimg.sphere import CoastalGrid, coastal_grid
from cvtimg.sphere.coasts import Coast
from cvtimg.sphere.densities import from_degrees
from cvtimg.sphere.triangulation import unit


def continents() -> Floats:
    """Two continents with bays, a cape, an island that is too small, and land around the south pole."""
    lat, lon = np.mgrid[90:-90:181j, -180:180:361j][:, :-1, :-1] + [[[-0.5]], [[0.5]]]
    land = np.hypot((lon + 60) * np.cos(np.radians(lat)), lat - 10) < 35 + 6 * np.cos(np.radians(4 * lon))
    land |= (np.abs(lon - 90) < 40) & (np.abs(lat - 30) < 20)
    land |= (np.abs(lon - 170) < 1) & (np.abs(lat) < 1)
    land |= lat < -72 + 4 * np.sin(np.radians(3 * lon))
    return land.astype(np.float64)


@pytest.fixture(scope="module")
def grid() -> CoastalGrid:
    return coastal_grid(4000, continents())


def straddling(grid: CoastalGrid) -> int:
    land, sea = grid.on_land[grid.triangles], ~(grid.on_land | grid.on_coast)[grid.triangles]
    return int((land.any(axis=1) & sea.any(axis=1)).sum())


@pytest.mark.slow
def test_no_triangle_has_corners_on_both_sides(grid: CoastalGrid) -> None:
    assert straddling(grid) == 0
    assert grid.on_coast.sum() > 150
    assert not (grid.on_coast & grid.on_land).any()


@pytest.mark.slow
def test_points_on_the_coast_are_where_land_ends(grid: CoastalGrid) -> None:
    # The coast is smoothed by less than a cell; the mask is known to half a pixel.
    size = np.degrees(np.sqrt(grid.areas.mean()))
    mask = continents()
    rows = np.clip((90 - grid.lat).astype(int), 0, 179)
    columns = np.clip((grid.lon + 180).astype(int), 0, 359)
    reach = int(np.ceil(1.5 * size))
    for i in np.flatnonzero(grid.on_coast & (np.abs(grid.lat) < 60)):
        around = mask[max(rows[i] - reach, 0) : rows[i] + reach + 1]
        around = np.take(around, range(columns[i] - 2 * reach, columns[i] + 2 * reach + 1), axis=1, mode="wrap")
        assert around.min() < around.max()


@pytest.mark.slow
def test_every_cell_that_the_coast_crosses_has_its_point_on_it(grid: CoastalGrid) -> None:
    land = continents()
    size = float(np.sqrt(grid.areas.min()))
    # Independent of the corners of cells: the nearest points to all places of coasts, which are drawn alike.
    coast = Coast.of(land, float(np.sqrt(sphere_grid(4000, effort="fast", polish=False).areas.min())))
    places = np.concatenate([unit(coast.starts + part * (coast.ends - coast.starts)) for part in (0, 0.25, 0.5, 0.75)])
    distances, cells = cKDTree(grid.points).query(places)
    assert grid.on_coast[cells].all()
    assert distances.max() < 1.5 * size
    assert np.linalg.norm(coast.nearest(grid.points) - grid.points, axis=1)[grid.on_coast].max() < 1e-6


@pytest.mark.slow
def test_points_are_not_crowded_on_the_coast(grid: CoastalGrid) -> None:
    gaps = cKDTree(grid.points[grid.on_coast]).query(grid.points[grid.on_coast], k=2)[0][:, 1]
    size = np.sqrt(grid.areas.mean())
    assert np.quantile(gaps, 0.05) > 0.75 * size
    assert gaps.min() > 0.6 * size


def test_angles_stay_within_bounds_and_cells_are_even(grid: CoastalGrid) -> None:
    measures = grid.measures()
    assert measures.largest_angle < 105
    assert measures.least_angle > 30
    assert measures.n_obtuse < 0.003 * len(grid.triangles)
    inner = ~grid.on_coast
    assert grid.areas[inner].max() < 3 * grid.areas[inner].mean()


def test_the_nearest_place_of_a_coast_is_on_it() -> None:
    lat = np.linspace(89.5, -89.5, 180)[:, None]
    coast = Coast.of(np.broadcast_to(lat > 30, (180, 360)), 0.05)
    places = from_degrees([0, 100, -179.9], [60, 31, -20])
    nearest = coast.nearest(places)
    assert np.degrees(np.arcsin(nearest[:, 2])) == pytest.approx(30, abs=0.6)
    assert np.arctan2(nearest[:, 1], nearest[:, 0]) == pytest.approx(np.radians([0, 100, -179.9]), abs=0.02)
    assert coast.is_land(places).tolist() == [True, True, False]


def test_of_points_that_would_meet_on_the_coast_the_nearer_one_goes_there() -> None:
    lat = np.linspace(89.5, -89.5, 180)[:, None]
    coast = Coast.of(np.broadcast_to(lat > 0, (180, 360)), 0.05)
    points = from_degrees([0, 0, 90, 90, 180], [2, -1, 3, -3, 5])
    claimed = coast.claimed(points, np.array([True, True, True, True, False]), 0.05)
    assert claimed.tolist()[:2] == [False, True]
    assert claimed[2:4].sum() == 1
    assert not claimed[4]


def test_a_grid_that_mirrors_itself_at_its_coast_is_made() -> None:
    grid = coastal_grid(642, np.broadcast_to(np.arange(60)[:, None] < 30, (60, 120)))
    assert grid.on_coast.any()
    assert straddling(grid) == 0


def test_land_smaller_than_cells_leaves_the_grid_as_it_is() -> None:
    island = np.zeros((60, 120))
    island[30, 60] = 1
    with pytest.warns(UserWarning, match="no coast that cells of this size can follow"):
        grid = coastal_grid(200, island)
    assert (grid.points == sphere_grid(200).points).all()
    assert not (grid.on_coast | grid.on_land).any()
