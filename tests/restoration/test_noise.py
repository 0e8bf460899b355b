"""Claims about how the noise of versions is measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg.restoration.noise import mean_noise, noise_of_bands
from cvtimg.restoration.versions import stack_versions
from cvtimg.segmentation.noise import lower_variance, scattered_noise


def noisy(clean: NDArray[Any], sigma: float, seed: int) -> NDArray[np.uint8]:
    noise = sigma * np.random.default_rng(seed).standard_normal(clean.shape)
    return np.rint(np.clip(clean + noise, 0, 255)).astype(np.uint8)


@pytest.mark.parametrize("sigmas", [(3, 3), (2, 6), (2, 5, 20)], ids=str)
@pytest.mark.parametrize("holes", [0, 0.3])
def test_several_versions_tell_noise_from_texture(
    photograph: NDArray[Any], sigmas: tuple[float, ...], holes: float
) -> None:
    versions = [noisy(photograph, sigma, seed) for seed, sigma in enumerate(sigmas)]
    known = [np.random.default_rng(seed + 9).random(photograph.shape[:2]) >= holes for seed in range(len(sigmas))]
    stack = stack_versions(versions, known)
    np.testing.assert_allclose(mean_noise(noise_of_bands(stack)), sigmas, rtol=0.4 if sigmas == (2, 6) else 0.15)


@pytest.mark.parametrize("sigma", [0, 1, 3, 12])
def test_one_version_tells_noise_from_texture(photograph: NDArray[Any], sigma: float) -> None:
    version = noisy(photograph, sigma, 0)
    found = mean_noise(noise_of_bands(stack_versions([version])))[0]
    assert abs(found - sigma) < (0.15 * sigma if sigma > 1 else 0.7)
    gray = mean_noise(noise_of_bands(stack_versions([version[:, :, 1]])))[0]
    assert gray < 1.3 * sigma + 1
    if sigma <= 3:  # that of more noise is the larger part
        everywhere = scattered_noise(version.astype(np.float32), np.ones(version.shape[:2], np.bool_))
        assert abs(found - sigma) < abs(np.sqrt(np.mean(everywhere**2)) - sigma)


def test_noise_is_that_before_clipping() -> None:
    ramp = np.broadcast_to(np.linspace(0, 255, 256), (256, 256))
    for versions in ([noisy(ramp, 50, 0)], [noisy(ramp, 50, seed) for seed in range(3)]):
        np.testing.assert_allclose(mean_noise(noise_of_bands(stack_versions(versions))), 50, rtol=0.15)
        assert mean_noise(noise_of_bands(stack_versions([one / 255 for one in versions])))[0] < 0.97 * 50 / 255


def test_copies_of_one_noisy_version_have_its_noise(photograph: NDArray[Any]) -> None:
    one = noisy(photograph, 20, 0)
    np.testing.assert_allclose(
        mean_noise(noise_of_bands(stack_versions([one, one]))), mean_noise(noise_of_bands(stack_versions([one])))[0]
    )


def test_versions_out_of_place_or_of_other_exposure_seem_no_noisier_than_alone(photograph: NDArray[Any]) -> None:
    moved = noisy(np.roll(photograph, (3, 5), (0, 1)), 10, 1)
    darker = noisy(photograph * 0.7, 10, 2)
    for other in (moved, darker):
        stack = stack_versions([noisy(photograph, 10, 0), other])
        assert (mean_noise(noise_of_bands(stack)) <= mean_noise(noise_of_bands(stack, alike=False)) + 1e-6).all()


def test_outliers_and_steps_of_integers_do_not_move_the_lower_half() -> None:
    rng = np.random.default_rng(0)
    for sigma in (3.0, 3.3, 3.6, 9.0):
        differences = np.rint(sigma * rng.standard_normal(100_000)).astype(np.float32)
        assert lower_variance(differences) == pytest.approx(sigma**2, rel=0.15)
    differences[:5000] = 1000
    assert lower_variance(differences) == pytest.approx(81, rel=0.2)
