"""Palettes that are given: what they become where pixels are transparent."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import quantize_frames
from cvtimg._shared.choices import DitherName
from cvtimg.pictures import Frames
from cvtimg.quantization import map_to_palette


def _sprite() -> NDArray[np.uint8]:
    """Draw random opaque pixels below transparent ones."""
    image = np.random.default_rng(0).integers(0, 120, (12, 12, 4), np.uint8)
    image[..., 3] = 255
    image[:3] = 0
    return image


@pytest.mark.parametrize("dither", [None, "floyd-steinberg"])
def test_a_transparent_color_is_put_first_and_said(dither: DitherName | None) -> None:
    palette = np.repeat(np.arange(0, 60, 5, dtype=np.uint8)[:, None], 3, axis=1)
    with pytest.warns(UserWarning, match="palette has no transparent color: one is put first, for the transparent"):
        result = map_to_palette(_sprite(), palette, alpha=True, dither=dither)
    assert result.palette[:, 3].tolist() == [0] + [255] * 12
    assert (result.indices[:3] == 0).all()
    assert (result.indices[3:] > 0).all()
    np.testing.assert_array_equal(result.palette[1:, :3], palette)


def test_it_takes_the_place_of_an_unused_color_where_indices_would_need_more_bits() -> None:
    palette = np.repeat(np.arange(0, 256, 17, dtype=np.uint8)[:, None], 3, axis=1)  # the bright ones are not used
    with pytest.warns(UserWarning, match=r"in place of entry 15 \(from 0\), which no pixel has"):
        result = map_to_palette(_sprite(), palette, alpha=True)
    assert len(result.palette) == 16
    np.testing.assert_array_equal(result.palette[1:, :3], palette[:-1])
    with pytest.warns(UserWarning, match="one is put first"):
        more = map_to_palette(_sprite(), palette[:-1], alpha=True)  # there is room for one
    np.testing.assert_array_equal(result.image, more.image)


def test_frames_share_the_palette_that_got_a_transparent_color() -> None:
    frames = Frames((_sprite(), np.full((12, 12, 4), 255, np.uint8)), (40, 40), 0)
    with pytest.warns(UserWarning, match="one is put first"):
        result = quantize_frames(frames, palette=np.array([[0, 0, 0], [255, 255, 255]], np.uint8))
    first, second = result.results
    np.testing.assert_array_equal(first.palette, second.palette)
    assert len(first.palette) == 3
