"""Each kind of pixel becomes a gray, RGB or RGBA array with its values, upright."""

import struct
from pathlib import Path

import numpy as np
import PIL
import pytest
from images import BITS, DEEP, GREY, RGB, RGBA
from picture_files import png, save
from PIL import Image

from cvtimg._shared.pixels import says_alpha
from cvtimg._shared.types import Array, Bytes
from cvtimg.pictures import read_frames, read_pages
from cvtimg.pictures.files import image_info, read_image


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
        ("int.tif", DEEP.astype(np.int32) - 70000, DEEP.astype(np.int32) - 70000),
    ],
)
def test_each_kind_of_pixel_keeps_its_values(tmp_path: Path, name: str, stored: Array, expected: Array) -> None:
    image = read_image(save(tmp_path / name, stored))
    assert image.dtype == expected.dtype
    assert image.flags.c_contiguous
    assert image.flags.writeable
    np.testing.assert_array_equal(image, expected)


def test_grey_with_alpha_becomes_rgba(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", Image.fromarray(RGBA).convert("LA"))
    grey = np.asarray(Image.fromarray(RGBA).convert("L"))
    np.testing.assert_array_equal(read_image(path), np.dstack([grey, grey, grey, RGBA[..., 3]]))


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
    assert image_info(tmp_path / "a.png").has_alpha


@pytest.mark.parametrize(
    ("mode", "pixel", "expected"),
    [
        ("CMYK", (255, 0, 0, 0), (0, 255, 255)),  # which Adobe inverts in a JPEG
        ("CMYK", (0, 0, 0, 255), (0, 0, 0)),
        pytest.param(
            *("YCbCr", (76, 85, 255), (255, 0, 0)),
            marks=pytest.mark.skipif(PIL.__version__ < "12", reason="Pillow 11 cannot read what it writes"),
        ),
        ("LAB", (138, 209, 198), (255, 0, 0)),
    ],
)
def test_other_color_spaces_become_rgb(
    tmp_path: Path, mode: str, pixel: tuple[int, ...], expected: tuple[int, ...]
) -> None:
    stored = Image.new(mode, (8, 4), pixel)
    for path in [tmp_path / "a.tif", *([tmp_path / "a.jpg"] if mode == "CMYK" else [])]:
        image = read_image(save(path, stored, **({"quality": 100} if path.suffix == ".jpg" else {})))
        assert image.shape == (4, 8, 3)
        assert np.abs(image.astype(int) - expected).max() <= 6


def test_the_first_frame_of_an_animation_is_read(tmp_path: Path) -> None:
    pages = [Image.fromarray(RGB), Image.fromarray(255 - RGB)]
    path = save(tmp_path / "a.png", pages[0], save_all=True, append_images=pages[1:])
    np.testing.assert_array_equal(read_image(path), RGB)
    assert image_info(path).frames == 2


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
def test_exif_orientation_is_applied(tmp_path: Path, name: str, orientation: int, stored: Bytes) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    options = {"lossless": True} if name == "a.webp" else {}
    path = save(tmp_path / name, np.ascontiguousarray(stored), exif=exif, **options)
    np.testing.assert_array_equal(read_image(path), RGB)
    assert (image_info(path).height, image_info(path).width) == RGB.shape[:2]


def test_a_texture_whose_file_pillow_closes_is_read(tmp_path: Path) -> None:
    block = struct.pack("<HHI", 0xFFFF, 0, 0)  # DXT1: 4 x 4 pixels of white
    header = b"FTEX" + struct.pack("<iiiii", 0, 4, 4, 1, 1) + struct.pack("<ii", 0, 32)
    (tmp_path / "a.ftc").write_bytes(header.ljust(32, b"\0") + struct.pack("<i", len(block)) + block)
    image = read_image(tmp_path / "a.ftc")
    assert image.shape == (4, 4, 4)
    assert (image == 255).all()
    assert says_alpha(image)
    assert (
        read_frames(tmp_path / "a.ftc").images[0].shape == read_pages(tmp_path / "a.ftc").images[0].shape == (4, 4, 4)
    )
