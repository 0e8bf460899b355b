"""Sums by label."""

import numpy as np
import pytest

from cvtimg._shared.sums import per_mass, sum_by_label


@pytest.mark.parametrize("shape", [(60,), (60, 1), (60, 3)])
def test_sums_by_label_are_those_of_each_label(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    labels, values, weights = rng.integers(5, size=60), rng.random(shape), rng.random(60)
    weighted = weights.reshape(-1, *(1,) * (len(shape) - 1)) * values
    expected = np.stack([weighted[labels == label].sum(axis=0) for label in range(7)])
    np.testing.assert_allclose(sum_by_label(labels, values, 7, weights), expected)
    assert sum_by_label(labels, values).shape == (labels.max() + 1, *shape[1:])


def test_what_has_no_mass_has_the_mean_0() -> None:
    assert per_mass(np.array([[2.0, 4.0], [1.0, 1.0]]), np.array([2.0, 0.0])).tolist() == [[1, 2], [0, 0]]
