"""Claims about versions side by side: what is known of each, and its weight."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from damaging import card

from cvtimg import restore
from cvtimg._shared.types import Array
from cvtimg.restoration.noise import Noise
from cvtimg.restoration.result import Levels, mean_colors, median_colors, range_colors
from cvtimg.restoration.versions import fill, fuse, stack_versions, trust_in, usual_noise

RNG = np.random.default_rng(0)


@pytest.mark.slow
def test_a_version_that_knows_too_little_counts_as_the_others_do() -> None:
    clean, _ = card(64)
    versions = [clean + sigma * RNG.standard_normal(clean.shape) for sigma in (0.1, 0.1, 0.1)]
    known = [np.ones((64, 64), bool), np.ones((64, 64), bool), np.zeros((64, 64), bool)]
    known[2][::2, ::2] = True  # no two known pixels touch
    stack = stack_versions(versions, known)
    noise = Noise.of(stack).levels
    assert np.isnan(noise).tolist() == [False, False, True]
    np.testing.assert_allclose(usual_noise(stack, noise), 0.1, rtol=0.15)
    np.testing.assert_allclose(trust_in(stack, None, noise), 1, rtol=0.3)
    np.testing.assert_allclose(restore(versions, 4, masks=known).weights, 1, rtol=0.3)


def test_versions_of_which_nothing_can_be_told_count_the_same() -> None:
    tiny = [np.array([[0.0, 1.0]]), np.array([[0.1, 0.9]])]
    stack = stack_versions(tiny)
    assert np.isnan(Noise.of(stack).levels).all()
    np.testing.assert_array_equal(trust_in(stack, None, Noise.of(stack).levels), 1)


def test_no_version_counts_for_more_than_rounding_to_8_bits_allows() -> None:
    ramp = np.add.outer(np.arange(40.0), np.arange(40.0)) / 78
    stack = stack_versions([ramp, ramp + RNG.normal(0, 2 / 256, ramp.shape)])
    trust = trust_in(stack, None, Noise.of(stack).levels)
    np.testing.assert_allclose(trust[0] / trust[1], 4, rtol=0.3)


def test_masked_arrays_know_what_is_not_masked() -> None:
    image = RNG.integers(0, 256, (12, 9, 3)).astype(np.uint8)
    mask = RNG.random((12, 9)) < 0.3
    masked = np.ma.array(image, mask=np.repeat(mask[..., None], 3, axis=2))
    masked[0, 0, 1] = np.ma.masked
    mask[0, 0] = True
    np.testing.assert_array_equal(stack_versions([masked]).known[..., 0], ~mask)
    np.testing.assert_array_equal(stack_versions([masked]).bands(0), stack_versions([image], [~mask]).bands(0))
    grey = np.ma.array(image[..., 0], mask=mask)
    np.testing.assert_array_equal(stack_versions([grey]).known[..., 0], ~mask)
    with pytest.raises(ValueError, match="no version knows any pixel"):
        stack_versions([np.ma.masked_all((4, 4))])


def test_the_fused_picture_is_the_weighted_mean_of_what_is_known() -> None:
    images = [RNG.random((10, 11)) for _ in range(3)]
    known = [RNG.random((10, 11)) < 0.7 for _ in range(3)]
    trust = np.array([0.5, 1.0, 1.5])
    fused, weight = fuse(stack_versions(images, known), trust)
    loads = np.array(known) * trust[:, None, None]
    np.testing.assert_allclose(weight, loads.sum(axis=0), rtol=1e-6)
    seen = weight > 0
    expected = (loads * np.array(images)).sum(axis=0)[seen] / weight[seen]
    np.testing.assert_allclose(fused[..., 0][seen], expected, rtol=1e-5)


def test_what_is_not_known_is_filled_from_nearby() -> None:
    down, right = np.mgrid[:30, :40].astype(np.float32)
    weight = np.ones((30, 40), np.float32)
    weight[10:18, 12:20] = 0
    filled = fill(((down + right) * weight)[..., None], weight)[..., 0]
    np.testing.assert_allclose(filled, down + right, atol=5)
    np.testing.assert_array_equal(filled[weight > 0], (down + right)[weight > 0])


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
    colors: Array = median_colors(levels([], seen))
    np.testing.assert_array_equal(colors.ravel(), [median, 10])


def test_values_whose_squares_float32_may_not_hold_are_refused() -> None:
    for size, holds in ((0.8e17, True), (1.5e17, False), (1.5e-17, True), (0.8e-17, False)):
        with nullcontext() if holds else pytest.raises(ValueError, match="have a size of 1e-17 to 1e"):
            stack_versions([np.full((4, 4), size)])
