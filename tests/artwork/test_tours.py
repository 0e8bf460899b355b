from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cvtimg.artwork import find_tour


def tour_length(points: np.ndarray, order: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points[order], axis=0), axis=1).sum())


@given(st.integers(1, 60), st.integers(0, 5), st.integers(1, 1000))
def test_a_tour_visits_each_point_once_wherever_they_are(n_points: int, seed: int, n_places: int) -> None:
    points = np.random.default_rng(seed).integers(0, n_places, (n_points, 2)).astype(np.float64)
    assert sorted(find_tour(points)) == list(range(n_points))


def test_a_tour_of_many_points_is_within_a_tenth_of_the_shortest() -> None:
    n_points = 5000
    points = np.random.default_rng(0).random((n_points, 2))
    # The shortest tour is near 0.7124 sqrt(N A) (1 + 0.33 / N), D. S. Johnson and L. A. McGeoch 1996.
    assert tour_length(points, find_tour(points)) < 1.1 * 0.7124 * np.sqrt(n_points)


def test_a_tour_does_not_cross_itself() -> None:
    points = np.random.default_rng(4).random((1500, 2)) ** [1, 3]
    points[:40] *= 20  # long steps
    path = points[find_tour(points)]
    steps = np.diff(path, axis=0)
    away = path[np.newaxis] - path[:-1, np.newaxis]
    side = np.sign(steps[:, :1] * away[..., 1] - steps[:, 1:] * away[..., 0])  # of each point to each step
    apart = side[:, :-1] * side[:, 1:] < 0
    assert not (apart & apart.T).any()


def test_the_tour_is_the_same_in_any_unit_and_starts_at_the_corner() -> None:
    points = np.random.default_rng(1).random((300, 2))
    order = find_tour(points)
    assert np.array_equal(order, find_tour(1024 * points))
    assert np.hypot(*points[order[0]]) <= np.hypot(*points[order[-1]])
