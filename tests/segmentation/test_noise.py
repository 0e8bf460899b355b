from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvtimg._shared.types import Array
from cvtimg.segmentation.noise import noise_covariance
from cvtimg.segmentation.values import Spacing, to_levels


def noise_of(image: Array) -> Array:
    """Standard deviation of the noise of each band."""
    return np.sqrt(np.diag(noise_covariance(image.reshape(*image.shape[:2], -1))))


@pytest.mark.parametrize("sigma", [10, 25, 50])
def test_noise_added_to_a_photograph_is_found(photograph: Array, sigma: float) -> None:
    noisy = photograph + np.random.default_rng(0).normal(0, sigma, photograph.shape)
    np.testing.assert_allclose(noise_of(noisy), sigma, rtol=0.08)


def test_flat_pictures_and_ramps_have_no_noise() -> None:
    ramp = np.add.outer(np.arange(50), 3 * np.arange(70)).astype(np.uint16)
    for image in (np.full((40, 40, 3), 7, np.uint8), ramp, np.eye(2), np.ones((1, 1))):
        np.testing.assert_array_equal(noise_of(image), 0)


def test_texture_in_half_of_the_picture_is_not_noise() -> None:
    rng = np.random.default_rng(1)
    image = rng.normal(100, 3, (160, 160))
    image[:, :80] += 60 * (np.indices((160, 80)).sum(axis=0) % 2)
    np.testing.assert_allclose(noise_of(image), 3, rtol=0.1)


def test_bands_have_noise_of_their_own_and_share_what_is_common() -> None:
    rng = np.random.default_rng(2)
    own, common = rng.normal(0, 1, (256, 256, 3)) * [1, 2, 4], rng.normal(0, 3, (256, 256, 1))
    np.testing.assert_allclose(noise_of(own), [1, 2, 4], rtol=0.1)
    expected = np.diag([1.0, 4, 16]) + 9
    np.testing.assert_allclose(noise_covariance(own + common), expected, rtol=0.15)


def test_what_is_outside_does_not_count() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(0, 2, (96, 96, 1))
    inside = np.indices((96, 96)).sum(axis=0) < 150
    values[~inside] = rng.normal(0, 50, (~inside).sum())[:, None]
    np.testing.assert_allclose(noise_covariance(values, inside), 4, rtol=0.25)
    np.testing.assert_array_equal(noise_covariance(values, np.zeros((96, 96), bool)), 0)


@pytest.mark.parametrize(("side", "n_images"), [(80, 40), (300, 4)])
def test_noise_alone_is_not_underestimated_in_the_quieter_blocks(side: int, n_images: int) -> None:
    images = (np.random.default_rng(seed).normal(0, 5, (side, side)) for seed in range(n_images))
    variances = [noise_covariance(image[..., None])[0, 0] for image in images]
    assert np.sqrt(np.mean(variances)) == pytest.approx(5, rel=0.02)


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
    assert Spacing().samples(levels).tolist() == [0, 2, 1]
