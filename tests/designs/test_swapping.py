"""Swaps against SciPy's discrepancies."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.distance import pdist
from scipy.stats.qmc import discrepancy

from cvtimg.designs import _designs, design
from cvtimg.designs.latin import latinize
from cvtimg.designs.swaps import CRITERIA, even_out


def test_evened_points_stay_latin_and_apart() -> None:
    rng = np.random.default_rng(0)
    points, existing = latinize(rng.random((60, 3))), rng.random((5, 3))
    moved = even_out(points, existing, False, 10_000_000, rng)
    np.testing.assert_allclose(np.sort(moved, axis=0), np.sort(points, axis=0))
    before, after = (discrepancy(np.concatenate([some, existing])) for some in (points, moved))
    assert after < 0.9 * before
    assert pdist(moved).min() >= min(pdist(points)) - 1e-12
    assert (even_out(points[:1], existing, False, 10_000_000, rng) == points[:1]).all()


def squares(points: NDArray[np.float64], periodic: bool) -> NDArray[np.float64]:
    """Return squared distances of pairs (P, d) along each axis."""
    first, second = np.triu_indices(len(points), 1)
    apart = points[first] - points[second]
    return np.asarray((apart - np.rint(apart) if periodic else apart) ** 2)


def value(points: NDArray[np.float64], criterion: str, periodic: bool = False) -> float:
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
