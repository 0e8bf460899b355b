"""Pictures come in upright, in sRGB and whole, or the file is named with the reason."""

from __future__ import annotations

import errno
import os
import re
import stat
import struct
import sys
import tempfile
import warnings
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from picture_files import SRGB, cmyk_profile, grey_profile, png, rgb_profile, save
from PIL import Image
from PIL.PngImagePlugin import PngImageFile

from cvtimg import quantize
from cvtimg.pictures.files import (
    Metadata,
    encode_image,
    find_images,
    image_info,
    read_image,
    read_metadata,
    whole_file,
    write_image,
)

posix = pytest.mark.skipif(os.name == "nt", reason="POSIX permissions, links and devices")
RNG = np.random.default_rng(5)
GREY = RNG.integers(0, 256, (5, 7), np.uint8)
RGB = RNG.integers(0, 256, (5, 7, 3), np.uint8)
RGBA = RNG.integers(0, 256, (5, 7, 4), np.uint8)
DEEP = RNG.integers(0, 65536, (5, 7), np.uint16)
BITS = RNG.integers(0, 2, (5, 7)).astype(bool)
DEEP_RGBA = RNG.integers(0, 65536, (5, 7, 4), np.uint16)
LOSSLESS = [".png", ".tif", ".tiff", ".webp", ".gif", ".bmp", ".ppm", ".npy"]


# --- reading: every mode


@pytest.mark.parametrize(
    ("name", "stored", "expected"),
    [
        ("bits.png", BITS, BITS * np.uint8(255)),
        ("bits.tif", BITS, BITS * np.uint8(255)),
        ("grey.png", GREY, GREY),
        ("rgb.png", RGB, RGB),
        ("rgb.bmp", RGB, RGB),
        ("rgba.png", RGBA, RGBA),
        ("deep.png", DEEP, DEEP),
        ("deep.tif", DEEP, DEEP),
        ("deep.pgm", DEEP, DEEP),
        ("float.tif", DEEP / np.float32(7), DEEP / np.float32(7)),
        ("int.tif", DEEP.astype(np.int32), DEEP),
        ("wide.tif", DEEP.astype(np.int32) - 70000, DEEP.astype(np.float32) - 70000),
    ],
)
def test_each_kind_of_pixel_keeps_its_values(
    tmp_path: Path, name: str, stored: NDArray[Any], expected: NDArray[Any]
) -> None:
    image = read_image(save(tmp_path / name, stored))
    assert image.dtype == expected.dtype
    assert image.flags.c_contiguous
    assert image.flags.writeable
    np.testing.assert_array_equal(image, expected)


def test_big_endian_16_bit_grey_is_native_uint16(tmp_path: Path) -> None:
    tags = [(256, 4, 7), (257, 4, 5), (258, 3, 16), (259, 3, 1), (262, 3, 1), (273, 4, 8)]
    tags += [(277, 3, 1), (278, 4, 5), (279, 4, 70)]
    entries = b"".join(
        struct.pack(">HHII", tag, kind, 1, value << 16 if kind == 3 else value) for tag, kind, value in tags
    )
    body = DEEP.astype(">u2").tobytes() + struct.pack(">H", len(tags)) + entries + bytes(4)
    path = tmp_path / "a.tif"
    path.write_bytes(b"MM" + struct.pack(">HI", 42, 78) + body)
    image = read_image(path)
    assert image.dtype == np.dtype("=u2")
    np.testing.assert_array_equal(image, DEEP)


def test_grey_with_alpha_becomes_rgba(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", Image.fromarray(RGBA).convert("LA"))
    grey = np.asarray(Image.fromarray(RGBA).convert("L"))
    np.testing.assert_array_equal(read_image(path), np.dstack([grey, grey, grey, RGBA[..., 3]]))


def test_a_palette_picture_becomes_its_colors(tmp_path: Path) -> None:
    indexed = Image.fromarray(RGB).quantize(9)
    path = save(tmp_path / "a.png", indexed)
    np.testing.assert_array_equal(read_image(path), np.asarray(indexed.convert("RGB")))


@pytest.mark.parametrize("name", ["a.png", "a.gif"])
def test_a_palette_picture_with_a_transparent_color_becomes_rgba(tmp_path: Path, name: str) -> None:
    indexed = Image.fromarray(np.array([[0, 1, 2]], np.uint8))
    indexed.putpalette(bytes([10, 20, 30, 40, 50, 60, 70, 80, 90]))
    image = read_image(save(tmp_path / name, indexed, transparency=1))
    np.testing.assert_array_equal(image[..., 3], [[255, 0, 255]])
    np.testing.assert_array_equal(image[0, [0, 2], :3], [[10, 20, 30], [70, 80, 90]])


@pytest.mark.parametrize(
    "file",
    [
        png((2, 1), 1, 0, b"\0\x40", struct.pack(">H", 0)),
        png((2, 1), 2, 0, b"\0\x60", struct.pack(">H", 1)),
        png((2, 1), 4, 0, b"\0\x56", struct.pack(">H", 5)),
        png((2, 1), 8, 0, b"\0\x05\x06", struct.pack(">H", 5)),
        png((2, 1), 8, 2, b"\0\1\2\3\4\5\6", struct.pack(">3H", 1, 2, 3)),
        png((2, 1), 16, 2, b"\0" + bytes(range(10, 22)), bytes(range(10, 16))),
    ],
    ids=["grey 1", "grey 2", "grey 4", "grey 8", "rgb 8", "rgb 16"],
)
def test_the_transparent_color_of_a_png_is_honoured_at_every_depth(tmp_path: Path, file: bytes) -> None:
    (tmp_path / "a.png").write_bytes(file)
    image = read_image(tmp_path / "a.png")
    np.testing.assert_array_equal(image[..., 3], [[0, np.iinfo(image.dtype).max]])


@pytest.mark.parametrize(
    ("mode", "pixel", "expected"),
    [
        ("CMYK", (255, 0, 0, 0), (0, 255, 255)),
        ("CMYK", (0, 0, 0, 255), (0, 0, 0)),
        ("YCbCr", (76, 85, 255), (255, 0, 0)),
        ("LAB", (138, 209, 198), (255, 0, 0)),
    ],
)
def test_other_color_spaces_become_rgb(
    tmp_path: Path, mode: str, pixel: tuple[int, ...], expected: tuple[int, ...]
) -> None:
    image = read_image(save(tmp_path / "a.tif", Image.new(mode, (3, 2), pixel)))
    assert image.shape == (2, 3, 3)
    assert np.abs(image.astype(int) - expected).max() <= 6


def test_the_inverted_cmyk_of_adobe_jpeg_is_turned_round_once(tmp_path: Path) -> None:
    path = save(tmp_path / "a.jpg", Image.new("CMYK", (8, 8), (255, 0, 0, 0)), quality=100)
    assert b"Adobe" in path.read_bytes()
    assert np.abs(read_image(path).astype(int) - (0, 255, 255)).max() <= 2


def test_the_first_frame_of_an_animation_is_read(tmp_path: Path) -> None:
    pages = [Image.fromarray(RGB), Image.fromarray(255 - RGB)]
    path = save(tmp_path / "a.png", pages[0], save_all=True, append_images=pages[1:])
    np.testing.assert_array_equal(read_image(path), RGB)
    assert image_info(path).frames == 2


# --- reading: upright, in sRGB


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.webp"])
@pytest.mark.parametrize(
    ("orientation", "stored"),
    [
        (1, RGB),
        (2, RGB[:, ::-1]),
        (3, RGB[::-1, ::-1]),
        (4, RGB[::-1]),
        (5, RGB.swapaxes(0, 1)),
        (6, RGB[:, ::-1].swapaxes(0, 1)),
        (7, RGB[::-1, ::-1].swapaxes(0, 1)),
        (8, RGB[::-1].swapaxes(0, 1)),
    ],
)
def test_exif_orientation_is_applied(tmp_path: Path, name: str, orientation: int, stored: NDArray[np.uint8]) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    options = {"lossless": True} if name == "a.webp" else {}
    path = save(tmp_path / name, np.ascontiguousarray(stored), exif=exif, **options)
    np.testing.assert_array_equal(read_image(path), RGB)
    assert (image_info(path).height, image_info(path).width) == RGB.shape[:2]


def test_damaged_exif_does_not_spoil_the_picture(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", RGB, exif=b"Exif\0\0MM\0*\xff\xff\xff\xff garbage")
    np.testing.assert_array_equal(read_image(path), RGB)
    assert image_info(path).width == 7


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


def test_deep_grey_stays_as_measured(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", DEEP, icc_profile=grey_profile(1.0))
    np.testing.assert_array_equal(read_image(path), DEEP)


# --- reading: files that cannot be read


@pytest.mark.parametrize("reader", [read_image, image_info])
@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("text.png", b"just some text\n", "cannot be read: unknown image format"),
        ("empty.png", b"", "is empty"),
        (
            "script.eps",
            b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n",
            "cannot be read",
        ),
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


@pytest.mark.parametrize("fraction", [0.3, 0.6, 0.9, 0.99])
@pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "bmp"])
def test_a_truncated_picture_is_named_with_the_reason(tmp_path: Path, suffix: str, fraction: float) -> None:
    path = save(tmp_path / f"a.{suffix}", RNG.integers(0, 256, (90, 80, 3), np.uint8))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * fraction)])
    reason = re.escape(f"{path}: is truncated or damaged (")
    with pytest.raises(OSError, match=f"^{reason}.+\\)$") as caught:
        read_image(path)
    assert caught.value.__cause__ is not None


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


# --- what the header says


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


def test_the_header_tells_16_bits_of_rgb(tmp_path: Path) -> None:
    file = png((2, 1), 16, 2, b"\0" + bytes(range(10, 22)), bytes(range(10, 16)))
    (tmp_path / "a.png").write_bytes(file)
    info = image_info(tmp_path / "a.png")
    assert (info.bits, info.has_alpha) == (16, True)


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


# --- writing: what comes back


@pytest.mark.parametrize(
    ("suffix", "image"),
    [(suffix, RGB) for suffix in LOSSLESS if suffix != ".gif"]
    + [(suffix, GREY) for suffix in (".png", ".tif", ".bmp", ".pgm")]
    + [(suffix, RGBA) for suffix in (".png", ".tif", ".webp")]
    + [(suffix, DEEP) for suffix in (".png", ".tif", ".pgm")],
)
def test_a_lossless_format_gives_the_array_back(tmp_path: Path, suffix: str, image: NDArray[Any]) -> None:
    path = tmp_path / f"a{suffix.upper()}"
    write_image(path, image)
    np.testing.assert_array_equal(read_image(path), image, strict=True)


def test_bool_is_written_as_one_bit(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", BITS)
    assert image_info(tmp_path / "a.png").bits == 1
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), BITS * 255)


def test_views_that_are_not_contiguous_are_written_as_they_look(tmp_path: Path) -> None:
    for number, view in enumerate([RGB[::-1, ::2], GREY.T, BITS.T, DEEP[:, ::-1], RGBA[..., :3]]):
        write_image(tmp_path / f"{number}.png", view)
        expected = view * np.uint8(255) if view.dtype == bool else view
        np.testing.assert_array_equal(read_image(tmp_path / f"{number}.png"), expected)


@pytest.mark.parametrize(("suffix", "image"), [(".webp", BITS), (".pgm", BITS), (".webp", GREY), (".ppm", GREY)])
def test_a_format_without_grey_or_bits_gets_a_wider_kind(tmp_path: Path, suffix: str, image: NDArray[Any]) -> None:
    write_image(tmp_path / f"a{suffix}", image)
    written = read_image(tmp_path / f"a{suffix}")
    grey = image * np.uint8(255) if image.dtype == bool else image
    np.testing.assert_array_equal(written, grey if suffix == ".pgm" else np.dstack([grey] * 3))


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg"])
def test_jpeg_is_near(tmp_path: Path, suffix: str) -> None:
    smooth = np.add.outer(np.arange(64), np.arange(64)).astype(np.uint8)
    write_image(tmp_path / f"a{suffix}", np.dstack([smooth, smooth // 2, smooth]))
    image = read_image(tmp_path / f"a{suffix}").astype(int)
    assert np.abs(image - np.dstack([smooth, smooth // 2, smooth])).max() <= 4


def indexed(k: int, bands: int = 3) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    codes = np.random.default_rng(k).choice(256**3, k, replace=False)
    palette = np.stack([codes % 256, codes // 256 % 256, codes // 65536, codes % 254], 1)
    indices = np.random.default_rng(k).integers(0, k, (13, 21))
    indices.flat[:k] = np.arange(min(k, indices.size))
    return indices, palette[:, :bands].astype(np.uint8)


@pytest.mark.parametrize("suffix", LOSSLESS)
@pytest.mark.parametrize("k", [1, 2, 3, 4, 5, 16, 17, 255, 256])
def test_an_indexed_picture_loses_no_color(tmp_path: Path, k: int, suffix: str) -> None:
    indices, palette = indexed(k)
    write_image(tmp_path / f"a{suffix}", indices, palette=palette)
    np.testing.assert_array_equal(read_image(tmp_path / f"a{suffix}"), palette[indices])


@pytest.mark.parametrize("bands", [3, 4])
@pytest.mark.parametrize(("k", "bits"), [(1, 1), (2, 1), (3, 2), (4, 2), (5, 4), (16, 4), (17, 8), (255, 8), (256, 8)])
def test_an_indexed_png_has_the_smallest_bit_depth_and_keeps_the_indices(
    tmp_path: Path, k: int, bits: int, bands: int
) -> None:
    indices, palette = indexed(k, bands)
    write_image(tmp_path / "a.png", indices, palette=palette)
    file = (tmp_path / "a.png").read_bytes()
    assert (file[24], file[25]) == (bits, 3)
    assert struct.unpack(">I", file[(at := file.index(b"PLTE")) - 4 : at]) == (3 * k,)
    with Image.open(tmp_path / "a.png") as image:
        np.testing.assert_array_equal(np.asarray(image), indices)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".webp"])
@pytest.mark.parametrize("k", [1, 2, 5, 16, 256])
def test_an_indexed_picture_keeps_its_transparency(tmp_path: Path, k: int, suffix: str) -> None:
    indices, palette = indexed(k, 4)
    write_image(tmp_path / f"a{suffix}", indices, palette=palette)
    np.testing.assert_array_equal(read_image(tmp_path / f"a{suffix}"), palette[indices])


@pytest.mark.parametrize("suffix", [".bmp", ".ppm", ".png", ".npy"])
def test_an_opaque_alpha_is_dropped(tmp_path: Path, suffix: str) -> None:
    indices, palette = indexed(5, 4)
    palette[:, 3] = 255
    write_image(tmp_path / f"a{suffix}", indices, palette=palette)
    np.testing.assert_array_equal(read_image(tmp_path / f"a{suffix}"), palette[indices][..., :3])


def test_gif_takes_one_clear_color_and_refuses_half_transparency(tmp_path: Path) -> None:
    indices, palette = indexed(5, 4)
    palette[:, 3] = [255, 255, 0, 255, 255]
    write_image(tmp_path / "a.gif", indices, palette=palette)
    image = read_image(tmp_path / "a.gif")
    np.testing.assert_array_equal(image[..., 3], palette[indices][..., 3])
    opaque = indices != 2
    np.testing.assert_array_equal(image[opaque], palette[indices][opaque])
    palette[2, 3] = 7
    with pytest.raises(ValueError, match=r"\.gif cannot hold transparency; use one of \.png"):
        write_image(tmp_path / "b.gif", indices, palette=palette)


@st.composite
def indexed_pictures(draw: st.DrawFn) -> tuple[NDArray[Any], NDArray[np.uint8]]:
    palette = draw(hnp.arrays(np.uint8, st.tuples(st.integers(1, 256), st.sampled_from([3, 4]))))
    shape = draw(st.tuples(st.integers(1, 19), st.integers(1, 19)))
    kind = draw(st.sampled_from([np.uint8, np.int32, np.uint64]))
    return draw(hnp.arrays(kind, shape, elements=st.integers(0, len(palette) - 1))), palette


@settings(max_examples=60, deadline=None)
@given(indexed_pictures())
def test_an_indexed_png_of_any_size_comes_back(
    case: tuple[NDArray[Any], NDArray[np.uint8]],
) -> None:
    indices, palette = case
    with tempfile.TemporaryDirectory() as folder:
        write_image(f"{folder}/a.png", indices, palette=palette)
        image = read_image(f"{folder}/a.png")
    np.testing.assert_array_equal(image, palette[indices][..., : image.shape[2]])
    assert image.shape[2] == 4 or palette.shape[1] == 3 or (palette[:, 3] == 255).all()


@pytest.mark.parametrize(
    ("name", "image", "palette", "reason"),
    [
        ("a.xyz", RGB, None, r"suffix '\.xyz' must be one of \.png"),
        ("a", RGB, None, "suffix '' must be one of"),
        ("a.jpg", GREY % 2, RGB[0], r"\.jpg would lose the colors .* \.png, \.tif"),
        ("a.jpg", RGBA, None, r"\.jpg cannot hold transparency; use one of \.png, \.tif"),
        ("a.bmp", DEEP, None, r"\.bmp cannot hold 16-bit gray images"),
        ("a.gif", RGB, None, r"\.gif cannot hold RGB images"),
        ("a.png", RGB.astype(float), None, r"\.png cannot hold floating point .* use one of \.tif, \.tiff, \.npy"),
        ("a.png", RGB[..., :2], None, r"\.png cannot hold .*bands that are not colors"),
        ("a.bmp", DEEP_RGBA, None, r"\.bmp cannot hold 16-bit RGBA images; use one of \.png, \.tif, \.tiff, \.npy"),
        ("a.tif", RGB.astype(complex), None, r"shape=\(5, 7, 3\) and dtype=complex128 must be"),
        ("a.npy", RGB[0, 0], None, r"shape=\(3,\) and dtype=uint8 must be"),
        ("a.png", RGB[:0], None, "have pixels"),
        ("a.png", GREY[:, :0], RGB[0], "have pixels"),
        ("a.png", RGB, RGB[0], "integer indices"),
        ("a.png", BITS, RGB[0], "integer indices"),
        ("a.png", GREY % 8, RGB[0], r"indices 0\.\.7 must be in 0\.\.6"),
        ("a.png", GREY.astype(int) - 300, RGB[0], "must be in"),
        ("a.png", GREY, RGB[0] / 255, r"palette .* dtype=float64 must be"),
        ("a.png", GREY, np.zeros((257, 3), np.uint8), "palette with 257 colors must have 1"),
        ("a.png", GREY, np.zeros((0, 3), np.uint8), "palette with 0 colors must have 1"),
    ],
)
def test_what_does_not_fit_is_refused_before_a_file_appears(
    tmp_path: Path, name: str, image: Any, palette: Any, reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        write_image(tmp_path / name, image, palette=palette)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("dither", [None, "floyd-steinberg"])
def test_an_indexed_png_is_smaller_than_pillow_makes_it(photograph: NDArray[Any], dither: str | None) -> None:
    for picture in (photograph, np.kron(photograph[:8, :8], np.ones((30, 30, 1), np.uint8))):
        pixels, palette = quantize(picture, 32, dither=dither).content
        assert palette is not None
        twin = Image.fromarray(np.asarray(pixels, np.uint8))
        twin.putpalette(palette.tobytes())
        buffer = BytesIO()
        twin.save(buffer, "PNG", optimize=True)
        assert len(encode_image(".png", pixels, palette=palette)) < buffer.tell()


@pytest.mark.parametrize("bands", [3, 4])
def test_optimizing_loses_nothing_but_bytes(tmp_path: Path, photograph: NDArray[Any], bands: int) -> None:
    pixels, palette = quantize(photograph, 64).content
    assert palette is not None
    palette = np.column_stack([palette, np.arange(192, 256)])[:, :bands].astype(np.uint8)
    write_image(tmp_path / "a.png", pixels, palette=palette, metadata=Metadata(dpi=(300, 300)))
    write_image(tmp_path / "b.png", pixels, palette=palette, metadata=Metadata(dpi=(300, 300)), optimize=True)
    np.testing.assert_array_equal(read_image(tmp_path / "b.png"), read_image(tmp_path / "a.png"))
    assert (tmp_path / "b.png").stat().st_size < (tmp_path / "a.png").stat().st_size
    assert read_metadata(tmp_path / "b.png").dpi == pytest.approx((300, 300), abs=0.1)


def test_optimizing_is_for_png_and_says_what_it_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match=r"optimize is only for \.png, not for \.tif"):
        write_image(tmp_path / "a.tif", RGB, optimize=True)
    monkeypatch.setitem(sys.modules, "oxipng", None)
    with pytest.raises(ModuleNotFoundError, match=r"optimize needs oxipng: pip install 'cvtimg\[oxipng\]'"):
        write_image(tmp_path / "a.png", RGB, optimize=True)
    assert list(tmp_path.iterdir()) == []


def test_more_than_256_colors_with_alpha_are_written_as_pixels(tmp_path: Path) -> None:
    picture = np.random.default_rng(8).integers(0, 256, (20, 30, 4), np.uint8)
    pixels, palette = quantize(picture, 300, alpha=True).content
    assert palette is None
    for suffix in (".png", ".tif", ".webp"):
        write_image(tmp_path / f"a{suffix}", pixels)
        np.testing.assert_array_equal(read_image(tmp_path / f"a{suffix}"), pixels)
    with pytest.raises(ValueError, match=r"\.gif cannot hold transparency; use one of \.png, \.tif"):
        write_image(tmp_path / "a.gif", pixels)


# --- writing: whole or not at all


def fail_midway(_self: Image.Image, file: Any, *_: Any, **__: Any) -> None:
    file.write(b"half")
    raise OSError("encoder error -2 when writing image file")


@pytest.mark.parametrize("old", [None, b"the old one"])
def test_a_failing_encoder_leaves_things_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, old: bytes | None
) -> None:
    path = tmp_path / "a.png"
    if old:
        path.write_bytes(old)
    monkeypatch.setattr(Image.Image, "save", fail_midway)
    with pytest.raises(OSError, match=r"a\.png: cannot be written \(encoder error -2"):
        write_image(path, RGB, overwrite=True)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == ([old] if old else [])


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_interrupted_block_leaves_nothing_and_keeps_its_error(tmp_path: Path, error: type[BaseException]) -> None:
    def write_half() -> None:
        with whole_file(tmp_path / "a.txt") as file:
            file.write(b"half")
            raise error

    with pytest.raises(error):
        write_half()
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_named_with_the_path(tmp_path: Path) -> None:
    with (
        pytest.raises(OSError, match=r"a\.txt: cannot be written \(no space left on device\)$"),
        whole_file(tmp_path / "a.txt"),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_an_error_about_another_file_is_left_alone(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"elsewhere'$"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "elsewhere").read_bytes()
    with pytest.raises(FileExistsError, match=tmp_path.name), whole_file(tmp_path / "a.txt"):
        tmp_path.mkdir()


def test_a_file_is_not_seen_before_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with whole_file(path) as file:
        file.write(b"some")
        file.flush()
        assert not path.exists()
    assert path.read_bytes() == b"some"
    assert list(tmp_path.iterdir()) == [path]


def test_an_existing_file_is_replaced_only_when_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.png"
    write_image(path, RGB)
    with monkeypatch.context() as patch:
        patch.setattr(Image.Image, "save", fail_midway)  # refused before the work, not after
        with pytest.raises(FileExistsError, match=r"a\.png: exists already; pass overwrite"):
            write_image(path, GREY)
    np.testing.assert_array_equal(read_image(path), RGB)
    write_image(path, GREY, overwrite=True)
    np.testing.assert_array_equal(read_image(path), GREY)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("links", [True, False], ids=["hard links", "no hard links"])
def test_a_file_that_appears_meanwhile_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    def unsupported(*_: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    if not links:
        monkeypatch.setattr(Path, "hardlink_to", unsupported)
    with whole_file(tmp_path / "new.txt") as file:
        file.write(b"mine")
    assert (tmp_path / "new.txt").read_bytes() == b"mine"
    with pytest.raises(FileExistsError, match="pass overwrite"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "a.txt").write_bytes(b"theirs")
    assert (tmp_path / "a.txt").read_bytes() == b"theirs"
    assert len(list(tmp_path.iterdir())) == 2


def test_an_output_that_is_a_folder_or_in_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(IsADirectoryError, match=r"folder\.png: is a directory, not a file"):
        write_image(tmp_path / "folder.png", RGB, overwrite=True)
    with pytest.raises(FileNotFoundError, match=r"a\.png: folder .*missing does not exist"):
        write_image(tmp_path / "missing" / "a.png", RGB)


@pytest.fixture
def umask() -> Iterator[None]:
    before = os.umask(0o027)
    yield
    os.umask(before)


@posix
@pytest.mark.usefixtures("umask")
def test_permissions_follow_the_umask_and_stay_when_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_image(path, RGB)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    path.chmod(0o604)
    write_image(path, GREY, overwrite=True)
    assert stat.S_IMODE(path.stat().st_mode) == 0o604


@posix
def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "store").mkdir()
    (tmp_path / "a.png").symlink_to("store/real.png")
    for image in (RGB, GREY):
        write_image(tmp_path / "a.png", image, overwrite=True)
        assert (tmp_path / "a.png").is_symlink()
        np.testing.assert_array_equal(read_image(tmp_path / "store" / "real.png"), image)


@posix
def test_a_device_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(OSError, match=r"pipe\.png: is not a regular file"):
        write_image(tmp_path / "pipe.png", RGB, overwrite=True)
    assert (tmp_path / "pipe.png").is_fifo()


@posix
@pytest.mark.skipif(os.name != "nt" and os.geteuid() == 0, reason="root may write anywhere")
def test_what_may_not_be_read_or_written_is_said_so(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", RGB)
    path.chmod(0o444)
    with pytest.raises(PermissionError, match=r"a\.png: is write-protected"):
        write_image(path, RGB, overwrite=True)
    path.chmod(0)
    with pytest.raises(PermissionError, match=r"a\.png: permission denied"):
        read_image(path)
    tmp_path.chmod(0o555)
    with pytest.raises(PermissionError, match=r"b\.png: cannot be written \(permission denied"):
        write_image(tmp_path / "b.png", RGB)
    tmp_path.chmod(0o755)


# --- finding


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b.PNG", "a.jpg", "notes.txt", "sub/c.tif", "sub/deep/d.webp", "table.h5"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    for name in (".hidden.png", ".cache/e.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "trap.png").mkdir()
    return tmp_path


def found(folder: Path, paths: Any) -> list[str]:
    return [path.relative_to(folder).as_posix() for path in find_images(paths)]


def test_a_folder_stands_for_the_pictures_below_it_in_order(folder: Path) -> None:
    assert found(folder, folder) == ["a.jpg", "b.PNG", "sub/c.tif", "sub/deep/d.webp"]


def test_a_file_given_by_name_is_kept_whatever_its_suffix_and_once(folder: Path) -> None:
    paths = [folder / "notes.txt", str(folder / "b.PNG"), folder / "notes.txt", folder / "sub"]
    assert found(folder, paths) == ["notes.txt", "b.PNG", "sub/c.tif", "sub/deep/d.webp"]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("*.jpg", ["a.jpg"]),
        ("[ab].*", ["a.jpg", "b.PNG"]),
        ("note?.txt", ["notes.txt"]),
        ("s*", ["sub/c.tif", "sub/deep/d.webp"]),
        ("**/*.webp", ["sub/deep/d.webp"]),
    ],
)
def test_a_pattern_stands_for_what_a_shell_would_find(folder: Path, pattern: str, expected: list[str]) -> None:
    assert found(folder, [folder / pattern]) == expected


def test_a_file_whose_name_looks_like_a_pattern_is_itself(folder: Path) -> None:
    (folder / "x[1].png").touch()
    assert found(folder, [folder / "x[1].png"]) == ["x[1].png"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [("none.png", "no such file"), ("*.gif", "no file matches"), ("trap.png", "no images in")],
)
def test_what_stands_for_nothing_is_named(folder: Path, name: str, reason: str) -> None:
    with pytest.raises(FileNotFoundError, match="^" + re.escape(f"{folder / name}: {reason}")):
        find_images([folder / name])
