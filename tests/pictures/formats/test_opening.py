"""A file that cannot be read is named with the reason, and warnings stay where they belong."""

import os
import re
import struct
import warnings
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from images import BITS, DEEP, GREY, RGB, RGBA
from picture_files import SRGB, save
from PIL import Image
from PIL.PngImagePlugin import PngImageFile

from cvtimg._shared.types import Array
from cvtimg.pictures.files import image_info, read_image

posix = pytest.mark.skipif(os.name == "nt", reason="POSIX permissions, links and devices")


@pytest.mark.parametrize("reader", [read_image, image_info])
@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("text.png", b"just some text\n", "cannot be read: unknown image format"),
        ("empty.png", b"", "is empty"),
        ("script.eps", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n", "cannot be read"),
    ],
)
def test_a_file_that_is_no_picture_is_named_with_the_reason(
    tmp_path: Path, reader: Any, name: str, content: bytes, reason: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(OSError, match="^" + re.escape(f"{path}: {reason}")):
        reader(path)


@pytest.mark.parametrize("reader", [read_image, image_info])
def test_a_missing_file_and_a_folder_have_their_own_errors(tmp_path: Path, reader: Any) -> None:
    with pytest.raises(FileNotFoundError, match=r"a\.png: no such file$"):
        reader(tmp_path / "a.png")
    with pytest.raises(IsADirectoryError, match=r"is a directory, not a file$"):
        reader(str(tmp_path))


@posix
def test_a_file_below_a_file_is_an_os_error_in_words(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", RGB) / "b.png"
    with pytest.raises(NotADirectoryError, match=r"b\.png: not a directory$"):
        read_image(path)


@pytest.mark.parametrize(
    "error",
    [SyntaxError("a\nb"), struct.error("x"), zlib.error(), IndexError(), OverflowError("y")],
    ids=lambda error: type(error).__name__,
)
def test_whatever_pillow_raises_becomes_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    path = save(tmp_path / "a.png", RGB)

    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(PngImageFile, "load", fail)
    with pytest.raises(OSError, match=r"a\.png: is truncated or damaged \([^\n]+\)$") as caught:
        read_image(path)
    assert caught.value.__cause__ is error


def test_a_large_picture_is_read_in_silence_and_a_bomb_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = save(tmp_path / "a.png", RGB)
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 30)
        np.testing.assert_array_equal(read_image(path), RGB)
        monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 17)
        with pytest.raises(OSError, match=r"a\.png: has over 34 pixels"):
            read_image(path)
    assert shown == []


def test_a_reader_that_ends_first_leaves_the_other_in_silence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, other = save(tmp_path / "a.png", RGB), save(tmp_path / "b.bmp", RGB)
    load = PngImageFile.load
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")

        def load_late(image: PngImageFile) -> Any:
            read_image(other)
            Image.open(other).close()  # warns
            warnings.warn("of somebody else", stacklevel=1)
            return load(image)

        monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 30)
        monkeypatch.setattr(PngImageFile, "load", load_late)
        read_image(path)
    assert {str(warning.message) for warning in shown} == {"of somebody else"}


def test_reading_in_threads_leaves_the_warning_filters_as_they_were(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", np.tile(RGB, (40, 40, 1)))
    with warnings.catch_warnings():
        before = list(warnings.filters)
        with ThreadPoolExecutor(8) as pool:
            list(pool.map(read_image, [path] * 64))
        assert list(warnings.filters) == before


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
    tmp_path: Path, name: str, image: Array, expected: tuple[Any, ...]
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
