"""Images come back as they were written, or the suffix is refused with the reason."""

import struct
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from images import BITS, DEEP, DEEP_RGBA, GREY, RGB, RGBA
from PIL import Image

from cvtimg import quantize
from cvtimg._shared.records import UnprovenError
from cvtimg._shared.types import Array, Bytes, Ints64
from cvtimg.pictures.files import Metadata, encode_image, image_info, read_image, read_metadata, write_image


@pytest.mark.parametrize(("name", "image"), [("a.TIFF", RGB), ("a.PGM", DEEP), ("a.PNG", RGBA)])
def test_a_suffix_may_be_in_capitals(tmp_path: Path, name: str, image: Array) -> None:
    write_image(tmp_path / name, image)
    np.testing.assert_array_equal(read_image(tmp_path / name), image, strict=True)


def test_views_are_written_as_they_look_and_bool_as_one_bit(tmp_path: Path) -> None:
    for number, view in enumerate([RGB[::-1, ::2], GREY.T, BITS.T, DEEP[:, ::-1], RGBA[..., :3]]):
        write_image(tmp_path / f"{number}.png", view)
        expected = view * np.uint8(255) if view.dtype == bool else view
        np.testing.assert_array_equal(read_image(tmp_path / f"{number}.png"), expected)
        assert (image_info(tmp_path / f"{number}.png").bits == 1) is (view.dtype == bool)


@pytest.mark.parametrize(("suffix", "image"), [(".webp", BITS), (".pgm", BITS), (".webp", GREY), (".ppm", GREY)])
def test_a_format_without_grey_or_bits_gets_a_wider_kind(tmp_path: Path, suffix: str, image: Array) -> None:
    write_image(tmp_path / f"a{suffix}", image)
    written = read_image(tmp_path / f"a{suffix}")
    grey = image * np.uint8(255) if image.dtype == bool else image
    np.testing.assert_array_equal(written, grey if suffix == ".pgm" else np.dstack([grey] * 3))


@pytest.mark.parametrize(("suffix", "error"), [(".jpg", 4), (".jpeg", 4), (".avif", 12)])
def test_jpeg_and_avif_are_near(tmp_path: Path, suffix: str, error: int) -> None:
    if suffix == ".avif":
        pytest.importorskip("PIL._avif")
    smooth = np.add.outer(np.arange(64), np.arange(64)).astype(np.uint8)
    write_image(tmp_path / f"a{suffix}", np.dstack([smooth, smooth // 2, smooth]))
    image = read_image(tmp_path / f"a{suffix}").astype(int)
    assert np.abs(image - np.dstack([smooth, smooth // 2, smooth])).max() <= error


def indexed(k: int, bands: int = 3) -> tuple[Ints64, Bytes]:
    codes = np.random.default_rng(k).choice(256**3, k, replace=False)
    palette = np.stack([codes % 256, codes // 256 % 256, codes // 65536, codes % 254], 1)
    indices = np.random.default_rng(k).integers(0, k, (13, 21))
    indices.flat[:k] = np.arange(min(k, indices.size))
    return indices, palette[:, :bands].astype(np.uint8)


@pytest.mark.parametrize(("k", "bits"), [(1, 1), (2, 1), (3, 2), (4, 2), (5, 4), (16, 4), (17, 8), (255, 8), (256, 8)])
def test_an_indexed_png_has_the_smallest_bit_depth_and_keeps_the_indices(tmp_path: Path, k: int, bits: int) -> None:
    indices, palette = indexed(k, 3 + k % 2)
    write_image(tmp_path / "a.png", indices, palette=palette)
    file = (tmp_path / "a.png").read_bytes()
    assert (file[24], file[25]) == (bits, 3)
    assert struct.unpack(">I", file[(at := file.index(b"PLTE")) - 4 : at]) == (3 * k,)
    with Image.open(tmp_path / "a.png") as image:
        np.testing.assert_array_equal(np.asarray(image), indices)


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


@pytest.mark.parametrize(
    ("name", "image", "palette", "reason"),
    [
        ("a.xyz", RGB, None, r"suffix='\.xyz' must be one of \.png"),
        ("a", RGB, None, "suffix='' must be one of"),
        ("a.jpg", GREY % 2, RGB[0], r"\.jpg would lose the colors .* \.png, \.tif"),
        ("a.avif", GREY % 2, RGB[0], r"\.avif would lose the colors of the palette"),
        ("a.jpg", RGBA, None, r"\.jpg cannot hold transparency; use one of \.png, \.tif"),
        ("a.bmp", DEEP, None, r"\.bmp cannot hold 16-bit gray images"),
        ("a.gif", RGB, None, r"\.gif cannot hold RGB images"),
        ("a.png", RGB.astype(float), None, r"\.png cannot hold floating point .* use one of \.tif, \.tiff, \.npy"),
        ("a.png", RGB[..., :2], None, r"\.png cannot hold .*bands that are not colors"),
        ("a.bmp", DEEP_RGBA, None, r"\.bmp cannot hold 16-bit RGBA images; use one of \.png, \.tif, \.tiff, \.npy"),
        ("a.tif", RGB.astype(complex), None, r"shape \(5, 7, 3\) and type complex128 must be"),
        ("a.npy", RGB[0, 0], None, r"shape \(3,\) and type uint8 must be"),
        ("a.png", RGB[:0], None, "have pixels"),
        ("a.png", GREY[:, :0], RGB[0], "have pixels"),
        ("a.png", RGB, RGB[0], "integer indices"),
        ("a.png", BITS, RGB[0], "integer indices"),
        ("a.png", GREY % 8, RGB[0], r"indices in 0\.\.7 must be in 0\.\.6"),
        ("a.png", GREY.astype(int) - 300, RGB[0], "must be in"),
        ("a.png", GREY, RGB[0] / 255, r"palette .* type float64 must be"),
        ("a.png", GREY, np.zeros((257, 3), np.uint8), r"palette of shape \(257, 3\)"),
        ("a.png", GREY, np.zeros((0, 3), np.uint8), r"palette of shape \(0, 3\)"),
    ],
)
def test_what_does_not_fit_is_refused_before_a_file_appears(
    tmp_path: Path, name: str, image: Any, palette: Any, reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        write_image(tmp_path / name, image, palette=palette)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("dither", [None, "floyd-steinberg"])
def test_an_indexed_png_is_smaller_than_pillow_makes_it(photograph: Array, dither: str | None) -> None:
    for picture in (photograph, np.kron(photograph[:8, :8], np.ones((30, 30, 1), np.uint8))):
        pixels, palette = quantize(picture, 32, dither=dither).content
        assert palette is not None
        twin = Image.fromarray(np.asarray(pixels, np.uint8))
        twin.putpalette(palette.tobytes())
        buffer = BytesIO()
        twin.save(buffer, "PNG", optimize=True)
        assert len(encode_image(".png", pixels, palette=palette)) < buffer.tell()


@pytest.mark.parametrize("bands", [pytest.param(3, marks=pytest.mark.slow), 4])
def test_optimizing_loses_nothing_but_bytes(tmp_path: Path, photograph: Array, bands: int) -> None:
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


@pytest.mark.parametrize("alpha", [None, 128])
@pytest.mark.parametrize("colored", [False, True])
def test_the_smallest_form_has_the_same_colors_in_fewer_bytes(alpha: int | None, colored: bool) -> None:
    levels = np.arange(256, dtype=np.uint8)
    palette = np.stack([levels, levels[::-1] if colored else levels, levels], axis=1)
    if alpha is not None:
        palette = np.append(palette, np.clip(alpha + levels[:, None] // 4, 0, 254), axis=1).astype(np.uint8)
    indices = np.tile(levels, (64, 1)) // np.uint8(2) + np.arange(64, dtype=np.uint8)[:, None]
    files = [encode_image(".png", indices, palette=palette, smallest=smallest) for smallest in (False, True)]
    assert len(files[1]) < 0.6 * len(files[0])
    shown = [np.asarray(Image.open(BytesIO(file)).convert("RGBA")) for file in files]
    np.testing.assert_array_equal(*shown)


@pytest.mark.parametrize("n_opaque", [0, 1, 3])
def test_an_alpha_of_10_at_the_end_is_read_by_pillow(n_opaque: int) -> None:
    palette = np.zeros((2 + n_opaque, 4), np.uint8)
    palette[:, 0], palette[:, 3] = np.arange(len(palette)), [0, 10, *[255] * n_opaque]
    file = encode_image(".png", np.arange(len(palette))[None], palette=palette)
    assert np.asarray(Image.open(BytesIO(file)).convert("RGBA"))[0].tolist() == palette.tolist()


def test_a_file_without_the_pixels_that_were_written_is_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = encode_image(".png", np.ones((2, 3), np.uint8))
    monkeypatch.setattr("cvtimg.pictures.formats.encoding._write", lambda file, *_: file.write(wrong))
    with pytest.raises(UnprovenError, match="what is read is what was written"):
        write_image(tmp_path / "a.png", np.zeros((2, 3), np.uint8))
    assert not (tmp_path / "a.png").exists()
