"""Pictures beyond 8 bits, beyond four bands and beyond integers keep every sample, in and out."""

import json
import re
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import picture_files
import pytest
import tifffile
from images import DEEP as GREY
from images import DEEP_RGB as RGB
from images import DEEP_RGBA as RGBA
from numpy.typing import NDArray
from PIL import Image

from cvtimg._shared.types import Array
from cvtimg.cli.app import main
from cvtimg.pictures.files import image_info, read_image, write_image

RNG = np.random.default_rng(7)
FLOATS = RNG.normal(size=(5, 7, 6)).astype(np.float32)


# --- 16-bit color


def test_16_bit_grey_with_alpha_becomes_rgba(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(imagecodecs.png_encode(np.ascontiguousarray(RGBA[..., :2])))
    options: dict[str, Any] = {"photometric": "minisblack", "extrasamples": ["unassalpha"]}
    tifffile.imwrite(tmp_path / "a.tif", RGBA[..., :2], planarconfig="contig", **options)
    for name in ("a.png", "a.tif"):
        np.testing.assert_array_equal(read_image(tmp_path / name), RGBA[..., [0, 0, 0, 1]], strict=True)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40, 3), (40, 1, 4), (33, 65, 3)])
def test_deep_png_agrees_with_libpng(tmp_path: Path, shape: tuple[int, ...]) -> None:
    image = np.cumsum(RNG.integers(0, 900, shape), axis=1).astype(np.uint16)
    (tmp_path / "a.png").write_bytes(imagecodecs.png_encode(image, 6))
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), image, strict=True)
    write_image(tmp_path / "b.png", image)
    np.testing.assert_array_equal(imagecodecs.png_decode((tmp_path / "b.png").read_bytes()), image)


def test_the_transparent_color_of_a_deep_png_is_exact(tmp_path: Path) -> None:
    image = RGB.copy()
    image[0, 0], image[0, 1] = (1, 258, 3), (1, 259, 3)  # equal in their upper bytes
    (tmp_path / "a.png").write_bytes(deep_png(image, b"tRNS", struct.pack(">3H", 1, 258, 3)))
    read = read_image(tmp_path / "a.png")
    np.testing.assert_array_equal(read[..., :3], image)
    assert read[0, 0, 3] == 0
    assert (read[..., 3] == 65535).sum() == image[..., 0].size - 1


def test_premultiplied_alpha_is_divided_out(tmp_path: Path) -> None:
    alpha = RNG.integers(1, 65536, (5, 7, 1))
    stored = np.dstack([np.rint(RGB * (alpha / 65535)), alpha]).astype(np.uint16)
    tifffile.imwrite(tmp_path / "a.tif", stored, photometric="rgb", extrasamples=["assocalpha"])
    image = read_image(tmp_path / "a.tif")
    np.testing.assert_array_equal(image[..., 3:], alpha)
    assert (np.abs(image[..., :3].astype(float) - RGB) <= 0.5 + 0.5 * 65535 / alpha).all()


def test_12_bit_color_spans_the_range_of_16(tmp_path: Path) -> None:
    pytest.importorskip("imagecodecs", "2025.8", reason="older ones cannot write 12 bits")
    values = RNG.integers(0, 4096, (4, 8, 3)).astype(np.uint16)
    values[0, 0], values[0, 1] = 0, 4095
    tifffile.imwrite(tmp_path / "a.tif", values, photometric="rgb", bitspersample=12, compression=None)
    image = read_image(tmp_path / "a.tif")
    np.testing.assert_array_equal(image, np.rint(values * (65535 / 4095)))


# --- upright, in sRGB


def deep_png(image: NDArray[np.uint16], name: bytes, data: bytes, *, behind: bool = False) -> bytes:
    content = imagecodecs.png_encode(image)
    at = len(content) - 12 if behind else 33
    return content[:at] + picture_files.chunk(name, data) + content[at:]


@pytest.mark.parametrize("kind", ["before the pixels", "behind the pixels", "tiff"])
def test_exif_orientation_is_applied_at_16_bits(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a"
    if kind == "tiff":
        tifffile.imwrite(path, RGB, photometric="rgb", extratags=[(274, "H", 1, 6, True)])
    else:
        exif = Image.Exif()
        exif[0x0112] = 6
        path.write_bytes(deep_png(RGB, b"eXIf", exif.tobytes()[6:], behind=kind == "behind the pixels"))
    image = read_image(path)
    np.testing.assert_array_equal(image, np.rot90(RGB, -1))
    assert image.flags.c_contiguous
    if kind != "behind the pixels":
        assert (image_info(path).height, image_info(path).width) == (7, 5)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("image", [RGB, RGBA], ids=["rgb", "rgba"])
def test_a_profile_is_converted_at_16_bits(tmp_path: Path, suffix: str, image: Array) -> None:
    path = tmp_path / f"a{suffix}"
    write_with_profile(path, image, picture_files.rgb_profile(value=1.0))
    linear = image[..., :3] / 65535
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    got = read_image(path)
    assert got.dtype == np.uint16
    assert np.abs(got[..., :3] / 65535 - expected).max() < 0.002
    np.testing.assert_array_equal(got[..., 3:], image[..., 3:])
    assert len(np.unique(got[..., :3])) > 90  # of 105: more than 8 bits could tell apart in so dark a corner


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize(
    "icc", [picture_files.SRGB, b"rubbish", picture_files.grey_profile(1.0)], ids=["srgb", "rubbish", "grey"]
)
def test_an_srgb_profile_or_one_that_does_not_serve_changes_nothing(tmp_path: Path, suffix: str, icc: bytes) -> None:
    path = tmp_path / f"a{suffix}"
    write_with_profile(path, RGB, icc)
    np.testing.assert_array_equal(read_image(path), RGB)
    assert (image_info(path).icc == "sRGB built-in") is (icc == picture_files.SRGB)


def write_with_profile(path: Path, image: NDArray[np.uint16], icc: bytes) -> None:
    if path.suffix == ".png":
        import zlib

        path.write_bytes(deep_png(image, b"iCCP", b"x\0\0" + zlib.compress(icc)))
    else:
        extra = ["unassalpha"] if image.shape[2] == 4 else None
        tifffile.imwrite(path, image, photometric="rgb", extrasamples=extra, iccprofile=icc)


# --- many bands, floating point


@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("tile", [None, (16, 16)])
def test_bands_of_other_programs_are_read(tmp_path: Path, planar: str, tile: Any) -> None:
    stored = FLOATS if planar == "contig" else np.moveaxis(FLOATS, 2, 0)
    options: dict[str, Any] = {"photometric": "minisblack", "planarconfig": planar, "tile": tile}
    tifffile.imwrite(tmp_path / "a.tif", stored, **options)
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), FLOATS, strict=True)
    info = image_info(tmp_path / "a.tif")
    assert (info.height, info.width, info.format, info.mode, info.bits) == (5, 7, "TIFF", "float32", 32)
    assert (info.bands, info.has_alpha) == (("B1", "B2", "B3", "B4", "B5", "B6"), False)


@pytest.mark.parametrize("said", ["unspecified", "nothing"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_band_beside_rgb_is_alpha_only_where_the_file_says_so(tmp_path: Path, dtype: type, said: str) -> None:
    image = RGBA.astype(dtype)
    tifffile.imwrite(tmp_path / "a.tif", image, photometric="rgb", extrasamples=["unspecified"])
    if said == "nothing":
        content = (tmp_path / "a.tif").read_bytes()
        without = content.replace(struct.pack("<HH", 338, 3), struct.pack("<HH", 337, 3))  # what the fourth band means
        assert without != content
        (tmp_path / "a.tif").write_bytes(without)
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), image)
    info = image_info(tmp_path / "a.tif")
    assert (len(info.bands), info.has_alpha) == (4, False)
    tifffile.imwrite(tmp_path / "b.tif", image, photometric="rgb", extrasamples=["unassalpha"])
    assert image_info(tmp_path / "b.tif").has_alpha


@pytest.mark.parametrize("n_bands", [2, 4, 5])
@pytest.mark.parametrize("alpha", [False, True])
def test_a_tiff_says_of_its_last_band_whether_it_is_alpha(tmp_path: Path, n_bands: int, alpha: bool) -> None:
    image = RNG.integers(0, 65536, (5, 7, n_bands), np.uint16)
    write_image(tmp_path / "a.tif", image, alpha=alpha)
    assert image_info(tmp_path / "a.tif").has_alpha is (alpha and n_bands < 5)
    with tifffile.TiffFile(tmp_path / "a.tif") as tiff:
        extra = tiff.pages.first.tags.valueof(338)
        np.testing.assert_array_equal(tiff.asarray(), image)
    extra = extra if isinstance(extra, tuple) else (extra,)
    assert (2 in extra) is alpha
    if not alpha:
        np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), image)
        with pytest.raises(ValueError, match=r"\.png cannot hold .*bands that are not colors"):
            write_image(tmp_path / "a.png", image, alpha=False)


@pytest.mark.parametrize(
    ("stored", "expected"),
    [
        (GREY.astype(">u4"), GREY.astype(np.uint32)),
        (GREY > 9, (GREY > 9) * np.uint8(255)),
        (np.arange(6).reshape(2, 3).astype(np.float16), np.arange(6, dtype=np.float32).reshape(2, 3)),
        (FLOATS.astype(">f8"), FLOATS.astype(np.float64)),
        (np.asfortranarray(GREY), GREY),
    ],
)
def test_an_array_keeps_its_values_and_an_integer_type(tmp_path: Path, stored: Array, expected: Array) -> None:
    np.save(tmp_path / "a.npy", stored)
    image = read_image(tmp_path / "a.npy")
    np.testing.assert_array_equal(image, expected, strict=True)
    assert image.flags.c_contiguous
    assert image.flags.writeable


def test_a_graymap_of_12_bits_is_scaled_to_its_white(tmp_path: Path) -> None:
    (tmp_path / "a.pgm").write_bytes(b"P5 3 1 4095\n" + np.array([0, 2048, 4095], ">u2").tobytes())
    image, info = read_image(tmp_path / "a.pgm"), image_info(tmp_path / "a.pgm")
    np.testing.assert_array_equal(image, np.array([[0, 32776, 65535]], np.uint16), strict=True)
    assert info.bits == 16


# --- where on Earth


def geotiff(path: Path, extra: list[tuple[Any, ...]], image: Array = FLOATS) -> Path:
    tifffile.imwrite(path, image, photometric="minisblack", planarconfig="contig", extratags=extra)
    return path


SCALE = (33550, "d", 3, (10.0, 20.0, 0.0), True)
TIE = (33922, "d", 6, (2.0, 1.0, 0.0, 500000.0, 4600000.0, 0.0), True)
AREA = (34735, "H", 12, (1, 1, 0, 2, 1025, 0, 1, 1, 3072, 0, 1, 32633), True)
POINT = (34735, "H", 12, (1, 1, 0, 2, 1025, 0, 1, 2, 2048, 0, 1, 4326), True)
MATRIX = (34264, "d", 16, (0.0, 3.0, 0.0, 7.0, -2.0, 0.0, 0.0, 8.0, *[0.0] * 7, 1.0), True)


@pytest.mark.parametrize(
    ("extra", "transform", "epsg"),
    [
        ([SCALE, TIE, AREA], (10, 0, 499980, 0, -20, 4600020), 32633),
        ([SCALE, TIE, POINT], (10, 0, 499975, 0, -20, 4600030), 4326),
        ([MATRIX, AREA], (0, 3, 7, -2, 0, 8), 32633),
        ([SCALE], None, None),
        ([], None, None),
        ([(33550, "d", 1, (10.0,), True), TIE], None, None),
    ],
    ids=["area", "point", "matrix", "no tie", "none", "damaged"],
)
def test_a_geotiff_tells_where_its_pixels_lie(tmp_path: Path, extra: Any, transform: Any, epsg: Any) -> None:
    info = image_info(geotiff(tmp_path / "a.tif", extra))
    assert info.geo_transform == transform
    assert info.epsg == epsg
    small = image_info(geotiff(tmp_path / "b.tif", extra, (FLOATS[..., 0] > 0).astype(np.uint8)))  # read by Pillow
    assert (small.mode, small.geo_transform, small.epsg) == ("L", transform, epsg)


@pytest.mark.parametrize(("text", "value"), [("-9999", -9999.0), ("nan ", float("nan")), ("1e-3", 1e-3), ("-", None)])
def test_a_geotiff_tells_which_value_is_no_data(tmp_path: Path, text: str, value: float | None) -> None:
    info = image_info(geotiff(tmp_path / "a.tif", [(42113, "s", 0, text, True)]))
    assert info.nodata == pytest.approx(value, nan_ok=True)


def test_info_counts_the_colors_of_pixels_that_are_known(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image = np.zeros((5, 7, 6), np.float32)
    image[0, 0], image[1, 1, 2] = 1, np.nan
    geotiff(tmp_path / "a.tif", [SCALE, TIE, AREA, (42113, "s", 0, "nan", True)], image)
    np.save(tmp_path / "b.npy", np.full((2, 2), np.nan))
    assert main(["info", str(tmp_path / "a.tif"), str(tmp_path / "b.npy"), "--json"]) == 0
    tiff, npy = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert (tiff["distinct_colors"], tiff["nodata"], tiff["epsg"]) == (2, "nan", 32633)
    assert (npy["distinct_colors"], npy["format"], npy["bands"]) == (0, "NPY", ["B1"])
    assert main(["info", str(tmp_path / "a.tif")]) == 0
    assert "B1..B6" in capsys.readouterr().out


# --- files that cannot be read


def deep_files(folder: Path) -> list[Path]:
    """Return one file for each way of reading, with pixels enough to be cut anywhere."""
    image = RNG.integers(0, 65536, (60, 50, 3), np.uint16)
    write_image(folder / "a.png", image)
    write_image(folder / "a.tif", image)
    write_image(folder / "a.npy", image)
    tifffile.imwrite(folder / "plain.tif", image.astype(np.float32), photometric="rgb")
    options: dict[str, Any] = {"photometric": "minisblack", "planarconfig": "contig"}
    tifffile.imwrite(folder / "tiles.tif", np.dstack([image] * 2), tile=(16, 16), compression="lzw", **options)
    for suffix in ("jpg", "png", "tif", "bmp"):
        picture_files.save(folder / f"8.{suffix}", (image >> 8).astype(np.uint8))
    return sorted(folder.iterdir())


@pytest.mark.parametrize("fraction", [0.002, 0.02, 0.3, 0.6, 0.9, 0.99])
def test_a_truncated_file_is_named_with_the_reason(
    tmp_path: Path, fraction: float, capfd: pytest.CaptureFixture[str]
) -> None:
    reason = r"is [^\n]+" if fraction > 0.1 else r"(is|cannot be read:) [^\n]+"  # few bytes may be of any format
    for path in deep_files(tmp_path):
        path.write_bytes(path.read_bytes()[: int(path.stat().st_size * fraction)])
        with pytest.raises(OSError, match=f"^{re.escape(str(path))}: {reason}$") as caught:
            read_image(path)
        assert caught.value.__cause__ is not None
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("stored", "reason"),
    [
        (np.zeros(3), r"holds an array of shape \(3,\); an image must be \(H, W\) or \(H, W, C\)"),
        (np.zeros((2, 0)), r"holds an array of shape \(2, 0\)"),
        (np.zeros((2, 2, 2, 2)), r"holds an array of shape \(2, 2, 2, 2\)"),
        (np.zeros((2, 2), complex), "has samples of type complex128"),
        (np.array([["a"]]), "has samples of type <U1"),
        (np.array([[{}]], object), r"is truncated or damaged \(Object arrays cannot be loaded"),
    ],
)
def test_an_array_that_is_no_picture_is_named_with_the_reason(tmp_path: Path, stored: Array, reason: str) -> None:
    np.save(tmp_path / "a.npy", stored)
    with pytest.raises(OSError, match=rf"a\.npy: {reason}"):
        read_image(tmp_path / "a.npy")


@pytest.mark.parametrize("n_bands", [3, 6])
def test_what_pillow_refuses_for_its_size_is_refused_at_every_depth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, n_bands: int
) -> None:
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 10)
    for name in ("a.tif", "a.npy"):
        write_image(tmp_path / name, FLOATS[..., :n_bands])
        with pytest.raises(OSError, match=r": has over 20 pixels, the limit for safety"):
            read_image(tmp_path / name)


def test_8_bit_pictures_are_read_without_the_libraries_for_deep_ones(tmp_path: Path) -> None:
    for suffix in (".png", ".tif", ".jpg"):
        write_image(tmp_path / f"a{suffix}", RGB.astype(np.uint8))
    script = (
        "import sys; from cvtimg import read_image; [read_image(path) for path in sys.argv[1:]];"
        "assert not {'tifffile', 'imagecodecs'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-P", "-c", script, *tmp_path.iterdir()], check=True)
