"""Claims about noise that grows with the level."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from damaging import psnr
from numpy.typing import NDArray

from cvtimg import denoise
from cvtimg.restoration.anscombe import Bend
from cvtimg.restoration.noise import bend_of
from cvtimg.restoration.versions import stack_versions


def grainy(clean: NDArray[Any], constant: float, slope: float, seed: int = 0) -> NDArray[np.uint8]:
    """Poisson and Gaussian noise, as a camera of 8 bits has."""
    rng = np.random.default_rng(seed)
    light = slope * rng.poisson(clean / slope) if slope else clean
    return np.clip(np.rint(light + np.sqrt(constant) * rng.standard_normal(clean.shape)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("constant", "slope"), [(25, 2), (9, 0.5), (25, 1e-4), (500, -1.8)])
def test_bent_noise_is_even_and_its_mean_gives_the_level_back(constant: float, slope: float) -> None:
    bend = Bend(np.array([constant]), np.array([slope]), 0, 255)
    levels = np.array([20, 60, 120, 200, 240])
    rng = np.random.default_rng(0)
    noise = np.sqrt(constant + slope * levels) * rng.standard_normal((40000, 5))
    bent = bend.bent((levels + noise)[..., None].astype(np.float32))
    np.testing.assert_allclose(bent.std(axis=0) / bent[:, 2].std(), 1, rtol=0.06)
    np.testing.assert_allclose(bend.straight(bent.mean(axis=0)).ravel(), levels, atol=0.6)
    ends = bend.bent(np.array([[0], [255]], np.float32))
    np.testing.assert_allclose(ends.ravel(), [0, 255], atol=0.1)


def test_constant_and_slope_are_found_in_quiet_parts() -> None:
    clean = np.tile(np.linspace(20, 220, 256)[:, None], (160, 1, 3)) * [1, 0.8, 0.6]
    clean[80:] = np.where(np.indices((80, 256))[0][..., None] // 4 % 2, clean[80:], 120)
    bend = bend_of(stack_versions([grainy(clean, 16, 1.5)]), in_place=True)
    assert bend is not None
    np.testing.assert_allclose(np.sqrt(bend.variance(np.array([60.0])) / 106), 1, rtol=0.15)
    np.testing.assert_allclose(np.sqrt(bend.variance(np.array([120.0])) / 196), 1, rtol=0.15)


def test_versions_in_place_tell_it_from_texture(photograph: NDArray[Any]) -> None:
    rough = photograph[:160, :160] * np.where(np.indices((160, 160)).sum(axis=0) % 3, 1, 0.7)[..., None]
    images = [grainy(rough, 4, 0.5, seed) for seed in range(2)]
    bend = bend_of(stack_versions(images), in_place=True)
    assert bend is not None
    ratio = bend.variance(np.array([200.0])) / bend.variance(np.array([50.0]))
    np.testing.assert_allclose(ratio, 104 / 29, rtol=0.25)


@pytest.mark.parametrize("sigma", [0, 5, 40])
def test_even_noise_in_a_photograph_is_even(photograph: NDArray[Any], sigma: float) -> None:
    assert bend_of(stack_versions([grainy(photograph[:192, :192], sigma**2, 0)]), in_place=True) is None


@pytest.mark.slow
def test_noise_of_light_is_removed_and_told(photograph: NDArray[Any]) -> None:
    clean = photograph[:192]
    noisy = grainy(clean, 16, 2)
    found, white = (denoise([noisy], effort="fast", noise_like=kind) for kind in ("auto", "white"))
    assert white.noise_lines is None
    assert found.noise_lines is not None
    np.testing.assert_allclose(found.noise_lines @ [1, 120], 16 + 2 * 120, rtol=0.3)
    assert found.noise[0] == pytest.approx(np.std(noisy - clean.astype(float)), rel=0.1)
    assert psnr(found.image / 255, clean / 255) > psnr(white.image / 255, clean / 255) + 0.5
    dark, bright = clean < 40, clean > 200
    assert abs((found.image - clean.astype(float))[dark].mean()) < 2.5
    assert abs((found.image - clean.astype(float))[bright].mean()) < 2.5
    given = denoise([noisy], effort="fast", noise=12)
    assert given.noise[0] == pytest.approx(12)
