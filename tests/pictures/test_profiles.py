"""Embedded color profiles are converted to sRGB, and those that do not fit are ignored."""

from pathlib import Path

import numpy as np
import pytest
from images import RGB, RGBA
from picture_files import SRGB, cmyk_profile, grey_profile, rgb_profile, save
from PIL import Image

from cvtimg.pictures.files import read_image


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P"])
def test_a_color_profile_is_converted_to_srgb(tmp_path: Path, mode: str) -> None:
    pixels = np.array([[[255, 0, 0, 9], [0, 255, 0, 99], [0, 0, 255, 255]]], np.uint8)
    stored = Image.fromarray(pixels if mode == "RGBA" else pixels[..., :3].copy())
    stored = stored.quantize(3) if mode == "P" else stored
    image = read_image(save(tmp_path / "a.png", stored, icc_profile=rgb_profile("gbr")))
    turned = np.array([[[0, 255, 0], [0, 0, 255], [255, 0, 0]]])
    assert np.abs(image[..., :3].astype(int) - turned).max() <= 3
    if mode == "RGBA":
        np.testing.assert_array_equal(image[..., 3], pixels[..., 3])


@pytest.mark.parametrize("mode", ["1", "L", "RGB", "RGBA"])
def test_an_srgb_profile_changes_nothing(tmp_path: Path, mode: str) -> None:
    stored = Image.fromarray(RGBA).convert(mode)
    plain = read_image(save(tmp_path / "a.png", stored))
    np.testing.assert_array_equal(read_image(save(tmp_path / "b.png", stored, icc_profile=SRGB)), plain)


@pytest.mark.parametrize("icc", [grey_profile(1.0), rgb_profile(value=1.0)], ids=["grey", "rgb"])
def test_a_grey_picture_is_brought_to_the_srgb_curve_and_stays_grey(tmp_path: Path, icc: bytes) -> None:
    linear = np.array([[0, 55, 128, 255]], np.uint8)
    curve = [0, 128, 188, 255]  # of the light 0, 0.216, 0.5 and 1
    image = read_image(save(tmp_path / "a.png", linear, icc_profile=icc))
    assert image.shape == (1, 4)
    assert np.abs(image.astype(int) - curve).max() <= 1
    with_alpha = Image.merge("LA", [Image.fromarray(linear)] * 2)
    image = read_image(save(tmp_path / "b.png", with_alpha, icc_profile=icc))
    assert np.abs(image[..., :3].astype(int) - np.array(curve)[:, None]).max() <= 1
    np.testing.assert_array_equal(image[..., 3], linear)


def test_cmyk_goes_through_its_profile(tmp_path: Path) -> None:
    stored = Image.new("CMYK", (8, 8), (255, 0, 0, 0))
    path = save(tmp_path / "a.tif", stored, icc_profile=cmyk_profile())
    pixel = read_image(path)[0, 0].astype(int)
    assert np.ptp(pixel) <= 3, "grey ink, where Pillow alone says cyan"
    assert 90 <= pixel[0] <= 140  # half of the lightness is level 119


@pytest.mark.parametrize(
    "icc",
    [b"rubbish", SRGB[:200], rgb_profile("gbr")[:300], grey_profile(1.0), cmyk_profile()],
    ids=["rubbish", "short", "cut", "for grey", "for print"],
)
def test_a_profile_that_does_not_serve_is_ignored(tmp_path: Path, icc: bytes) -> None:
    path = save(tmp_path / "a.png", RGB, icc_profile=icc)
    np.testing.assert_array_equal(read_image(path), RGB)
