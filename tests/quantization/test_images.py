from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from cvtimg import quantize


@pytest.mark.parametrize("n_colors", [1, 2, 16, 256, 300])
def test_every_pixel_has_the_nearest_color_of_the_palette(n_colors: int, photograph: NDArray[Any]) -> None:
    picture = photograph[::3, ::3]
    result = quantize(picture, n_colors)
    pixels = picture.reshape(-1, 3)
    nearest = reference.squared_distances(pixels, result.palette).min(axis=1)
    error = ((result.image.reshape(-1, 3).astype(float) - pixels) ** 2).sum(axis=1)
    np.testing.assert_array_equal(error, nearest)
    assert result.energy == error.sum()
    assert result.indices.dtype == (np.uint8 if n_colors <= 256 else np.uint16)
    assert len(result.palette) <= n_colors


def test_a_picture_of_few_colors_comes_back_exactly(photograph: NDArray[Any]) -> None:
    few = quantize(photograph, 7).image
    for n_colors in (7, 8, 65536):
        result = quantize(few, n_colors)
        np.testing.assert_array_equal(result.image, few)
        assert result.energy == 0
        assert result.psnr == np.inf
        assert len(result.palette) == 7
        assert result.tessellation is None


def test_the_palette_goes_from_dark_to_bright(photograph: NDArray[Any]) -> None:
    palette = quantize(photograph, 32).palette.astype(int)
    assert (np.diff(palette.sum(axis=1)) >= 0).all()


def test_more_colors_leave_less_energy(photograph: NDArray[Any]) -> None:
    energies = [quantize(photograph, k).energy for k in (2, 4, 8, 16, 32, 64, 128, 256)]
    assert (np.diff(energies) < 0).all()


@given(hnp.arrays(np.uint8, hnp.array_shapes(min_dims=2, max_dims=3, max_side=9)), st.integers(2, 30))
def test_pictures_of_any_shape_get_at_most_the_colors_asked(picture: NDArray[Any], n_colors: int) -> None:
    result = quantize(picture, n_colors, alpha=picture.ndim == 3 and picture.shape[2] in (2, 4))
    n_left = len(np.unique(result.image.reshape(picture.shape[0] * picture.shape[1], -1), axis=0))
    assert n_left <= min(n_colors, result.n_distinct)
    assert result.energy == pytest.approx(reference.seen_energy(picture, result.image), rel=1e-5, abs=1e-3)
