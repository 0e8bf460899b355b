import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist
from scipy.stats.qmc import discrepancy

from cvtimg import latinize, point_measures
from cvtimg._shared.types import Array, Floats
from cvtimg.designs import _designs, design, star_discrepancy
from cvtimg.designs.cells import Cube, exact_cells, sobol_samples
from cvtimg.designs.latin import CRITERIA, even_out

RNG = np.random.default_rng(4)


def discrepancy_by_all_boxes(points: Array) -> float:
    """Look at every box that coordinates of points, and 1, are corners of."""
    worst = 0.0
    for corner in itertools.product(*(np.append(axis, 1.0) for axis in points.T)):
        volume = np.prod(corner)
        closed, within = (points <= corner).all(axis=1).mean(), (points < corner).all(axis=1).mean()
        worst = max(worst, closed - volume, volume - within)
    return worst


@pytest.mark.parametrize("n_dims", [1, 2, 3])
@settings(max_examples=40)
@given(seed=st.integers(0, 1000), n_points=st.integers(1, 7), steps=st.sampled_from([3, 10, 0]))
def test_the_discrepancy_is_that_of_the_worst_box(n_dims: int, seed: int, n_points: int, steps: int) -> None:
    points = np.random.default_rng(seed).random((n_points, n_dims))
    points = np.rint(points * steps) / steps if steps else points  # equal coordinates, and walls
    value, exact = star_discrepancy(points)
    assert exact
    assert value == pytest.approx(discrepancy_by_all_boxes(points))


@pytest.mark.slow
def test_in_many_dimensions_the_discrepancy_is_a_lower_bound_and_says_so() -> None:
    for n_points, least in ((7, 1.0), (10, 0.9)):
        points = RNG.random((n_points, 4))
        value, exact = star_discrepancy(points)
        assert not exact
        truth = discrepancy_by_all_boxes(points)
        assert (least - 1e-9) * truth <= value <= truth + 1e-12
    found = point_measures(points)
    assert (found.exact_cells, found.exact_discrepancy) == (False, False)


@pytest.mark.slow
@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("n_dims", [1, 2, 3])
def test_exact_cells_agree_with_many_samples(n_dims: int, periodic: bool) -> None:
    points = RNG.random((30, n_dims))
    cells = exact_cells(points, periodic)
    samples = np.random.default_rng(0).random((300_000, n_dims))
    distances, labels = cKDTree(points, boxsize=1.0 if periodic else None).query(samples)
    assert cells.volumes.sum() == pytest.approx(1)
    assert cells.volumes == pytest.approx(np.bincount(labels, minlength=30) / len(samples), abs=4e-3)
    assert cells.energy == pytest.approx((distances**2).mean(), rel=0.02)
    assert distances.max() <= cells.reaches.max() <= distances.max() * 1.1
    apart = samples - points[labels]
    apart = apart - np.rint(apart) if periodic else apart
    for axis in range(n_dims):
        firsts = np.bincount(labels, apart[:, axis], 30) / len(samples)
        assert cells.firsts[:, axis] == pytest.approx(firsts, abs=2e-3)


def test_clusters_far_from_walls_have_all_their_images() -> None:
    points = 0.4 + RNG.random((40, 2)) / 100
    assert exact_cells(points, periodic=False).volumes.sum() == pytest.approx(1)
    assert exact_cells(points, periodic=True).volumes.sum() == pytest.approx(1)


@pytest.mark.parametrize("periodic", [False, True])
def test_samples_find_the_nearest_points_and_exact_moments(periodic: bool) -> None:
    points, samples = RNG.random((25, 3)), RNG.random((2000, 3)).astype(np.float32)
    expected = cKDTree(points, boxsize=1.0 if periodic else None).query(samples)[1]
    assert (Cube(samples, periodic=periodic).labels(points) == expected).mean() > 0.999
    sampled = Cube(sobol_samples(1 << 16, 3, 0), periodic=periodic).cells(points)
    exact = exact_cells(points, periodic)
    assert sampled.energy == pytest.approx(exact.energy, rel=0.01)
    assert sampled.volumes == pytest.approx(exact.volumes, abs=2e-3)


def test_measures_of_four_points_are_those_by_hand() -> None:
    found = point_measures([[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.75, 0.75]])
    assert found.h == pytest.approx(0.125**0.5)
    assert found.chi == pytest.approx(2**0.5)
    assert found.tau == pytest.approx(0, abs=1e-15)
    assert found.d == pytest.approx(0, abs=1e-15)
    assert found.energy == pytest.approx(1 / 24)
    assert found.discrepancy == pytest.approx(discrepancy_by_all_boxes(np.array([[1, 1], [1, 3], [3, 1], [3, 3]]) / 4))
    assert (found.exact_cells, found.exact_discrepancy) == (True, True)


@given(seed=st.integers(0, 100), n_points=st.integers(1, 30))
def test_latinizing_keeps_the_order_along_each_axis_and_fills_each_slice(seed: int, n_points: int) -> None:
    points = np.random.default_rng(seed).random((n_points, 3))
    moved = latinize(points)
    assert (np.argsort(moved, axis=0) == np.argsort(points, axis=0)).all()
    assert (np.sort(np.floor(moved * n_points), axis=0) == np.arange(n_points)[:, None]).all()
    assert (latinize(moved) == moved).all()


def test_points_outside_of_the_cube_equal_ones_and_single_ones_are_refused() -> None:
    for measure in (point_measures, latinize, star_discrepancy):
        with pytest.raises(ValueError, match=r"points in 0\.5\.\.1\.5 must be in 0\.\.1"):
            measure([[0.5, 1.5], [0.5, 0.5]])
    with pytest.raises(ValueError, match=r"points must differ from each other: .*\[0.5, 0.5\]"):
        point_measures([[0.5, 0.5], [0.1, 0.2], [0.5, 0.5]])
    with pytest.raises(ValueError, match="must be at least two"):
        point_measures([[0.5, 0.5]])


def test_evened_points_stay_latin_and_apart() -> None:
    rng = np.random.default_rng(0)
    points, existing = latinize(rng.random((60, 3))), rng.random((5, 3))
    moved = even_out(points, existing, False, 10_000_000, rng)
    np.testing.assert_allclose(np.sort(moved, axis=0), np.sort(points, axis=0))
    before, after = (discrepancy(np.concatenate([some, existing])) for some in (points, moved))
    assert after < 0.9 * before
    assert pdist(moved).min() >= min(pdist(points)) - 1e-12
    assert (even_out(points[:1], existing, False, 10_000_000, rng) == points[:1]).all()


def squares(points: Floats, periodic: bool) -> Floats:
    """Return squared distances of pairs (P, d) along each axis."""
    first, second = np.triu_indices(len(points), 1)
    apart = points[first] - points[second]
    return np.asarray((apart - np.rint(apart) if periodic else apart) ** 2)


def value(points: Floats, criterion: str, periodic: bool = False) -> float:
    """Compute a criterion by its definition."""
    if criterion == "discrepancy":
        return len(points) ** 2 * float(discrepancy(points, method="WD" if periodic else "CD"))
    pairs = squares(points, periodic)
    return float((pairs.sum(axis=1) ** -8.0 if criterion == "maximin" else 1 / pairs.prod(axis=1)).sum())


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("criterion", list(CRITERIA))
def test_changes_are_those_of_the_criterion(criterion: str, periodic: bool) -> None:
    rng = np.random.default_rng(1)
    points = latinize(rng.random((9, 3))) + (rng.random((9, 3)) - 0.5) / 9
    for _ in range(20):
        axis, (first, second) = rng.integers(3), rng.choice(9, 2, replace=False)
        order = np.ascontiguousarray(np.argsort(points, axis=0).T, np.int32)
        swapped, change = points.copy(), np.empty(1)
        pair = order[axis, [first, second]]
        swapped[pair, axis] = points[pair[::-1], axis]
        places, tries = points - 0.5, np.array([[axis, first, second]], np.int32)
        _designs.swap_coordinates(places, 9, order, tries, np.inf, change, CRITERIA[criterion], 1.0, 0.0, periodic)
        np.testing.assert_allclose(places + 0.5, swapped, atol=1e-12)
        expected = value(swapped, criterion, periodic) - value(points, criterion, periodic)
        assert change[0] == pytest.approx(expected, rel=1e-6, abs=1e-9)
        points = swapped


@pytest.mark.parametrize("existing", [pytest.param(0, marks=pytest.mark.slow), 6])
@pytest.mark.parametrize(
    "criterion", [name if name == "maximin" else pytest.param(name, marks=pytest.mark.slow) for name in CRITERIA]
)
def test_designs_for_a_criterion_are_latin_and_better_by_it_than_others(criterion: str, existing: int) -> None:
    old = np.random.default_rng(3).random((existing, 3))
    of = {name: design(20, 3, criterion=name, existing=old, effort="fast").unit_points for name in ("cvt", *CRITERIA)}
    for name, points in of.items():
        slices = np.floor(np.concatenate([points, old]) * (20 + existing))
        assert all(len(np.unique(axis[:20])) == 20 for axis in slices.T)
        if existing == 0:
            np.testing.assert_allclose(np.sort(points, axis=0), np.tile((np.arange(20)[:, None] + 0.5) / 20, 3))
        if name != criterion:
            ours, theirs = (value(np.concatenate([some, old]), criterion) for some in (of[criterion], points))
            assert ours < theirs
    again = design(20, 3, criterion=criterion, existing=old, effort="fast").unit_points
    assert (again == of[criterion]).all()
