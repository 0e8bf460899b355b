"""Images for eyes: small files of the same look."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cvtimg
from cvtimg._shared.threads import one_thread
from cvtimg.pictures.formats.encoding import encode_image
from cvtimg.pictures.frames import Frames
from cvtimg.quantization import Quantized, UnfitOptionError, map_to_palette, quantize_file, quantize_frames

COFFEE = cvtimg.read_image("sample_images/coffee.png")[100:292, 180:436]
CHELSEA = cvtimg.read_image("sample_images/chelsea.png")[:192, 100:356]
PART = CHELSEA[32:160, 64:192]
FAST: dict[str, Any] = {"effort": "fast"}


def n_bytes(result: Quantized) -> int:
    pixels, palette = result.content
    return len(encode_image(".png", pixels, palette=palette))


def test_for_eyes_the_file_is_smaller_and_looks_better() -> None:
    error, eyes = cvtimg.quantize(CHELSEA, 256), cvtimg.quantize(CHELSEA, goal="eyes")
    assert n_bytes(eyes) < 0.75 * n_bytes(error)
    assert cvtimg.visual_quality(CHELSEA, eyes.image) > cvtimg.visual_quality(CHELSEA, error.image)
    assert eyes.psnr < error.psnr  # which is the goal of the other


def test_a_quality_is_reached_and_not_much_more_and_less_gives_a_smaller_file() -> None:
    sizes = []
    for quality in (70, 80):
        result = cvtimg.quantize(PART, quality=quality, **FAST)
        assert quality <= cvtimg.visual_quality(PART, result.image) < quality + 5
        assert result.quality == cvtimg.visual_quality(PART, result.image)
        sizes.append(n_bytes(result))
    assert sizes[0] < 0.9 * sizes[1]


def test_a_quality_out_of_reach_tells_what_can_be_had() -> None:
    with pytest.raises(ValueError, match=r"quality=90 must be at most -?\d+\.\d, which 4 colors reach"):
        cvtimg.quantize(COFFEE, 4, quality=90, **FAST)


@pytest.mark.parametrize("options", [{"goal": "eyes"}, {"quality": 90}])
def test_images_with_few_colors_stay_exact(options: dict[str, Any]) -> None:
    cat = cvtimg.read_image("sample_images/chelsea.png")[:40, :40] // 64 * 64
    result = cvtimg.quantize(cat, **options)
    assert result.energy == 0
    np.testing.assert_array_equal(result.image, cat)


def test_alpha_keeps_opaque_pixels_opaque_and_clear_ones_clear() -> None:
    alpha = np.full(COFFEE.shape[:2], 255, np.uint8)
    alpha[:60], alpha[60:100] = 0, 128
    result = cvtimg.quantize(np.dstack([COFFEE, alpha]), 32, alpha=True, goal="eyes", **FAST)
    np.testing.assert_array_equal(result.image[:60, :, 3], 0)
    np.testing.assert_array_equal(result.image[100:, :, 3], 255)


def test_gray_and_frames_and_masks() -> None:
    gray = cvtimg.quantize(COFFEE[:, :, 1], 64, goal="eyes")
    assert n_bytes(gray) < n_bytes(cvtimg.quantize(COFFEE[:, :, 1], 64))
    frames = quantize_frames(Frames((COFFEE[:64], COFFEE[64:128]), (40, 40), 0), 32, dither="compact", **FAST)
    assert len(frames.results) == 2
    mask = np.zeros(COFFEE.shape[:2], bool)
    mask[50:90, 50:90] = True
    inside = cvtimg.quantize(COFFEE, 16, goal="eyes", mask=mask, **FAST)
    np.testing.assert_array_equal(inside.image[~mask], COFFEE[~mask])


def test_the_best_that_fits(tmp_path: Path) -> None:
    source = tmp_path / "a.png"
    cvtimg.write_image(source, PART)
    fits = quantize_file(source, tmp_path / "b.png", goal="eyes", max_bytes=8_000, **FAST)
    assert 6_000 < (tmp_path / "b.png").stat().st_size <= 8_000
    assert fits.n_colors > 100
    small = quantize_file(source, tmp_path / "small.png", goal="eyes", max_bytes=4_000, **FAST)
    assert small.n_colors > 100  # few colors would look worse than a high price of bits
    quantize_file(source, tmp_path / "c.png", quality=50, max_bytes=25_000, **FAST)
    assert (tmp_path / "c.png").stat().st_size < 8_000  # which is enough for that quality


@pytest.mark.parametrize("options", [{"quality": 70}, {"goal": "eyes"}])
def test_images_in_tiles_are_not_for_eyes(options: dict[str, Any], tmp_path: Path) -> None:
    source = tmp_path / "a.tif"
    cvtimg.write_image(source, CHELSEA)
    with pytest.raises(UnfitOptionError, match="needs the whole image in memory"):
        quantize_file(source, tmp_path / "b.tif", **options, tiles=True)


def test_threads_do_not_matter() -> None:
    palette = cvtimg.quantize(COFFEE, 64, **FAST).palette
    many = map_to_palette(COFFEE, palette, dither="compact")
    with one_thread():
        np.testing.assert_array_equal(map_to_palette(COFFEE, palette, dither="compact").indices, many.indices)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"goal": "ears"}, "goal='ears' must be one of"),
        ({"quality": 101}, "quality=101 must be in 0..100"),
        ({"quality": 70, "psnr": 30}, "psnr=30 cannot be combined with goal='eyes' or quality"),
        ({"goal": "eyes", "space": "lab"}, "space='lab' cannot be combined"),
        ({"quality": 70, "dither": "floyd-steinberg"}, "dither='floyd-steinberg' must be 'compact'"),
        ({"n_colors": 300, "dither": "compact"}, "at most 256 colors with dither='compact'"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cvtimg.quantize(COFFEE[:80, :80], **{**FAST, **options})
