"""Results are short to read, shown in notebooks, and saved in one call."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from cvtimg import find_palette, quantize, quantize_frames, read_image, read_palette, tessellate
from cvtimg.colors import color_samples
from cvtimg.pictures import Frames, read_frames


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
