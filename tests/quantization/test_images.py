from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from PIL import Image

from cvtimg import find_palette, quantize, quantize_frames, read_image, read_palette, tessellate
from cvtimg.colors import color_samples
from cvtimg.pictures import Frames, read_frames


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


@given(hnp.arrays(np.uint8, hnp.array_shapes(min_dims=2, max_dims=3, max_side=9)), st.integers(2, 30))
def test_pictures_of_any_shape_get_at_most_the_colors_asked(picture: NDArray[Any], n_colors: int) -> None:
    result = quantize(picture, n_colors, alpha=picture.ndim == 3 and picture.shape[2] in (2, 4))
    n_left = len(np.unique(result.image.reshape(picture.shape[0] * picture.shape[1], -1), axis=0))
    assert n_left <= min(n_colors, result.n_distinct)
    assert result.energy == pytest.approx(reference.seen_energy(picture, result.image), rel=1e-5, abs=1e-3)


def test_every_result_is_written_in_one_line(photograph: NDArray[Any]) -> None:
    samples = color_samples(photograph)
    frames = Frames((photograph[:9], photograph[9:18]), (40, 40), 0)
    results: list[Any] = [
        samples,
        tessellate(samples, 3),
        quantize(photograph, 200),
        quantize(photograph, 1).tessellation,
        find_palette(samples, 200),
        quantize_frames(frames, 4),
        find_palette(color_samples(np.zeros((2, 2, 6), np.float32)), 1),
    ]
    for result in results:
        assert 1 <= len(repr(result).splitlines()) <= 2
        assert len(repr(result)) < 200
        assert "array" not in repr(result)


@pytest.mark.parametrize("n_colors", [5, 300])
def test_a_notebook_shows_the_image(n_colors: int, photograph: NDArray[Any]) -> None:
    result = quantize(photograph, n_colors)
    with Image.open(BytesIO(result._repr_png_())) as shown:
        np.testing.assert_array_equal(np.asarray(shown.convert("RGB")), result.image)
    with Image.open(BytesIO(quantize(photograph / 255, 5)._repr_png_())) as shown:
        np.testing.assert_array_equal(np.asarray(shown), np.rint(quantize(photograph / 255, 5).image * 255))


def test_a_notebook_shows_the_colors() -> None:
    palette = find_palette(color_samples(np.array([[[255, 0, 0], [0, 16, 255]]], np.uint8)), 2)
    assert "#ff0000" in palette._repr_html_()
    assert "#0010ff" in palette._repr_html_()
    assert "#0010ff" in repr(palette)


def test_results_are_saved(tmp_path: Path, photograph: NDArray[Any]) -> None:
    result = quantize(photograph, 7)
    result.save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), result.image)
    with pytest.raises(FileExistsError):
        result.save(tmp_path / "a.png")
    palette = find_palette(color_samples(photograph), 7)
    palette.save(tmp_path / "a.gpl")
    np.testing.assert_array_equal(read_palette(tmp_path / "a.gpl"), palette.colors)
    frames = quantize_frames(Frames((photograph[:9], photograph[9:18]), (40, 40), 0), 4)
    frames.save(tmp_path / "a.gif")
    assert len(read_frames(tmp_path / "a.gif").images) == 2
