from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cvtimg.segmentation.values import to_levels


@settings(max_examples=60)
@given(
    seed=st.integers(0, 1 << 20),
    n_levels=st.integers(1, 300),
    scale=st.sampled_from([1.0, 1 / 255, 1 / 65535, 2.0]),
    offset=st.sampled_from([0.0, -3.0]),
    dtype=st.sampled_from([np.float32, np.float64]),
)
def test_evenly_spaced_numbers_have_the_levels_of_the_integers_they_stand_for(
    seed: int, n_levels: int, scale: float, offset: float, dtype: Any
) -> None:
    whole = np.random.default_rng(seed).integers(0, n_levels, 50).astype(np.uint16)
    samples = (whole * scale + offset * scale).astype(dtype)
    expected, _ = to_levels(whole)
    levels, spacing = to_levels(samples)
    assert levels.dtype == expected.dtype
    np.testing.assert_array_equal(levels, expected)
    np.testing.assert_allclose(spacing.samples(levels), samples, atol=3e-6 * scale * n_levels)


def test_samples_without_even_spacing_come_back() -> None:
    for samples in (np.array([0.1, np.pi, 7.0]), np.random.default_rng(0).normal(size=1000)):
        levels, spacing = to_levels(samples)
        back = spacing.samples(levels)
        np.testing.assert_allclose(back, samples, atol=2e-6)
        assert samples.min() <= back.min() <= back.max() <= samples.max()


def test_levels_are_the_smallest_whole_numbers() -> None:
    levels, spacing = to_levels(np.uint16([257 * 4, 257 * 10, 257 * 7]))
    assert (levels.tolist(), spacing.offset, spacing.step) == ([0, 2, 1], 1028, 771)
