from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference import assert_the_guide_tells
from scipy.stats import qmc

from cvtimg import design
from cvtimg._shared.types import Array
from cvtimg.designs import Design, Factor, point_measures
from cvtimg.designs.descent import EFFORTS, DesignEffort
from cvtimg.designs.groups import split_evenly


def slices_of(design: Design) -> Array:
    """(n, d) slice of each point along each axis, of as many as there are points, old and new."""
    n_slices = len(design.points) + len(design.existing)
    return np.floor(design.unit_points * n_slices).astype(int)


@pytest.mark.parametrize("n_dims", [1, 2, 3, 5])
def test_latin_designs_have_one_point_in_each_slice_of_each_axis(n_dims: int) -> None:
    found = design(20, n_dims, effort="fast")
    assert (np.sort(slices_of(found), axis=0) == np.arange(20)[:, None]).all()
    assert found.latin


@pytest.mark.parametrize("n_dims", [2, 3, pytest.param(4, marks=pytest.mark.slow)])
def test_designs_have_less_energy_than_sequences_and_latin_hypercubes(n_dims: int) -> None:
    plain, latin = (design(40, n_dims, latin=latin, effort="fast").measures().energy for latin in (False, True))
    others = [qmc.Halton(n_dims, rng=0).random(40), qmc.LatinHypercube(n_dims, rng=0).random(40)]
    assert plain < latin < min(point_measures(points).energy for points in others)


@pytest.mark.slow
def test_the_best_effort_reaches_the_known_minimum_of_four_points_and_of_many() -> None:
    four = design(4, 2, latin=False, effort="best")
    assert np.sort(four.points, axis=None) == pytest.approx(np.repeat([0.25, 0.75], 4), abs=1e-4)
    assert four.energy == pytest.approx(1 / 24)
    # Regular hexagons have the least energy; the square takes a few percent.
    assert design(100, 2, latin=False, effort="best").energy <= 1.05 * 5 / (18 * 3**0.5) / 100


def test_points_that_exist_stay_and_keep_new_ones_away() -> None:
    corner = np.random.default_rng(0).random((30, 2)) / 2
    found = design(30, 2, existing=corner, latin=False, effort="fast")
    assert (found.existing == corner).all()
    # Without those that exist a quarter of the points would lie in that corner, 7 or 8.
    assert (found.points < 0.5).all(axis=1).sum() <= 4
    assert found.energy < design(30, 2, latin=False, effort="fast").energy


def test_latin_points_leave_slices_that_existing_points_have() -> None:
    old = [[0.01, 0.99], [0.5, 0.5]]
    found = design(6, 2, existing=old, effort="fast")
    taken = np.floor(np.array(old) * 8).astype(int)
    for axis in range(2):
        slices = slices_of(found)[:, axis]
        assert len(set(slices)) == 6
        assert not set(slices) & set(taken[:, axis])


def test_points_lie_where_they_are_feasible_and_are_dense_where_they_are_asked_to_be() -> None:
    disc = design(50, [[-1, 1], [-1, 1]], feasible=lambda p: (p**2).sum(axis=1) < 1, effort="fast")
    assert ((disc.points**2).sum(axis=1) < 1).all()
    right = design(200, 2, density=lambda p: np.where(p[:, 0] > 0.5, 16.0, 1.0), effort="fast")
    # In two dimensions points are as dense as the square root of the density: four to one.
    assert (right.points[:, 0] > 0.5).mean() == pytest.approx(0.8, abs=0.08)


@pytest.mark.parametrize("n_dims", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_periodic_designs_take_no_account_of_walls(n_dims: int) -> None:
    found = design(30, n_dims, periodic=True, latin=False, effort="fast")
    assert found.measures().energy < design(30, n_dims, latin=False, effort="fast").measures().energy
    shifted = (found.unit_points + 0.37) % 1.0
    assert point_measures(shifted, periodic=True).energy == pytest.approx(found.measures().energy, rel=0.02)


def test_bounds_scale_points_and_nothing_else() -> None:
    unit, scaled = design(10, 2, effort="fast"), design(10, [[-1, 3], [10, 20]], effort="fast")
    assert scaled.points == pytest.approx(unit.points * [4, 10] + [-1, 10])
    assert scaled.energy == unit.energy


def test_designs_are_written_whole_with_a_header(tmp_path: Path) -> None:
    found = design(5, [Factor("speed"), Factor("heat", 2, 3)], effort="fast")
    found.save(tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().splitlines()[0] == "speed,heat"
    assert (np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1) == found.points).all()
    found.save(tmp_path / "a.npy")
    assert (np.load(tmp_path / "a.npy") == found.points).all()
    with pytest.raises(FileExistsError):
        found.save(tmp_path / "a.npy")
    with pytest.raises(ValueError, match=r"b.npy must end in .csv: .npy has no levels"):
        design(5, [Factor("x"), Factor("y", levels=("A", "B"))], effort="fast").save(tmp_path / "b.npy")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_points": 0}, r"n_points=0 must be in 1\.\."),
        ({"bounds": [[0, 0]]}, r"bounds=\[\[0.0, 0.0\]\] must be finite, the first of each axis below the second"),
        ({"bounds": [[-1e308, 1e308], [0, 1]]}, "bounds=.* must be finite"),
        ({"bounds": [0, 1]}, r"bounds of shape \(2,\) must be \(d, 2\)"),
        ({"existing": [[0, 0], [0, 2]]}, r"x2 of existing\[1\]=2.0 must be within its bounds, 0..1"),
        ({"existing": [[0, 0, 0]]}, r"existing of shape \(1, 3\) must be \(L, 2\)"),
        ({"effort": "none"}, "effort='none' must be one of"),
        ({"criterion": "best"}, "criterion='best' must be one of"),
        ({"criterion": "maximin", "latin": False}, "criterion='maximin' must not be given with latin=False"),
        ({"latin": True, "density": lambda p: p[:, 0]}, "density must not be given with latin=True"),
        ({"n_points": 1025, "latin": True, "feasible": np.isfinite}, "n_points=1025 must be at most 1024"),
        ({"bounds": 65}, r"bounds=65 must be in 1\.\.64"),
        ({"periodic": True, "feasible": lambda p: p[:, 0] > 0}, "must not be given with periodic=True"),
        ({"feasible": lambda p: p[:, 0] > 2}, "feasible must hold for more of the box than 0 of its samples"),
        ({"feasible": lambda p: True}, r"feasible returned shape \(\)"),
        ({"density": lambda p: p[:, 0] - 1}, "density must be finite and >= 0"),
        ({"bounds": [Factor("a"), Factor("a")]}, "there must be one axis named a, not 2"),
    ],
)
def test_bad_arguments_are_named(options: dict[str, Any], message: str) -> None:
    given = {"n_points": 5, "bounds": 2, "effort": "fast", **options}
    with pytest.raises(ValueError, match=message):
        design(given.pop("n_points"), given.pop("bounds"), **given)


def test_one_point_is_in_the_middle_at_every_effort() -> None:
    for n_dims, effort in ((1, "fast"), (1, "balanced"), (1, "best"), (3, "fast")):
        assert design(1, n_dims, effort=effort).points.tolist() == [[0.5] * n_dims]  # type: ignore[arg-type]


def test_points_that_exist_may_be_repeated() -> None:
    once, twice = (design(6, 2, existing=[[0.5, 0.5]] * n, latin=False).energy for n in (1, 2))
    assert once == pytest.approx(twice, rel=0.02)


@pytest.mark.parametrize("factor", [1e305, 1e-310])
def test_only_ratios_of_densities_count(factor: float) -> None:
    plain, scaled = (design(8, 2, density=lambda p, by=by: by * (1 + p[:, 0])).points for by in (1.0, factor))
    np.testing.assert_allclose(plain, scaled, atol=1e-6)


def test_small_feasible_regions_are_found() -> None:
    center, half = np.array([0.62, 0.31, 0.77]), 0.01  # 8e-6 of the cube
    found = design(12, 3, feasible=lambda p: (np.abs(p - center) < half).all(axis=1), effort="fast").points
    assert (np.abs(found - center) < half).all()
    corners = np.abs((found - center) / half)
    assert corners.max(axis=0).min() > 0.3  # they fill it


def test_points_of_a_region_are_latin_in_slices_of_equal_shares_as_far_as_they_can_be() -> None:
    def half(points: Array) -> Array:
        return points[:, 0] < 0.5

    found = design(16, 2, feasible=half, effort="fast")
    assert found.latin
    assert (np.sort(np.floor(found.unit_points * [32, 16]), axis=0) == np.arange(16)[:, None]).all()

    def ring(points: Array) -> Array:
        return np.abs(np.hypot(*(points.T - 0.5)) - 0.42) < 0.03

    # Centers of mass are in the hole.
    three = design(3, 2, feasible=ring, effort="fast")
    assert ring(three.points).all()


def test_categories_share_out_points_so_that_each_is_even() -> None:
    axes = [Factor("x"), Factor("y"), Factor("z", levels=("A", "B", "C")), Factor("batch", levels=("1st", "2nd"))]
    found = design(24, axes, effort="fast")
    alone = design(24, 2, effort="fast").unit_points
    assert {tuple(row) for row in found.points[:, :2].tolist()} == {tuple(row) for row in alone.tolist()}
    header, rows = found.table()
    assert header == ["x", "y", "z", "batch"]
    assert sorted((row[3], row[2]) for row in rows) == sorted([(b, z) for b in ("1st", "2nd") for z in "ABC"] * 4)

    def unevenness(labels: Array, points: Array) -> float:
        return float(np.mean([qmc.discrepancy(points[labels == label]) for label in np.unique(labels)]))

    by_chance = np.mean([unevenness(np.random.default_rng(seed).permutation(24) % 3, alone) for seed in range(9)])
    assert unevenness(found.points[:, 2], found.points[:, :2]) < 0.5 * by_chance


def test_groups_that_are_known_stay_and_no_exchange_of_two_points_is_left_that_gains() -> None:
    points = np.random.default_rng(0).random((14, 2))
    labels = split_evenly(points, 2, known=[0, 0, 1])
    assert labels[:3].tolist() == [0, 0, 1]
    assert np.bincount(labels).tolist() == [7, 7]

    def cost(labels: Array) -> float:
        return sum(qmc.discrepancy(points[labels == label]) for label in (0, 1))

    for one in np.flatnonzero(labels[3:] == 0) + 3:
        for other in np.flatnonzero(labels[3:] == 1) + 3:
            changed = labels.copy()
            changed[[one, other]] = [1, 0]
            assert cost(changed) >= cost(labels) - 1e-9


def test_a_logarithmic_factor_is_even_in_its_ratios() -> None:
    factors = [Factor.parse("rate,0.01,100,log"), Factor.parse("heat,20,90")]
    found = design(8, factors, effort="fast")
    exponents = np.sort(np.log10(found.points[:, 0]) / 4 + 0.5)
    np.testing.assert_allclose(exponents, (np.arange(8) + 0.5) / 8, atol=1e-9)
    more = design(8, factors, existing=found.points, effort="fast")
    np.testing.assert_allclose(more.existing, found.points)
    assert (design(5, factors, feasible=lambda x: x[:, 0] < 0.1, effort="fast").points[:, 0] < 0.1).all()


@pytest.mark.parametrize(
    ("text", "levels"),
    [("n,1,2,0.25", "1 1.25 1.5 1.75 2"), ("n,0,1,0.3", "0 0.3 0.6 0.9"), ("n,2,4,integer", "2 3 4")],
)
def test_a_factor_in_steps_has_these_levels(text: str, levels: str) -> None:
    factor = Factor.parse(text)
    assert factor.levels == tuple(levels.split())
    assert factor.places([f"{float(levels.split()[1]):.3f}"]) == factor.places([levels.split()[1]])
    for wrong in ("n,0,1,log", "n,0,1,2", "n,0,1,-1", "n,0,1,odd", "n,0.5,2,integer"):
        with pytest.raises(ValueError, match="must be continuous, log above 0, integer"):
            Factor.parse(wrong)


def test_a_design_of_categories_alone_has_each_level_and_each_pair_equally_often() -> None:
    factors = [Factor("alloy", levels=("A", "B", "C")), Factor("day", levels=("Mon", "Tue"))]
    _, rows = design(12, factors).table()
    assert Counter(map(tuple, rows)) == {(alloy, day): 2 for alloy in "ABC" for day in ("Mon", "Tue")}
    first = design(5, factors)
    _, more = design(7, factors, existing=first.points).table()
    together = Counter(row[0] for row in [*first.table()[1], *more])
    assert max(together.values()) - min(together.values()) <= 1


def test_the_guide_tells_how_much_each_effort_does() -> None:
    def numbers(of: DesignEffort) -> tuple[float, ...]:
        stops = (number for stop in (of.exact, of.sampled) for number in (stop.tolerance, stop.max_iterations))
        return of.samples, of.n_starts, *stops, of.latin_rounds, of.swaps

    assert_the_guide_tells("designs.md", {name: numbers(effort) for name, effort in EFFORTS.items()})
