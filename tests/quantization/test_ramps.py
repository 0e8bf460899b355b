"""Palettes whose colors stand for tones: images mapped by their lightness."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import quantize, read_palette
from cvtimg.colors import to_space
from cvtimg.quantization import DITHERS

RAMP = read_palette("game-boy")


def lightness(image: NDArray[Any]) -> NDArray[np.float64]:
    return to_space(image.reshape(-1, 3), "oklab")[:, 0]


@pytest.fixture
def dark(photograph: NDArray[Any]) -> NDArray[Any]:
    """Return an image without bright pixels."""
    return photograph[::2, ::2] // 4


@pytest.mark.parametrize("dither", [None, *DITHERS])
def test_all_tones_of_a_dark_image_are_used(dither: Any, dark: NDArray[Any]) -> None:
    assert len(np.unique(quantize(dark, palette=RAMP).indices)) < 4
    result = quantize(dark, palette=RAMP, ramp=True, dither=dither)
    assert np.bincount(result.indices.ravel()).min() > 0.02 * dark[..., 0].size
    assert (result.palette == RAMP).all()


def test_the_tones_represent_the_lightness_with_the_least_error(dark: NDArray[Any]) -> None:
    grays = np.rint(255 * lightness(dark)).astype(np.uint8).reshape(dark.shape[:2])
    assert (quantize(dark, palette=RAMP, ramp=True).indices == quantize(grays, 4).indices).all()


def test_the_palette_keeps_its_order(dark: NDArray[Any]) -> None:
    mixed = RAMP[[2, 0, 3, 1]]
    result = quantize(dark, palette=mixed, ramp=True)
    assert (result.palette == mixed).all()
    assert (result.image == quantize(dark, palette=RAMP, ramp=True).image).all()


def test_an_image_in_the_colors_of_the_ramp_stays(dark: NDArray[Any]) -> None:
    image = RAMP[[[0, 2, 2], [0, 0, 2]]]
    result = quantize(image, palette=RAMP, ramp=True)
    assert (result.image == image).all()
    assert result.energy == 0


def test_images_of_few_tones_use_the_ends_of_the_ramp() -> None:
    image = np.array([[40, 44, 44, 40]], np.uint8)
    assert quantize(image, palette=RAMP, ramp=True).indices.tolist() == [[0, 3, 3, 0]]


def test_the_energy_is_that_of_the_colors(dark: NDArray[Any]) -> None:
    for dither in (None, "bayer"):
        result = quantize(dark, palette=RAMP, ramp=True, dither=dither)  # type: ignore[arg-type]
        assert result.energy == pytest.approx(((result.image.astype(float) - dark) ** 2).sum(), rel=1e-6)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_transparent_pixels_stay_so(dtype: Any, dark: NDArray[Any]) -> None:
    white = 1.0 if dtype is np.float32 else float(np.iinfo(dtype).max)
    alpha = np.full((*dark.shape[:2], 1), 255.0)
    alpha[:20] = 0
    image = (np.concatenate([dark, alpha], axis=2) / 255 * white).astype(dtype)
    ramp = (RAMP / 255 * white).astype(dtype)
    result = quantize(image, palette=ramp, ramp=True, alpha=True)
    assert (result.image[:20] == 0).all()
    assert (result.image[20:, :, 3] == dtype(white)).all()
    assert len(np.unique(result.indices)) == 5


def test_what_a_ramp_does_not_take_is_refused(dark: NDArray[Any]) -> None:
    with pytest.raises(ValueError, match="ramp needs palette"):
        quantize(dark, 4, ramp=True)
    for name, value in (("n_colors", 3), ("space", "lab"), ("dither", "compact"), ("goal", "eyes")):
        with pytest.raises(ValueError, match=f"ramp takes no {name}|ramp=True cannot be combined with goal"):
            quantize(dark, palette=RAMP, ramp=True, **{name: value})  # type: ignore[arg-type]
