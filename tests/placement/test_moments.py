"""Moments of cells against plain NumPy and SciPy."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference import shoelace
from scipy.spatial import cKDTree

from cvtimg._shared.types import Array
from cvtimg.engine.methods import Stopping
from cvtimg.placement import DESCENTS, PixelMoments, Terms, pixel_labels
from cvtimg.placement.cells import picture_cells


def squared_distances(places: Array, points: Array) -> Array:
    return ((places[:, None] - points) ** 2).sum(axis=2)


def exact_row(density: Array, points: Array, y: float) -> Array:
    """Sum mass, x and y over the cells of one row, cut at every bisector: the plain way."""
    lifted = (points[:, 0] ** 2) + (points[:, 1] - y) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        cuts = (lifted[:, None] - lifted) / (2 * (points[:, None, 0] - points[:, 0]))
    ends = np.concatenate([np.arange(len(density) + 1.0), cuts[np.isfinite(cuts)]])
    ends = np.unique(ends[(ends >= 0) & (ends <= len(density))])
    sums = np.zeros((len(points), 3))
    for start, stop in pairwise(ends):
        middle = np.array([[(start + stop) / 2, y]])
        own = squared_distances(middle, points)[0].argmin()
        mass = density[int(middle[0, 0])] * (stop - start)
        sums[own] += mass, mass * middle[0, 0], mass * y
    return sums


@given(st.tuples(st.integers(1, 12), st.integers(1, 12)), st.integers(1, 15), st.integers(0, 2**32 - 1))
def test_moments_are_those_of_cells_cut_at_every_bisector(shape: tuple[int, int], n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    density = rng.random(shape).astype(np.float32) * (rng.random(shape) < 0.7) + np.float32(1e-3)
    points = (rng.random((n, 2)) * 1.4 - 0.2) * shape[::-1]
    moments = PixelMoments(density)(points)
    sums = sum(exact_row(row.astype(np.float64), points, y + 0.5) for y, row in enumerate(density))
    np.testing.assert_allclose(moments.masses, sums[:, 0], atol=1e-9)
    np.testing.assert_allclose(moments.masses[:, None] * moments.centroids, sums[:, 1:], atol=1e-8)


@pytest.mark.parametrize("n", [1, 40, 3000, 30000])
@pytest.mark.parametrize("crowded", [False, True])
def test_labels_are_those_of_a_tree(n: int, crowded: bool) -> None:
    rng = np.random.default_rng(n)
    height, width = 150, 220
    points = rng.random((n, 2)) * [width, height]
    points[: n // 2] = points[: n // 2] * 0.03 + [70, 20] if crowded else points[: n // 2]
    y, x = np.mgrid[:height, :width] + 0.5
    centers = np.stack([x.ravel(), y.ravel()], axis=1)
    nearest = cKDTree(points).query(centers)[0]
    labels = pixel_labels((height, width), points).ravel()
    found = np.sqrt(((centers - points[labels]) ** 2).sum(axis=1))
    np.testing.assert_allclose(found, nearest, atol=1e-9)


def test_energy_is_that_of_a_fine_sum() -> None:
    rng = np.random.default_rng(0)
    density, points = rng.random((20, 30)).astype(np.float32), rng.random((25, 2)) * [30, 20]
    fine = 64
    y, x = np.meshgrid(np.arange(20) + 0.5, (np.arange(30 * fine) + 0.5) / fine, indexing="ij")
    distances = squared_distances(np.stack([x.ravel(), y.ravel()], axis=1), points).min(axis=1)
    weights = np.repeat(density, fine, axis=1).ravel().astype(np.float64) / fine
    # In y the pass counts middle lines of rows, and adds what a pixel spreads about its own.
    assert PixelMoments(density)(points).energy == pytest.approx(weights @ distances + weights.sum() / 12, rel=1e-4)


def test_cells_without_mass_keep_their_generator() -> None:
    density = np.zeros((8, 8), np.float32)
    density[:, :4] = 1
    moments = PixelMoments(density)([[2, 4], [7, 4], [7, 4.5]])
    assert moments.masses.tolist() == [32, 0, 0]
    assert moments.centroids.tolist() == [[2, 4], [7, 4], [7, 4.5]]


def test_generators_at_one_place_share_nothing() -> None:
    moments = PixelMoments(np.ones((30, 30)))(np.full((500, 2), 12.5))
    assert sorted(moments.masses)[-1] == 900
    assert np.count_nonzero(moments.masses) == 1


def test_hundreds_of_generators_in_one_pixel() -> None:
    points = 15.2 + np.random.default_rng(0).random((600, 2)) * 1e-3
    moments = PixelMoments(np.ones((40, 40)))(points)
    assert moments.masses.sum() == pytest.approx(1600)
    assert np.count_nonzero(moments.masses) > 10


@pytest.mark.parametrize("n_points", [1, 2, 3, 40, 500])
def test_cells_fill_the_picture_and_agree_with_labels(n_points: int) -> None:
    rng = np.random.default_rng(n_points)
    height, width, fine = 30, 50, 16
    points = rng.random((n_points, 2)) * [width, height]
    cells = picture_cells(points, (height, width))
    areas = np.array(list(map(shoelace, cells)))
    assert areas.sum() == pytest.approx(height * width)
    labels = pixel_labels((height * fine, width * fine), points * fine)
    counted = np.bincount(labels.ravel(), minlength=n_points) / fine**2
    assert np.abs(areas - counted).max() < 0.35


def test_points_on_the_sides_in_rows_and_in_one_place_have_cells_that_fill_the_picture() -> None:
    for points in (
        [[0, 0], [10, 0], [5, 5], [5, 5], [3, 10]],
        [[x + 0.5, y + 0.5] for x in range(10) for y in range(10)],
    ):
        cells = picture_cells(np.array(points, np.float64), (10, 10))
        assert sum(map(shoelace, cells)) == pytest.approx(100)
        assert all(cell.min() >= 0 and cell.max() <= 10 for cell in cells if len(cell))


LONG = Stopping(tolerance=0, max_iterations=200)


@pytest.fixture(scope="module")
def moments() -> PixelMoments:
    y, x = np.mgrid[:60, :80]
    return PixelMoments(np.exp(-((x - 30) ** 2 + (y - 20) ** 2) / 600) + 0.02)


def start(n: int) -> Array:
    return np.random.default_rng(0).random((n, 2)) * [80, 60]


@pytest.mark.parametrize("method", DESCENTS)
def test_generators_end_at_centers_of_mass_and_energy_never_rises(method: str, moments: PixelMoments) -> None:
    end = DESCENTS[method](moments, start(12), Terms(Stopping(0, 1000)))
    assert end.converged
    assert (np.diff(end.energies) < 0).all()
    np.testing.assert_allclose(end.generators, end.moments.centroids, atol=1e-3)


def test_l_bfgs_ends_lower_than_lloyd_after_as_many_moves(moments: PixelMoments) -> None:
    ends = {name: DESCENTS[name](moments, start(200), Terms(Stopping(0, 40))).energies[-1] for name in DESCENTS}
    assert ends["l-bfgs"] < ends["over-relaxed"] < ends["lloyd"]


@pytest.mark.parametrize("method", DESCENTS)
def test_fixed_generators_stay_and_the_others_do_not_mind(method: str, moments: PixelMoments) -> None:
    free = np.arange(40) >= 7
    end = DESCENTS[method](moments, start(40), Terms(LONG, free=free))
    assert (end.generators[:7] == start(40)[:7]).all()
    np.testing.assert_allclose(end.generators[7:], end.moments.centroids[7:], atol=0.05)


@pytest.mark.parametrize("method", DESCENTS)
def test_a_projection_holds_after_every_move(method: str, moments: PixelMoments) -> None:
    def onto_a_line(there: Array, before: Array) -> Array:
        return np.where(np.arange(len(there))[:, None] < 10, there * [1, 0] + [0, 30], there)

    first = onto_a_line(start(40), start(40))
    end = DESCENTS[method](moments, first, Terms(Stopping(0, 50), project=onto_a_line))
    assert (end.generators[:10, 1] == 30).all()
    assert end.energies[-1] < end.energies[0]
