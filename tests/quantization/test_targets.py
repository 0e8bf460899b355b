"""The fewest colors that reach a quality, the most whose file is small enough."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvtimg import quantize
from cvtimg.pictures import encode_image
from cvtimg.quantization import Quantized
from cvtimg.quantization.targets import Ladder


@given(st.lists(st.floats(-5, 60), min_size=1, max_size=300), st.floats(-5, 60), st.integers(1, 300), st.booleans())
def test_what_is_found_reaches_the_target_and_one_less_does_not(
    values: list[float], target: float, first: int, rising: bool
) -> None:
    table = sorted(values) if rising else values
    tried: set[int] = set()

    def result(n: Any) -> float:
        assert n not in tried
        tried.add(n)
        return table[n - 1]

    below, reached = Ladder(range(1, len(table) + 1), result, float, 2.0).climb(target, first)
    assert below is None or below[1] == table[int(below[0]) - 1] < target
    assert reached is None or reached[1] == table[int(reached[0]) - 1] >= target
    assert (reached[0] if reached else len(table) + 1) == (below[0] if below else 0) + 1
    if rising:
        assert (below[0] if below else 0) == sum(value < target for value in table)


def test_few_trials_suffice_where_quality_follows_the_logarithm() -> None:
    tried: list[int] = []

    def result(n: Any) -> float:
        tried.append(n)
        return 20 + 2.2 * np.log2(n) + 0.05 * np.sin(n)

    Ladder(range(1, 65537), result, float, 2.0).climb(38.0, 32)
    assert len(tried) <= 10


@pytest.mark.parametrize("psnr", [18, 24.5, 30])
@pytest.mark.parametrize("options", [{}, {"effort": "fast"}, {"space": "oklab"}, {"dither": "floyd-steinberg"}])
def test_no_fewer_colors_reach_the_quality(psnr: float, options: Any, photograph: NDArray[Any]) -> None:
    picture = photograph[::4, ::4]
    result = quantize(picture, psnr=psnr, **options)
    n_colors = len(result.palette)
    assert result.psnr >= psnr
    assert quantize(picture, n_colors - 1, **options).psnr < psnr
    np.testing.assert_array_equal(result.image, quantize(picture, n_colors, **options).image)


def test_locked_and_transparent_colors_are_counted(photograph: NDArray[Any]) -> None:
    picture = np.dstack([photograph[::8, ::8], np.full((32, 32), 255, np.uint8)])
    picture[:4, :, 3] = 0
    result = quantize(picture, psnr=1, alpha=True, locked=[[255, 0, 0], [0, 0, 255]])
    assert len(result.palette) == 3


def size(result: Quantized) -> int:
    pixels, palette = result.content
    return len(encode_image(".png", pixels, palette=palette))


@pytest.mark.parametrize("n_bytes", [2000, 4000])
def test_the_file_fits_and_one_color_more_does_not(n_bytes: int, photograph: NDArray[Any]) -> None:
    picture = photograph[::4, ::4]
    result = quantize(picture, max_bytes=n_bytes)
    assert size(result) <= n_bytes < size(quantize(picture, len(result.palette) + 1))
    assert len(quantize(picture, 2, max_bytes=n_bytes).palette) == 2
