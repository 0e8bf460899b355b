"""Claims about pictures without noise, and about what is hard to measure: nothing fails, and nothing is harmed."""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np
import pytest
from damaging import psnr
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from cvtimg import denoise

SHAPES = [(1, 1), (1, 40), (40, 1), (2, 3), (9, 9, 3), (24, 40), (40, 33, 3), (48, 48, 3), (30, 30, 5)]
CONTENTS = ["white", "black", "half white", "ramp", "white noise", "clipped noise", "stripes"]


def picture(shape: tuple[int, ...], content: str, dtype: type, seed: int) -> NDArray[Any]:
    """A picture with values in 0..1, in a type."""
    rng = np.random.default_rng(seed)
    ramp = np.broadcast_to(np.linspace(0.2, 0.8, shape[1]).reshape(1, -1, *[1] * (len(shape) - 2)), shape)
    noise = rng.standard_normal(shape)
    contents = {
        "white": np.ones(shape),
        "black": np.zeros(shape),
        "half white": np.where(ramp < 0.5, ramp + 0.05 * noise, 1),
        "ramp": ramp,
        "white noise": ramp + 0.1 * noise,
        "clipped noise": 0.98 + 0.3 * noise,
        "stripes": np.broadcast_to(np.indices(shape)[1] // 3 % 2, shape),
    }
    values = np.clip(contents[content], 0, 1)
    white = 1 if np.dtype(dtype).kind == "f" else np.iinfo(dtype).max
    return (np.rint(values * white) if white > 1 else values).astype(dtype)


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(SHAPES),
    st.sampled_from(CONTENTS),
    st.sampled_from([np.uint8, np.uint16, np.float32, np.float64]),
    st.integers(1, 3),
    st.sampled_from([0.0, 0.3, 0.95]),
    st.integers(0, 99),
)
def test_nothing_fails(
    shape: tuple[int, ...], content: str, dtype: type, n_versions: int, holes: float, seed: int
) -> None:
    images = [picture(shape, content, dtype, seed)] * n_versions
    rng = np.random.default_rng(seed)
    masks = [rng.random(shape[:2]) >= holes for _ in images]
    masks[0].flat[0] = True
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # copies
        result = denoise(images, masks=masks, effort="fast")
    assert result.image.shape == shape
    assert result.image.dtype == dtype
    assert np.isfinite(result.image).all()
    if not result.noisy and all(mask.all() for mask in masks):
        np.testing.assert_allclose(result.image, images[0], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("equal", [1, 3])
def test_a_photograph_without_noise_comes_back_as_it_is(equal: int) -> None:
    from skimage.data import chelsea

    photograph = chelsea()[60:220, 100:300]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        result = denoise([photograph] * equal)
    assert np.square(result.image.astype(float) - photograph).mean() < 0.65  # 50 dB


@pytest.mark.parametrize("quality", [75, 95])
def test_files_of_jpeg_lose_nothing(photograph: NDArray[Any], quality: int) -> None:
    clean = photograph[64:192, 64:192]
    file = io.BytesIO()
    Image.fromarray(clean).save(file, "JPEG", quality=quality)
    read = Image.open(file)
    for image in (read, np.asarray(read)):
        done = denoise([image], effort="fast").image
        assert psnr(done / 255, clean / 255) > psnr(np.asarray(read) / 255, clean / 255) - 0.1


@pytest.mark.parametrize(("sigma", "gain"), [(1, 0.5), (3, 2.5)])
def test_little_noise_is_taken_away(photograph: NDArray[Any], sigma: float, gain: float) -> None:
    clean = photograph[64:192, 64:192]
    noise = np.random.default_rng(0).normal(0, sigma, clean.shape)
    noisy = np.clip(np.rint(clean + noise), 0, 255).astype(np.uint8)
    done = denoise([noisy], effort="fast").image
    assert psnr(done / 255, clean / 255) > psnr(noisy / 255, clean / 255) + gain
