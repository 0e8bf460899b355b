"""Nested grids: what is outside stays, bit for bit."""

import numpy as np
import pytest
from reference import sets_of
from scipy.spatial import ConvexHull

from cvtimg import sphere_grid
from cvtimg._shared.types import Indices
from cvtimg.sphere import Box, Cap, SphereGrid, nested_grid
from cvtimg.sphere.parts import PartLike, inside_of

PARENT = sphere_grid(2562)
#: Parts with corners, which are no caps.
BOX = Box(-46, -6, 46, 40)
POLYGON = {"type": "Polygon", "coordinates": [[[60, 0], [120, -10], [110, 45], [70, 30], [60, 0]]]}


def triangles_of(grid: SphereGrid, numbers: Indices) -> set[tuple[int, ...]]:
    """Triangles of which all corners have a number >= 0, by these numbers."""
    triangles = numbers[grid.triangles]
    return sets_of(triangles[(triangles >= 0).all(axis=1)])


@pytest.mark.parametrize(
    ("within", "factor"),
    [
        pytest.param(Cap(10, 50, 25), 4.0, marks=pytest.mark.slow),
        (Cap(-120, -85, 40), 1.0),
        (Cap(100, -20, 30), 0.5),
        (BOX, 1.0),
        pytest.param(BOX, 0.3, marks=pytest.mark.slow),
        pytest.param(POLYGON, 2.0, marks=pytest.mark.slow),
    ],
)
def test_every_point_and_triangle_outside_is_kept(within: PartLike, factor: float) -> None:
    inside = inside_of("within", within, PARENT.points)
    n_kept, n = int((~inside).sum()), int(factor * inside.sum())
    grid = nested_grid(PARENT, n, within=within)
    assert len(grid.points) == n_kept + n
    assert (grid.points[:n_kept] == PARENT.points[~inside]).all()
    assert grid.fixed.sum() == n_kept
    before = np.where(inside, -1, np.cumsum(~inside) - 1)
    after = np.where(grid.fixed, np.arange(len(grid.points)), -1)
    assert triangles_of(PARENT, before) <= triangles_of(grid, after)
    assert sets_of(ConvexHull(grid.points).simplices) == sets_of(grid.triangles)
    # Corners of the part, and cells that must grow fast, leave a few.
    measures, is_easy = grid.measures(), isinstance(within, Cap) and factor >= 1
    assert measures.n_obtuse <= (0 if is_easy else 0.01 * len(grid.triangles))
    assert measures.least_angle > 35 or not isinstance(within, Cap)


@pytest.mark.slow
def test_sizes_change_little_from_cell_to_cell() -> None:
    grid = nested_grid(PARENT, 1500, within=Cap(10, 50, 30), rng=1)
    sizes = np.sqrt(grid.areas)
    edges = np.concatenate([grid.triangles[:, [0, 1]], grid.triangles[:, [1, 2]]])
    assert np.abs(np.log(sizes[edges[:, 0]] / sizes[edges[:, 1]])).max() < 0.4
    depths = Cap(10, 50, 30).depth(grid.points)
    assert np.median(sizes[depths > 0.3]) < 0.6 * np.median(sizes[grid.fixed])


@pytest.mark.slow
def test_many_new_points_have_room() -> None:
    grid = nested_grid(PARENT, 3000, within=Cap(10, 50, 25))
    sizes = np.sqrt(grid.areas[~grid.fixed])
    assert np.median(sizes) < 2.5 * sizes.min()


@pytest.mark.slow
def test_a_density_says_where_new_points_gather() -> None:
    within = Cap(0, 0, 40)
    grid = nested_grid(PARENT, 900, within=within, density=lambda x: 1 + 15 * (x[:, 1] > 0))
    new = grid.points[~grid.fixed]
    assert (new[:, 1] > 0).mean() == pytest.approx(0.8, abs=0.05)


def test_points_of_any_grid_may_be_the_parent() -> None:
    grid = nested_grid(PARENT.points, 50, within=Cap(0, 0, 10), effort="fast")
    assert (grid.points[grid.fixed] == PARENT.points[~Cap(0, 0, 10)(PARENT.points)]).all()
