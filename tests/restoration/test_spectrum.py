"""Claims about noise that neighboring pixels share."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from damaging import psnr
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from cvtimg import denoise, restore
from cvtimg.restoration.fitting import MOST_MISFIT, misfits
from cvtimg.restoration.shared import SharedNoise, shared_noise
from cvtimg.restoration.versions import stack_versions


def blurred_noise(shape: tuple[int, ...], sigma: float, blur: float, seed: int = 0) -> NDArray[np.float64]:
    found = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), (blur, blur, *[0] * (len(shape) - 2)))
    return np.asarray(sigma * found / found.std())


def found_in(*images: NDArray[Any], in_place: bool = True) -> SharedNoise | None:
    return shared_noise(stack_versions(images), in_place=in_place)


def test_level_and_reach_of_noise_are_found_in_the_quiet_part_of_an_image() -> None:
    noise = blurred_noise((192, 192, 3), 10, 0.8) * [0.8, 1.0, 1.2]
    edges = np.where(np.indices((192, 192))[0] // 5 % 2, 60.0, -60.0)
    edges[:, 64:] = np.linspace(0, 60, 128)
    found = found_in(128 + edges[:, :, None] + noise)
    assert found is not None
    np.testing.assert_allclose(np.sqrt(np.diag(found.bands)), [8, 10, 12], rtol=0.25)
    beside = np.diag(found.autocovariance[6, 7]) / np.diag(found.bands)
    np.testing.assert_allclose(beside, np.exp(-1 / (4 * 0.8**2)), atol=0.08)


def test_gray_texture_is_not_taken_for_what_bands_share_of_noise() -> None:
    gray = blurred_noise((192, 192, 1), 10, 0.8)
    found = found_in(128 + blurred_noise((192, 192, 3), 10, 0.8, 1) + 0.5 * gray)
    assert found is not None
    assert found.bands[0, 2] / found.bands[0, 0] == pytest.approx(0, abs=0.25)
    assert found_in(128 + gray + np.zeros(3)) is None  # all in common: it may be texture


def test_versions_in_place_tell_noise_from_texture(photograph: NDArray[Any]) -> None:
    versions = [photograph[:160, :160] + blurred_noise((160, 160, 3), 6, 0.8, seed) for seed in range(2)]
    found = found_in(*versions)
    assert found is not None
    np.testing.assert_allclose(np.sqrt(found.variance), 6, rtol=0.08)


def test_versions_with_shared_noise_fit(photograph: NDArray[Any]) -> None:
    images = [photograph[40:168, 64:192] + blurred_noise((128, 128, 3), 25, 0.8, seed) for seed in range(3)]
    versions = stack_versions(images)
    shared = shared_noise(versions, in_place=True)
    assert misfits(versions, np.full(3, 25.0), shared).max() < 0.5 * misfits(versions, np.full(3, 25.0)).max()
    assert misfits(versions, np.full(3, 25.0), shared).max() < MOST_MISFIT


@pytest.mark.parametrize("sigma", [5, 15, 40])
def test_white_noise_in_a_photograph_is_white(photograph: NDArray[Any], sigma: float) -> None:
    # Texture on all of it, too: as gray as texture is.
    rough = gaussian_filter(np.random.default_rng(1).standard_normal((200, 200, 1)), (0.8, 0.8, 0))
    image = photograph[:200, :200] + 12 * rough + np.random.default_rng(0).normal(0, sigma, (200, 200, 3))
    assert found_in(np.clip(np.rint(image), 0, 255).astype(np.uint8)) is None


def test_images_without_noise_and_small_ones_have_no_shared_noise() -> None:
    assert found_in(np.full((64, 64), 9, np.uint8)) is None
    assert found_in(blurred_noise((12, 40), 5, 1)) is None


def test_half_the_size_shares_what_means_of_four_pixels_share() -> None:
    noise = blurred_noise((400, 400), 1, 0.8)
    half = noise.reshape(200, 2, 200, 2).mean(axis=(1, 3))

    def autocovariance(image: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
        sides = range(-reach, reach + 1)
        near = [[np.mean(image * np.roll(image, (y, x), (0, 1))) for x in sides] for y in sides]
        return np.array(near)[:, :, None, None]

    found = SharedNoise(autocovariance(noise, 6)).halved()
    np.testing.assert_allclose(found.autocovariance[1:-1, 1:-1], autocovariance(half, 2), atol=0.03)
    assert SharedNoise.white(1, 3).halved().variance == pytest.approx(0.25)


def test_noise_that_pixels_do_not_share_is_filtered_as_white(
    photograph: NDArray[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    np.testing.assert_allclose(SharedNoise.white(9, 2).of_patches(5), np.eye(50), atol=1e-12)
    image = photograph[40:88, 64:112] / 255 + np.random.default_rng(0).normal(0, 0.1, (48, 48, 3))
    white = denoise([image], effort="fast", noise=25.5)
    assert white.noise_shared is None
    monkeypatch.setattr("cvtimg.restoration.evidence.shared_noise", lambda *_, **__: SharedNoise.white(1, 3))
    shared = denoise([image], effort="fast", noise=25.5)
    assert shared.noise_shared is not None
    np.testing.assert_allclose(shared.image, white.image, atol=0.002)  # but for rounding


@pytest.mark.slow
def test_shared_noise_is_removed_and_told(photograph: NDArray[Any]) -> None:
    clean = photograph[40:136, 64:192]
    noisy = np.clip(np.rint(clean + blurred_noise(clean.shape, 15, 0.8)), 0, 255).astype(np.uint8)
    found, white = (denoise([noisy], noise_like=like, effort="fast") for like in ("auto", "white"))
    assert found.noise_shared is not None
    assert white.noise_shared is None
    assert found.noise[0] == pytest.approx(15, rel=0.15)
    assert psnr(found.image / 255, clean / 255) > psnr(white.image / 255, clean / 255) + 2


def test_noise_that_is_given_is_taken(photograph: NDArray[Any]) -> None:
    image = photograph[40:104, 64:128] * np.uint16(257)
    assert restore([image, image], 4, noise=3).noise.tolist() == [3 * 257, 3 * 257]
    for wrong in (0, -1, float("nan")):
        with pytest.raises(ValueError, match="noise"):
            restore([image], noise=wrong)
    with pytest.raises(ValueError, match="noise_like"):
        denoise([image], noise_like="pink")  # type: ignore[arg-type]
