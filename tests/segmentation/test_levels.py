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
    expected = to_levels(whole)
    found = to_levels((whole * scale + offset * scale).astype(dtype))
    assert found.levels.dtype == expected.levels.dtype
    np.testing.assert_array_equal(found.levels, expected.levels)
    np.testing.assert_allclose(
        found.offset + found.step * found.levels, whole * scale + offset * scale, atol=3e-6 * scale * n_levels
    )


def test_samples_without_even_spacing_come_back() -> None:
    for samples in (np.array([0.1, np.pi, 7.0]), np.random.default_rng(0).normal(size=1000)):
        found = to_levels(samples)
        np.testing.assert_allclose(found.offset + found.step * found.levels.astype(float), samples, atol=2e-6)


def test_levels_are_the_smallest_whole_numbers() -> None:
    found = to_levels(np.uint16([257 * 4, 257 * 10, 257 * 7]))
    assert (found.levels.tolist(), found.offset, found.step) == ([0, 2, 1], 1028, 771)
