"""Images come from paths, bytes and streams; FITS and AVIF are read as what they hold; profiles can be kept."""

import os
import threading
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from images import DEEP_RGB as DEEP
from images import RGB
from picture_files import rgb_profile, save
from PIL import Image

from cvtimg import read_image, write_image
from cvtimg._shared.types import Array
from cvtimg.cli.app import main
from cvtimg.pictures import encode_image, image_info, read_frames, read_indices, read_metadata, read_pages, write_pages

RNG = np.random.default_rng(6)


class Stream(BytesIO):
    """A pipe, which can be read once and from the start alone."""

    def seekable(self) -> bool:
        return False

    def seek(self, *_: Any) -> int:
        raise OSError("not seekable")


@pytest.mark.parametrize("suffix", [".png", ".tif", ".webp", ".npy"])
@pytest.mark.parametrize("image", [RGB, DEEP], ids=["8 bits", "16 bits"])
def test_bytes_and_streams_are_read_like_files(tmp_path: Path, suffix: str, image: Array) -> None:
    if suffix == ".webp" and image is DEEP:
        pytest.skip("holds 8 bits")
    content = encode_image(suffix, image)
    for source in (content, bytearray(content), memoryview(content), BytesIO(content), Stream(content)):
        np.testing.assert_array_equal(read_image(source), image, strict=True)
    assert image_info(content).width == 7
    (tmp_path / "a").write_bytes(content)
    with (tmp_path / "a").open("rb") as file:
        np.testing.assert_array_equal(read_image(file), image)
        assert not file.closed


@pytest.mark.skipif(os.name == "nt", reason="POSIX pipes")
def test_a_named_pipe_is_read_to_its_end(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    content = encode_image(".tif", DEEP)
    writer = threading.Thread(target=(tmp_path / "pipe").write_bytes, args=[content])
    writer.start()
    np.testing.assert_array_equal(read_image(tmp_path / "pipe"), DEEP)
    writer.join()


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        (b"", "bytes: is empty"),
        (b"some text", "bytes: cannot be read: unknown image format"),
        (encode_image(".png", RGB)[:60], r"bytes: is truncated or damaged \("),
        (Stream(b"some text"), "stream: cannot be read: unknown image format"),
    ],
)
def test_bytes_that_are_no_image_are_named_with_the_reason(source: Any, reason: str) -> None:
    with pytest.raises(OSError, match=f"^{reason}"):
        read_image(source)


def test_a_page_can_be_read_alone(tmp_path: Path) -> None:
    pages = np.arange(3 * 5 * 7, dtype=np.uint16).reshape(3, 5, 7)
    write_pages(tmp_path / "a.tif", pages)
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif", page=3), pages[2])
    with pytest.raises(OSError, match="has 3 pages, and no page 4"):
        read_image(tmp_path / "a.tif", page=4)
    with pytest.raises(ValueError, match="page=0 must be an integer >= 1"):
        read_image(tmp_path / "a.tif", page=0)
    write_image(tmp_path / "b.png", pages[0])
    np.testing.assert_array_equal(read_image(tmp_path / "b.png", page=1), pages[0])


def test_bands_of_an_array_lie_along_a_given_axis_or_surely_the_last(tmp_path: Path) -> None:
    planes = np.arange(2 * 9 * 8, dtype=np.uint8).reshape(2, 9, 8)
    np.save(tmp_path / "a.npy", planes)
    for axis in (0, -3):
        np.testing.assert_array_equal(read_image(tmp_path / "a.npy", channel_axis=axis), planes.transpose(1, 2, 0))
    assert read_image(tmp_path / "a.npy", channel_axis=2).shape == (2, 9, 8)
    with pytest.raises(OSError, match=r"shape \(2, 9, 8\), whose bands could lie along the first or the last axis"):
        read_image(tmp_path / "a.npy")
    for shape in ((9, 8, 7), (6, 9, 224), (1, 9, 4), (9, 8)):
        np.save(tmp_path / "b.npy", np.zeros(shape))
        assert read_image(tmp_path / "b.npy").shape == shape


@pytest.mark.parametrize(("dtype", "zero"), [(np.int16, 0), (np.uint16, 32768), (np.float32, 0), (np.uint8, 0)])
def test_fits_is_read_with_its_zero_point_its_sign_and_upright(tmp_path: Path, dtype: type, zero: int) -> None:
    fits = pytest.importorskip("astropy.io.fits")
    values = RNG.integers(0, 200, (5, 7)).astype(dtype)
    values[0, 0] = -90 if dtype is np.int16 else values[0, 0]
    unit = fits.PrimaryHDU(values)
    assert unit.header.get("BZERO", 0) == zero  # as FITS stores unsigned integers
    unit.writeto(tmp_path / "a.fits")
    image = read_image(tmp_path / "a.fits")
    np.testing.assert_array_equal(image, values[::-1])  # the first row of FITS is the lowest
    info = image_info(tmp_path / "a.fits")
    assert (info.width, info.height, info.format) == (7, 5, "TIFF")


def test_a_fits_cube_is_not_taken_for_one_image(tmp_path: Path) -> None:
    fits = pytest.importorskip("astropy.io.fits")
    fits.PrimaryHDU(np.zeros((3, 5, 7), np.int16)).writeto(tmp_path / "a.fits")
    with pytest.raises(OSError, match="has 3 pages, where one image is expected"):
        read_image(tmp_path / "a.fits")
    planes = np.arange(105, dtype=np.int16).reshape(3, 5, 7)
    fits.PrimaryHDU(planes).writeto(tmp_path / "b.fits")
    np.testing.assert_array_equal(read_image(tmp_path / "b.fits", page=2), planes[1, ::-1])
    np.testing.assert_array_equal(read_pages(tmp_path / "b.fits").images, planes[:, ::-1])


@pytest.mark.parametrize("deep", [False, True], ids=["8 bits", "16 bits"])
def test_keep_metadata_keeps_a_wide_profile_and_its_colors(tmp_path: Path, deep: bool) -> None:
    wide = rgb_profile("gbr")  # as far from sRGB as can be
    if deep:
        from cvtimg.pictures import Metadata

        write_image(tmp_path / "a.png", DEEP, metadata=Metadata(icc=wide))
    else:
        save(tmp_path / "a.png", RGB, icc_profile=wide)
    stored = DEEP if deep else RGB
    assert np.abs(read_image(tmp_path / "a.png").astype(int) - stored).max() > 50
    np.testing.assert_array_equal(read_image(tmp_path / "a.png", keep_profile=True), stored)
    assert read_metadata(tmp_path / "a.png", keep_profile=True).icc == wide
    command = ["quantize", str(tmp_path / "a.png"), "-k", "64", "-o", str(tmp_path / "b.png"), "--keep-metadata"]
    assert main([*command, "--quiet"]) == 0
    np.testing.assert_array_equal(read_image(tmp_path / "b.png", keep_profile=True), stored)  # of few colors
    with Image.open(tmp_path / "b.png") as image:
        assert image.info["icc_profile"] == wide


@pytest.mark.parametrize("read", [read_image, image_info, read_metadata, read_indices, read_frames, read_pages])
def test_an_array_is_no_source(read: Callable[[Any], Any]) -> None:
    with pytest.raises(TypeError, match="source of type ndarray must be a path, bytes or a binary file"):
        read(np.zeros((2, 3), np.uint8))
