"""Placement in pictures."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from cvtimg import place_generators
from cvtimg._shared.types import Array
from cvtimg.placement import PixelMoments
from cvtimg.placement.pictures import draw_along_curve, enlarge

Y, X = np.mgrid[:90, :120]
WAVES = (1 + np.sin(X / 9) * np.cos(Y / 13)) * (X > 20)
RING = (np.abs(np.hypot(X - 29.5, Y - 29.5) - 22) < 4)[:60, :60]


@pytest.mark.parametrize(
    ("density", "n"),
    [
        *((WAVES, n) for n in (1, 2, 17, 400, 1500, 10800)),
        *((RING, n) for n in (1, 2, 5, 60)),  # whose centers of mass are in its gap
        *((np.ones(shape), 5) for shape in ((1, 1), (1, 50), (50, 1), (2, 3))),
    ],
)
def test_no_generator_is_where_nothing_is_and_no_cell_without_mass(density: Array, n: int) -> None:
    placement = place_generators(None, n, density=density, effort="fast")
    assert placement.points.shape == (n, 2)
    x, y = placement.points.astype(int).T
    assert (density[y, x] > 0).all()
    assert (placement.masses > 0).all()
    assert placement.masses.sum() == pytest.approx(density.sum(), rel=0.05 if density is RING else 0.02)


def test_energy_is_that_of_the_points() -> None:
    placement = place_generators(None, 300, density=WAVES)
    assert placement.energy == pytest.approx(PixelMoments(WAVES)(placement.points).energy, rel=1e-12)


def test_a_constant_density_comes_near_to_hexagons() -> None:
    placement = place_generators(None, 400, density=np.ones((200, 200)), effort="best")
    hexagons = 5 / (18 * 3**0.5) * 200**4 / 400  # energy of as many regular hexagons of the same area
    assert hexagons < placement.energy < 1.03 * hexagons


def test_fixed_generators_come_first_and_stay() -> None:
    fixed = np.array([[30.5, 10.5], [100, 80]])
    placement = place_generators(None, 1200, density=WAVES, fixed=fixed)
    assert (placement.points[:2] == fixed).all()
    assert len(placement.points) == 1200


def test_generators_are_in_about_the_order_of_a_curve() -> None:
    points = place_generators(None, 4000, density=WAVES).points
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    gaps = cKDTree(points).query(points, 2)[0][:, 1]
    assert steps.mean() < 2.5 * gaps.mean()


def test_a_start_has_equal_parts_along_the_curve() -> None:
    rng = np.random.default_rng(0)
    places = draw_along_curve(np.ones((64, 64), np.float32), 1024, rng)
    counts = np.histogram2d(places[:, 1], places[:, 0], 8, [[0, 64]] * 2)[0]
    assert (counts == 16).all()


@pytest.mark.parametrize("factor", [2, 4])
def test_enlarging_keeps_mass_and_white(factor: int) -> None:
    density = np.zeros((6, 5), np.float32)
    density[1:4, 1:4] = 3
    large = enlarge(density, factor)
    assert large.shape == (6 * factor, 5 * factor)
    assert (large.reshape(6, factor, 5, factor).max(axis=(1, 3))[density == 0] == 0).all()
    flat = enlarge(np.full((3, 4), 2, np.float32), factor)
    np.testing.assert_allclose(flat, 2 / factor**2)
    assert flat.sum() == pytest.approx(24)
