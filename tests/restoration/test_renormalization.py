"""Claims about renormalization, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg.restoration.merging import Levels, mean_colors, median_colors, range_colors
from cvtimg.restoration.versions import stack_versions


def levels(alone: list[tuple[list[float], list[float]]], means: list[float]) -> Levels:
    """Two segments of one band: the levels and masses of each version alone, and the means of both in each version."""
    told: Any = [SimpleNamespace(generators=np.c_[levels], masses=np.c_[masses]) for levels, masses in alone]
    return Levels(
        stack_versions([np.array([[mean, 10.0]]) for mean in means]),
        labels=np.array([[1, 2]], np.int32),
        generators=np.array([[[mean], [10.0]] for mean in means]),
        masses=np.full((len(means), 2, 1), 50.0),
        alone=told.__getitem__,
    )


def test_range_takes_the_median_of_the_levels_that_versions_have_alone() -> None:
    told = levels([([1, 9], [40, 60]), ([2, 9], [40, 60]), ([7, 9], [40, 60])], [4, 4, 4])
    np.testing.assert_array_equal(range_colors(told).ravel(), [2, 9])


def test_range_is_not_told_by_a_segment_that_has_almost_vanished_from_a_version() -> None:
    # In the third version a single pixel of 2000 is left of the first segment: noise, and no level.
    told = levels([([1, 9], [900, 1100]), ([1.2, 9], [900, 1100]), ([8, 9], [1, 1999])], [4, 4, 4])
    np.testing.assert_allclose(range_colors(told).ravel(), [1.1, 9])


def test_range_keeps_the_mean_of_a_segment_that_no_version_tells() -> None:
    told = levels([([8, 9], [1, 1999]), ([7, 9], [0, 2000])], [4, 5])
    np.testing.assert_allclose(range_colors(told).ravel(), [4.5, 9])
    np.testing.assert_allclose(mean_colors(told).ravel(), [4.5, 10])


@pytest.mark.parametrize(("seen", "median"), [([1, 2, 9], 2), ([1, 9], 5)])
def test_median_is_that_of_all_values_of_a_segment(seen: list[float], median: float) -> None:
    colors: NDArray[Any] = median_colors(levels([], seen))
    np.testing.assert_array_equal(colors.ravel(), [median, 10])
