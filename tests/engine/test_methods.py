"""Methods one by one; what they have in common is in test_tessellation.py."""

from typing import Any

import numpy as np
import pytest
import reference
from hypothesis import example, given
from hypothesis import strategies as st

from cvtimg import tessellate
from cvtimg._shared.types import Array, Floats, Ints64
from cvtimg.colors import color_samples
from cvtimg.engine import METHODS, SEEDINGS
from cvtimg.engine.methods import Conditions, Iteration, Method, Probabilistic, Stopping, Watch
from cvtimg.engine.methods.probabilistic import draw, follow_draws
from cvtimg.engine.points import Points, assign, cell_energies, pack

DRAWING = {"macqueen": METHODS["macqueen"], "probabilistic": METHODS["probabilistic"]}
MACQUEEN = {"a1": 1.0, "a2": 0.0, "b1": 0.0, "b2": 1.0}


def conditions(*, tolerance: float = 1e-4, most: int = 1000, seed: int = 0, **others: Any) -> Conditions:
    return Conditions(Stopping(tolerance, most), np.random.default_rng(seed), **others)


def energy(points: Points, generators: Floats) -> float:
    return float(cell_energies(points, generators, assign(points, generators)).sum())


@pytest.fixture(scope="module")
def colors(photograph: Array) -> Points:
    samples = color_samples(photograph)
    return pack(samples.colors, samples.density, in_order=True)


@pytest.fixture(scope="module")
def cloud() -> Points:
    """Return 500 points of 2 dimensions and integer weights, some of them 0."""
    rng = np.random.default_rng(3)
    return pack(
        rng.normal(size=(500, 2)) + 4 * rng.normal(size=(6, 2))[rng.integers(0, 6, 500)], rng.integers(0, 4, 500)
    )


# Methods that draw


def family_by_hand(points: Points, generators: Floats, drawn: Ints64, draws: int, a: Any, b: Any) -> Floats:
    """Move by move, generator by generator, as the paper writes it."""
    rows, z, j = points.rows(), generators.copy(), np.ones(len(generators))
    for start in range(0, len(drawn), draws):
        group = rows[drawn[start : start + draws]]
        nearest = reference.squared_distances(group, z).argmin(axis=1)
        for k in set(nearest):
            u = group[nearest == k].mean(axis=0)
            z[k] = ((a[0] * j[k] + b[0]) * z[k] + (a[1] * j[k] + b[1]) * u) / (j[k] + 1)
            j[k] += 1
    return z


def after_one_step(method: Method, points: Points, generators: Floats, **others: Any) -> Iteration:
    return method(points, generators, conditions(tolerance=0, most=1, **others))


@pytest.mark.parametrize("draws", [1, 7, 100, 700])
@pytest.mark.parametrize(("a", "b"), [((1, 0), (0, 1)), ((0.5, 0.5), (0.25, 0.75)), ((0, 1), (0, 1))])
def test_a_step_follows_the_formula_of_the_paper(draws: int, a: Any, b: Any, cloud: Points) -> None:
    start = cloud.rows()[:6]
    method = Probabilistic(draws, *a, *b)
    drawn = draw(cloud, -(-500 // draws) * draws, np.random.default_rng(0))
    expected = family_by_hand(cloud, start, drawn, draws, a, b)
    result = after_one_step(method, cloud, start)
    assert energy(cloud, expected) < energy(cloud, start)
    np.testing.assert_allclose(result.generators, expected, rtol=1e-9)


def test_macqueen_is_the_member_of_the_family_that_draws_one_point(cloud: Points) -> None:
    start = cloud.rows()[:6]
    for seed in range(5):
        one = after_one_step(METHODS["macqueen"], cloud, start, seed=seed)
        other = after_one_step(Probabilistic(draws=1, **MACQUEEN), cloud, start, seed=seed)
        np.testing.assert_allclose(one.generators, other.generators, rtol=1e-9)
        assert one.energies == pytest.approx(other.energies, rel=1e-9)
        assert one.energies[1] < one.energies[0]


def test_generators_that_are_put_elsewhere_count_their_moves_anew(cloud: Points) -> None:
    counted = []

    def move(moving: Floats, counts: Floats, drawn: Ints64) -> None:
        counted.append(counts.tolist())
        counts += 5
        moving[0] = 1e3  # where no point is near

    follow_draws(cloud, cloud.rows()[:6], conditions(tolerance=0, most=2), 1, move)
    assert counted[0] == [1] * 6
    assert counted[1][0] == 1
    assert sorted(counted[1]) == [1, 1, 6, 6, 6, 6]  # its cell is half of another one's


def test_points_are_drawn_by_density_and_in_any_order(cloud: Points) -> None:
    drawn = draw(cloud, 200_000, np.random.default_rng(0))
    share = cloud.density[:500] / cloud.density.sum()
    counts = np.bincount(drawn, minlength=500)
    assert len(counts) == 500
    assert (counts[share == 0] == 0).all()
    np.testing.assert_allclose(counts, 200_000 * share, atol=6 * np.sqrt(200_000 * share.max()))
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWING)
@pytest.mark.parametrize(
    ("n_generators", "init"), [(8, "split"), (32, "k-means++"), pytest.param(128, "split", marks=pytest.mark.slow)]
)
def test_drawing_ends_within_three_percent_of_lloyd_from_the_same_start(
    name: str, n_generators: int, init: str, colors: Points
) -> None:
    start = SEEDINGS[init](colors, n_generators, np.random.default_rng(0))
    by_lloyd = METHODS["lloyd"](colors, start, conditions())
    result = DRAWING[name](colors, start, conditions())
    assert result.converged
    assert energy(colors, result.generators) == pytest.approx(result.energies[-1], rel=1e-6)
    assert result.energies[-1] < 1.03 * by_lloyd.energies[-1]
    # Nearly half of what separates the start from Lloyd's end was noise to begin with: most of it must be gone.
    assert result.energies[-1] - by_lloyd.energies[-1] < 0.3 * (result.energies[0] - by_lloyd.energies[-1])


@pytest.mark.parametrize("name", DRAWING)
def test_the_best_so_far_is_reported_and_returned(name: str, cloud: Points) -> None:
    mean = np.average(cloud.rows(), axis=0, weights=cloud.density[:500])[None]
    for start in (cloud.rows()[:7], mean):
        result = DRAWING[name](cloud, start, conditions(tolerance=0, most=50))
        assert (np.diff(result.energies) <= 0).all()
        assert energy(cloud, result.generators) == pytest.approx(result.energies[-1], rel=1e-6)
    np.testing.assert_array_equal(result.generators, mean)


@pytest.mark.parametrize("name", DRAWING)
def test_locked_generators_and_the_start_stay_as_they_were(name: str, cloud: Points) -> None:
    start = cloud.rows()[:7]
    copy = start.copy()
    result = DRAWING[name](cloud, start, conditions(n_locked=3))
    np.testing.assert_array_equal(start, copy)
    np.testing.assert_array_equal(result.generators[:3], start[:3])
    assert (result.generators[3:] != start[3:]).all()


@pytest.mark.parametrize("name", DRAWING)
def test_a_generator_that_meets_no_point_is_put_where_it_does(name: str, cloud: Points) -> None:
    start = np.vstack([cloud.rows()[:5], [[1e4, 1e4]]])
    end = DRAWING[name](cloud, start, conditions()).generators
    assert set(assign(cloud, end)) == set(range(6))


@pytest.mark.parametrize("name", DRAWING)
def test_drawing_ends_after_four_steps_that_lower_the_energy_by_next_to_nothing(name: str, cloud: Points) -> None:
    result = DRAWING[name](cloud, cloud.rows()[:7], conditions(tolerance=1e-2))
    lowered = -np.diff(result.energies) / result.energies[:-1]
    assert result.converged
    assert len(lowered) > 4
    assert (lowered[-4:] <= 1e-2).all()
    assert all((lowered[start : start + 4] > 1e-2).any() for start in range(len(lowered) - 4))


def test_tessellate_takes_a_member_of_the_family(cloud: Points) -> None:
    result = tessellate(cloud.rows(), 5, method=Probabilistic(draws=50, a1=0.9, a2=0.1))
    assert result.energy < 1.05 * tessellate(cloud.rows(), 5).energy


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"draws": 0}, "draws=0 must be an integer >= 1, or None"),
        ({"draws": 2.0}, r"draws=2\.0 must be an integer"),
        ({"a1": 1}, r"a1=1\.0 and a2=0\.25 must be >= 0, with sum 1"),
        ({"b1": -1, "b2": 2}, r"b1=-1\.0 and b2=2\.0 must be >= 0, with sum 1"),
        ({"a1": np.nan, "a2": 1}, r"a1=nan and a2=1\.0 must be"),
    ],
)
def test_wrong_parameters_of_the_family_are_named(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        Probabilistic(**parameters)


# The optimum in one dimension


def optimum(values: Any, n_generators: int, density: Any = None) -> tuple[Floats, float]:
    """Return the generators in the units of the values, and the energy."""
    rows = np.asarray(values).reshape(-1, 1)
    rows = rows if rows.dtype in (np.uint8, np.uint16) else rows.astype(float)
    points = pack(rows, np.ones(len(rows)) if density is None else np.asarray(density, float))
    result = METHODS["optimal1d"](points, np.zeros((n_generators, 1)), conditions())
    assert result.converged
    assert len(result.energies) == 1
    return points.frame.outward(result.generators)[:, 0], points.frame.energy(result.energies[0])


@example([(0, 1), (0, 5), (23, 2), (24, 1)], 2)
@given(st.lists(st.tuples(st.integers(0, 40), st.integers(0, 5)), min_size=1, max_size=60), st.integers(1, 60))
def test_optimal1d_agrees_with_dynamic_programming_on_any_weights(pairs: list[tuple[int, int]], n_cells: int) -> None:
    values, weights = np.array(pairs).T
    repeated = np.sort(np.repeat(values, weights)).astype(float)
    if not 1 <= n_cells <= len(np.unique(repeated)):
        return
    sums = np.array([np.append(0, np.cumsum(repeated**power)) for power in range(3)])
    masses, firsts, squares = sums[:, None, :] - sums[:, :, None]
    cells = np.where(masses > 0, squares - firsts**2 / np.maximum(masses, 1), np.where(masses == 0, 0, np.inf))
    lowest = cells[0]  # of the first n samples, with one cell more in each round
    for _ in range(n_cells - 1):
        lowest = (lowest[:, None] + cells).min(axis=0)
    rounding = 1e-9 + 1e-7 * cells[0, -1]  # coordinates are float32: errors are relative to the energy of one cell
    assert optimum(values, n_cells, weights)[1] == pytest.approx(lowest[-1], rel=1e-6, abs=rounding)
    assert optimum(repeated, n_cells)[1] == pytest.approx(lowest[-1], rel=1e-6, abs=rounding)


@pytest.mark.parametrize("n_cells", [1, 2, 3, 31, 32, 33, 63, 64])
def test_equal_steps_which_no_price_tells_apart_are_cut_evenly(n_cells: int) -> None:
    sizes = np.full(n_cells, 64 // n_cells) + (np.arange(n_cells) < 64 % n_cells)
    _, found = optimum(np.arange(64, dtype=np.uint8), n_cells)
    assert found == pytest.approx((sizes * (sizes**2 - 1) / 12).sum())


@pytest.mark.parametrize(("n_levels", "n_cells"), [(5000, 50), (100_000, 4096), (1000, 999)])
def test_optimal_generators_are_the_means_of_their_cells(n_levels: int, n_cells: int) -> None:
    # Thousands of generators are nearer to each other than float32 tells apart.
    values = np.random.default_rng(2).normal(size=(n_levels, 1)).astype(np.float32)
    density = np.random.default_rng(3).random(n_levels)
    points = pack(values, density)
    result = METHODS["optimal1d"](points, np.zeros((n_cells, 1)), conditions())
    generators, labels = result.generators[:, 0], result.labels
    assert labels is not None
    assert (np.diff(generators) > 0).all()
    masses, sums = (np.bincount(labels, points.density * y) for y in (1.0, points.tiles.ravel().astype(float)))
    np.testing.assert_allclose(sums / masses, generators, atol=1e-12)
    distances = np.abs(points.rows() - generators[np.clip(labels[:n_levels, None] + [-1, 0, 1], 0, n_cells - 1)])
    assert (distances[:, 1] == distances.min(axis=1)).all()


def test_a_callback_sees_the_optimum() -> None:
    seen = []
    points = pack(np.arange(9.0)[:, None], np.ones(9))
    METHODS["optimal1d"](points, np.zeros((3, 1)), conditions(watch=Watch(lambda *step: seen.append(step))))
    assert seen == [(0, 6.0)]
