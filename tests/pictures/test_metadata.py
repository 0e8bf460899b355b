"""What is kept of a file beside its pixels is true of the picture that is written, which looks as it did."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import picture_files
import pytest
import tifffile
from PIL import Image, ImageCms

from cvtimg import quantize, read_image, write_image
from cvtimg._shared.types import Array
from cvtimg.pictures import PixelSize, image_info, read_metadata
from cvtimg.pictures.files import Metadata, encode_image

RNG = np.random.default_rng(9)
RGB = RNG.integers(0, 256, (6, 9, 3), np.uint8)
GREY = RNG.integers(0, 256, (6, 9), np.uint8)
DEEP = RNG.integers(0, 65536, (6, 9, 3), np.uint16)
GEO: list[tuple[Any, ...]] = [
    (33550, "d", 3, (10.0, 20.0, 0.0), True),
    (33922, "d", 6, (0.0, 0.0, 0.0, 500000.0, 4600000.0, 0.0), True),
    (34735, "H", 12, (1, 1, 0, 2, 1025, 0, 1, 1, 3072, 0, 1, 32633), True),
    (34736, "d", 1, (1.5,), True),
    (34737, "s", 0, "somewhere|", True),
]
OTHER = picture_files.rgb_profile("gbr")


def exif_bytes() -> bytes:
    exif = Image.Exif()
    exif[0x0112] = 6
    exif[0x010E] = "a still life"
    exif[0x8298] = "(c) somebody"
    exif[0x8769] = {0x9003: "2024:05:06 07:08:09", 0xA002: 9, 0xA003: 6}
    exif[0x8825] = {1: "N", 2: (1.0, 2.0, 3.0)}
    return exif.tobytes()


@pytest.mark.parametrize("source", ["png", "jpg", "tif", "webp"])
@pytest.mark.parametrize("target", ["png", "jpg", "tif", "webp"])
def test_exif_and_pixels_an_inch_are_kept_as_they_are_true_upright(tmp_path: Path, source: str, target: str) -> None:
    dpi: dict[str, Any] = {} if source == "webp" else {"dpi": (300, 150)}
    picture_files.save(tmp_path / f"a.{source}", RGB, exif=exif_bytes(), **dpi)
    write_image(tmp_path / f"b.{target}", RGB, metadata=read_metadata(tmp_path / f"a.{source}"))
    with Image.open(tmp_path / f"b.{target}") as image:
        exif = image.getexif()
        assert (exif[0x010E], exif[0x8298]) == ("a still life", "(c) somebody")
        assert exif.get(0x0112, 1) == 1
        assert image.size == (9, 6)
        if "webp" not in (source, target):
            assert image.info["dpi"] == pytest.approx((150, 300), abs=0.1)
        if "tif" not in (source, target):  # Pillow writes no other part into a TIFF
            part = exif.get_ifd(0x8769)
            assert part[0x9003] == "2024:05:06 07:08:09"
            assert not {0xA002, 0xA003} & set(part)
            assert exif.get_ifd(0x8825)[1] == "N"


@pytest.mark.parametrize("suffix", [".png", ".tif", ".webp"])
def test_a_converted_picture_carries_srgb_and_looks_as_it_did(tmp_path: Path, suffix: str) -> None:
    path, out = picture_files.save(tmp_path / "a.png", RGB, icc_profile=OTHER), tmp_path / f"b{suffix}"
    write_image(out, read_image(path), metadata=read_metadata(path))
    with Image.open(out) as image:
        profile = ImageCms.ImageCmsProfile(BytesIO(image.info["icc_profile"]))
        assert ImageCms.getProfileDescription(profile).strip() == "sRGB built-in"
    np.testing.assert_array_equal(read_image(out), read_image(path))


@pytest.mark.parametrize(
    "icc", [picture_files.SRGB, b"rubbish", picture_files.grey_profile(1.0), picture_files.cmyk_profile()]
)
def test_an_srgb_profile_is_kept_as_it_is_and_one_that_reading_ignores_is_not(tmp_path: Path, icc: bytes) -> None:
    kept = read_metadata(picture_files.save(tmp_path / "a.png", RGB, icc_profile=icc)).icc
    assert kept == (icc if icc == picture_files.SRGB else None)


def test_grey_carries_no_profile_of_color(tmp_path: Path) -> None:
    path = picture_files.save(tmp_path / "a.png", GREY, icc_profile=picture_files.grey_profile(1.0))
    picture, metadata = read_image(path), read_metadata(path)
    write_image(tmp_path / "grey.png", picture, metadata=metadata)
    with Image.open(tmp_path / "grey.png") as image:
        assert "icc_profile" not in image.info
    result = quantize(picture, 4)
    write_image(tmp_path / "few.png", *result.content[:1], palette=result.content[1], metadata=metadata)
    with Image.open(tmp_path / "few.png") as image:
        assert "icc_profile" in image.info
    np.testing.assert_array_equal(read_image(tmp_path / "few.png")[..., 0], result.image)


def test_deep_grey_keeps_the_profile_that_its_values_have(tmp_path: Path) -> None:
    icc = picture_files.grey_profile(1.0)
    path = picture_files.save(tmp_path / "a.png", DEEP[..., 0], icc_profile=icc)
    write_image(tmp_path / "b.png", read_image(path), metadata=read_metadata(path))
    with Image.open(tmp_path / "b.png") as image:
        assert image.info["icc_profile"] == icc
    np.testing.assert_array_equal(read_image(tmp_path / "b.png"), DEEP[..., 0])


def test_16_bit_color_carries_its_metadata(tmp_path: Path) -> None:
    metadata = Metadata(icc=picture_files.SRGB, dpi=(300.0, 150.0), exif=exif_bytes())
    write_image(tmp_path / "a.png", DEEP, metadata=metadata)
    write_image(tmp_path / "a.tif", DEEP, metadata=metadata)
    with Image.open(tmp_path / "a.png") as image:
        image.load()
        assert image.info["icc_profile"] == picture_files.SRGB
        assert image.info["dpi"] == pytest.approx((300, 150), abs=0.1)
        assert image.getexif()[0x010E] == "a still life"
    with tifffile.TiffFile(tmp_path / "a.tif") as tiff:
        assert tiff.pages.first.iccprofile == picture_files.SRGB
        assert tiff.pages.first.get_resolution("inch") == pytest.approx((300, 150))
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), DEEP)
    assert read_metadata(tmp_path / "a.tif").dpi == (300, 150)


@pytest.mark.parametrize("suffix", [".gif", ".ppm", ".npy", ".bmp"])
def test_a_format_without_room_is_written_without_and_a_bitmap_with_pixels_an_inch(tmp_path: Path, suffix: str) -> None:
    metadata = Metadata(icc=picture_files.SRGB, dpi=(300.0, 150.0), exif=exif_bytes())
    palette = RGB.reshape(-1, 3)
    write_image(tmp_path / f"a{suffix}", np.arange(54).reshape(6, 9), palette=palette, metadata=metadata)
    np.testing.assert_array_equal(read_image(tmp_path / f"a{suffix}"), RGB)
    if suffix == ".bmp":
        assert read_metadata(tmp_path / "a.bmp").dpi == pytest.approx((300, 150), abs=0.1)


def test_the_same_metadata_gives_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = picture_files.save(tmp_path / "a.png", RGB, icc_profile=OTHER, exif=exif_bytes(), dpi=(72, 72))
    first = encode_image(".png", RGB, metadata=read_metadata(path))
    create: Any = ImageCms.createProfile
    later = bytearray(ImageCms.ImageCmsProfile(create("sRGB")).tobytes())
    later[24:36] = bytes(range(12))  # littleCMS writes the time of day there
    monkeypatch.setattr(ImageCms, "createProfile", lambda _: ImageCms.ImageCmsProfile(BytesIO(bytes(later))).profile)
    assert encode_image(".png", RGB, metadata=read_metadata(path)) == first


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif"])
def test_damaged_exif_and_senseless_density_are_left_out(tmp_path: Path, suffix: str) -> None:
    exif = b"Exif\0\0MM\0*\xff\xff\xff\xff garbage"
    options: dict[str, Any] = {} if suffix == ".tif" else {"exif": exif}
    path = picture_files.save(tmp_path / f"a{suffix}", RGB, **options)
    write_image(tmp_path / f"b{suffix}", RGB, metadata=read_metadata(path))
    assert read_image(tmp_path / f"b{suffix}").shape == RGB.shape


@pytest.mark.parametrize("image", [RGB, DEEP, GREY, np.dstack([DEEP, DEEP]).astype(np.float32)])
@pytest.mark.parametrize("target", ["pixels", "indices", "labels"])
def test_a_geotiff_stays_in_its_place(tmp_path: Path, image: Array, target: str) -> None:
    path, out = tmp_path / "a.tif", tmp_path / "b.tif"
    color = image.ndim == 3 and image.shape[2] == 3
    planar = "contig" if image.ndim == 3 else None
    about = [] if image.dtype == np.float32 else [(33432, "s", 0, "(c) somebody", True)]
    tifffile.imwrite(
        path, image, photometric="rgb" if color else "minisblack", planarconfig=planar, extratags=[*GEO, *about]
    )
    before, metadata = image_info(path), read_metadata(path)
    assert before.geo_transform == (10, 0, 500000, 0, -20, 4600000)
    if target == "pixels":
        write_image(out, image, metadata=metadata)
    elif target == "indices":
        write_image(out, np.arange(54).reshape(6, 9), palette=RGB.reshape(-1, 3), metadata=metadata)
    else:
        write_image(out, np.arange(54, dtype=np.int32).reshape(6, 9), metadata=metadata)
    after = image_info(out)
    assert (after.geo_transform, after.epsg) == (before.geo_transform, 32633)
    with tifffile.TiffFile(out) as tiff:
        tags = tiff.pages.first.tags
        assert (tags[34736].value, tags[34737].value) == ((1.5,), "somewhere|")
        if target == "indices" and about:
            assert tags[33432].value == "(c) somebody"


def test_a_turned_geotiff_and_other_formats_have_no_place(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", RGB, photometric="rgb", extratags=[*GEO, (274, "H", 1, 6, True)])
    assert read_metadata(tmp_path / "a.tif").geo == {}
    tifffile.imwrite(tmp_path / "b.tif", RGB, photometric="rgb", extratags=GEO)
    write_image(tmp_path / "b.png", RGB, metadata=read_metadata(tmp_path / "b.tif"))
    assert image_info(tmp_path / "b.png").geo_transform is None


@pytest.mark.parametrize("unit", ["um", "\\u00B5m", "furlong"])
def test_resolution_unit_and_spacing_of_imagej_travel_together(tmp_path: Path, unit: str) -> None:
    path, near = tmp_path / "a.tif", pytest.approx(40 / 13, rel=1e-6)
    scale = {"unit": unit, "spacing": 2.5}
    tifffile.imwrite(path, GREY, imagej=True, resolution=(40 / 13, 40 / 13), metadata=scale)
    metadata = read_metadata(path)
    write_image(tmp_path / "b.tif", GREY, metadata=metadata)
    with tifffile.TiffFile(tmp_path / "b.tif") as tiff:
        tags = tiff.pages.first.aspage().tags
        across, down = (tags[name].value for name in ("XResolution", "YResolution"))
        assert (across[0] / across[1], down[0] / down[1]) == (near, near)
        assert (int(tags["ResolutionUnit"].value), tiff.imagej_metadata) == (1, {"ImageJ": "1.11a", **scale})
    write_image(tmp_path / "b.png", GREY, metadata=metadata)
    again = read_metadata(tmp_path / "b.png")
    assert again.exif is None or b"ImageJ" not in again.exif
    assert again.dpi == (None if unit == "furlong" else (pytest.approx(25400 * 40 / 13, rel=1e-4),) * 2)


def test_a_unit_without_a_resolution_is_not_kept(tmp_path: Path) -> None:
    description = "ImageJ=1.53t\nunit=um\nimages=5\n"
    tifffile.imwrite(tmp_path / "a.tif", GREY, description=description, metadata=None, resolution=(0, 0))
    metadata = read_metadata(tmp_path / "a.tif")
    assert not metadata.scale
    assert metadata.exif is None or b"unit" not in metadata.exif


def test_the_size_of_a_pixel_of_an_ome_file_is_kept_but_not_its_description(tmp_path: Path) -> None:
    sizes = {"axes": "YX", "PhysicalSizeX": 0.5, "PhysicalSizeY": 0.25, "PhysicalSizeXUnit": "um"}
    tifffile.imwrite(tmp_path / "a.ome.tif", GREY, metadata=sizes)
    metadata = read_metadata(tmp_path / "a.ome.tif")
    assert metadata.dpi == pytest.approx((2 * 25400, 4 * 25400))
    assert metadata.exif is None or b"OME" not in metadata.exif
    write_image(tmp_path / "b.tif", GREY, metadata=metadata)
    assert image_info(tmp_path / "b.tif").pixel_size == PixelSize(0.5, 0.25, "um")


def test_a_resolution_that_jpeg_cannot_hold_is_left_out(tmp_path: Path) -> None:
    write_image(tmp_path / "a.jpg", GREY, metadata=Metadata(dpi=(78153.8, 78153.8)))
    assert read_metadata(tmp_path / "a.jpg").dpi is None
