"""Palettes of colors that hardware with few bits per channel can show."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import find_palette, quantize
from cvtimg.colors import color_samples
from cvtimg.colors.samples import ColorSamples
from cvtimg.quantization import map_to_palette


def shown(n_bits: int, width: int = 8) -> NDArray[np.int64]:
    """Return the values that n bits stand for, by text."""
    return np.array([int((f"{value:0{n_bits}b}" * width)[:width], 2) for value in range(1 << n_bits)])


def afterwards(samples: ColorSamples, n_colors: int, n_bits: int) -> NDArray[np.uint8]:
    """Return the palette that is found first, and rounded to hardware colors then."""
    levels = shown(n_bits)
    found = find_palette(samples, n_colors).colors.astype(int)
    return np.unique(levels[np.abs(found[..., None] - levels).argmin(axis=2)].astype(np.uint8), axis=0)


@pytest.mark.parametrize("bits", [1, 2, 3, 4, 5, 6, 7, 8])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_all_colors_are_bits_that_repeat(bits: int, dtype: Any, photograph: NDArray[Any]) -> None:
    width = 8 * np.dtype(dtype).itemsize
    image = photograph[::4, ::4].astype(dtype) * dtype((1 << width - 8) + (width > 8))
    result = quantize(image, 12, color_bits=bits)
    assert np.isin(result.image, shown(bits, width)).all()
    assert result.palette.dtype == dtype


@pytest.mark.slow
@pytest.mark.parametrize("n_bits", [3, 4, 5])
@pytest.mark.parametrize("n_colors", [8, 32, 128])
def test_the_error_is_at_most_that_of_rounding_afterwards(n_bits: int, n_colors: int, photograph: NDArray[Any]) -> None:
    samples = color_samples(photograph[::2, ::2])
    rounded = afterwards(samples, n_colors, n_bits)
    palette = find_palette(samples, n_colors, color_bits=n_bits).colors
    energy, other = (map_to_palette(samples, colors).energy for colors in (palette, rounded))
    assert energy <= other
    if len(rounded) < 0.9 * n_colors:  # colors were lost
        assert len(palette) > len(rounded)
        assert energy < 0.97 * other


@pytest.mark.parametrize("n_colors", [4, 12, 30])
def test_the_error_is_nearly_that_of_the_best_choice_among_all_hardware_colors(
    n_colors: int, photograph: NDArray[Any]
) -> None:
    image = photograph[::4, ::4]
    grid = np.stack(np.meshgrid(*[shown(2)] * 3), axis=-1).reshape(-1, 3)
    best = quantize(image, n_colors, palette=grid.astype(np.uint8))
    assert quantize(image, n_colors, color_bits=2).energy <= 1.03 * best.energy


def test_an_image_with_as_many_hardware_colors_is_only_rounded(photograph: NDArray[Any]) -> None:
    levels = shown(2)
    result = quantize(photograph, 64, color_bits=2)
    assert (result.image == levels[np.abs(photograph[..., None] - levels).argmin(axis=3)]).all()
    again = quantize(result.image, 64, color_bits=2)
    assert again.energy == 0


def test_the_nearest_color_is_that_of_the_space() -> None:
    red = np.array([[[200, 40, 50]]], np.uint8)
    assert quantize(red, 1, color_bits=2).palette.tolist() == [[170, 0, 85]]
    assert quantize(red, 1, color_bits=2, space="oklab").palette.tolist() == [[170, 0, 0]]


def test_channels_have_bits_of_their_own(photograph: NDArray[Any]) -> None:
    result = quantize(photograph[::4, ::4], 40, color_bits=(5, 6, 1), space="oklab", dither="blue-noise")
    for channel, n_bits in enumerate((5, 6, 1)):
        assert np.isin(result.palette[:, channel], shown(n_bits)).all()
    assert set(result.palette[:, 2].tolist()) <= {0, 255}


def test_gray_becomes_color_where_channels_differ(photograph: NDArray[Any]) -> None:
    gray = photograph[::4, ::4, 1]
    assert quantize(gray, 8, color_bits=5).palette.shape == (8, 1)
    assert quantize(gray, 8, color_bits=(5, 6, 5)).image.shape == (*gray.shape, 3)


def test_transparency_is_kept_and_only_colors_are_rounded(photograph: NDArray[Any]) -> None:
    small = photograph[::4, ::4]
    alpha = np.full((*small.shape[:2], 1), 255, np.uint8)
    alpha[:9], alpha[9:12] = 0, 77
    result = quantize(np.concatenate([small, alpha], axis=2), 16, alpha=True, color_bits=3)
    assert np.isin(result.palette[:, :3], shown(3)).all()
    assert (result.palette[result.indices][..., 3][12:] == 255).all()
    assert (result.palette[result.indices][..., 3][:9] == 0).all()


def test_locked_colors_stay_if_the_hardware_has_them(photograph: NDArray[Any]) -> None:
    result = quantize(photograph[::4, ::4], 8, color_bits=3, locked=[[255, 0, 36]])
    assert [255, 0, 36] in result.palette.tolist()
    with pytest.raises(ValueError, match=r"locked=\[254, 0, 36\] must be \[255, 0, 36\], the nearest color"):
        quantize(photograph, 8, color_bits=3, locked=[[254, 0, 36]])
