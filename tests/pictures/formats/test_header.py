"""The header tells what an image holds without its pixels."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from images import BITS, DEEP, GREY, RGB, RGBA
from numpy.typing import NDArray
from picture_files import SRGB, save

from cvtimg.pictures.files import image_info


@pytest.mark.parametrize(
    ("name", "image", "expected"),
    [
        ("a.png", BITS, ("PNG", "1", ("1",), 1, False)),
        ("a.png", DEEP, ("PNG", "I;16", ("I",), 16, False)),
        ("a.png", RGBA, ("PNG", "RGBA", ("R", "G", "B", "A"), 8, True)),
        ("a.tif", DEEP, ("TIFF", "I;16", ("I",), 16, False)),
        ("a.tif", DEEP / np.float32(2), ("TIFF", "F", ("F",), 32, False)),
        ("a.jpg", GREY, ("JPEG", "L", ("L",), 8, False)),
    ],
)
def test_the_header_tells_format_mode_bands_bits_and_alpha(
    tmp_path: Path, name: str, image: NDArray[Any], expected: tuple[Any, ...]
) -> None:
    info = image_info(save(tmp_path / name, image))
    assert (info.format, info.mode, info.bands, info.bits, info.has_alpha) == expected
    assert (info.width, info.height, info.frames, info.icc) == (7, 5, 1, None)


def test_the_header_names_the_profile(tmp_path: Path) -> None:
    assert image_info(save(tmp_path / "a.png", RGB, icc_profile=SRGB)).icc == "sRGB built-in"
    assert image_info(save(tmp_path / "b.png", RGB, icc_profile=b"rubbish")).icc == "unreadable"


def test_the_header_is_read_without_pixels(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", np.tile(RGB, (30, 30, 1)))
    path.write_bytes(path.read_bytes()[:300])
    info = image_info(path)
    assert (info.width, info.height) == (210, 150)
    with pytest.raises(FrozenInstanceError):
        info.width = 3  # type: ignore[misc]
