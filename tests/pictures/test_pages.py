"""Stacks of pages keep their pages, axes and physical sizes; no page is left out in silence."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image

from cvtimg import read_image
from cvtimg.pictures import Pages, image_info, read_pages, write_pages
from cvtimg.pictures.formats.opening import pixels_limited

RNG = np.random.default_rng(4)
STACK = RNG.integers(0, 256, (5, 12, 9), np.uint8)
DEEP = RNG.integers(0, 65536, (3, 2, 12, 9), np.uint16)
COLORS = RNG.integers(0, 256, (3, 12, 9, 3), np.uint8)


@pytest.mark.parametrize("stack", [STACK, COLORS, DEEP[0], DEEP[0] / np.float32(7)], ids=lambda one: str(one.dtype))
def test_pages_of_other_programs_come_back_and_are_not_taken_for_one_image(
    tmp_path: Path, stack: np.ndarray[Any, Any]
) -> None:
    path = tmp_path / "a.tif"
    for compression in (None, "lzw"):
        photometric = "rgb" if stack.ndim == 4 else "minisblack"
        with tifffile.TiffWriter(path) as tiff:  # page by page, without a word on axes
            for page in stack:
                tiff.write(page, photometric=photometric, compression=compression, metadata=None)
        np.testing.assert_array_equal(np.stack(read_pages(path).images), stack)
        assert image_info(path).frames == len(stack)
        with pytest.raises(OSError, match=rf"a\.tif: has {len(stack)} pages, where one image is expected$"):
            read_image(path)


def test_scanned_pages_are_read_as_they_look(tmp_path: Path) -> None:
    bits = [Image.fromarray(page > 100) for page in STACK]
    bits[0].save(tmp_path / "fax.tif", save_all=True, append_images=bits[1:], compression="group4")
    np.testing.assert_array_equal(np.stack(read_pages(tmp_path / "fax.tif").images), (STACK > 100) * np.uint8(255))
    indexed = [Image.fromarray(page).quantize(7) for page in COLORS]
    indexed[0].save(tmp_path / "few.tif", save_all=True, append_images=indexed[1:])
    seen = np.stack([np.asarray(page.convert("RGB")) for page in indexed])
    np.testing.assert_array_equal(np.stack(read_pages(tmp_path / "few.tif").images), seen)


def test_a_stack_of_imagej_keeps_axes_and_spacing(tmp_path: Path) -> None:
    metadata = {"axes": "TZYX", "spacing": 0.5, "unit": "um", "finterval": 2.0}
    tifffile.imwrite(tmp_path / "a.tif", DEEP, imagej=True, resolution=(5.0, 4.0), metadata=metadata)
    pages = read_pages(tmp_path / "a.tif")
    assert (pages.axes, pages.shape, pages.kind) == ("TZ", (3, 2), "imagej")
    np.testing.assert_array_equal(np.stack(pages.images).reshape(DEEP.shape), DEEP)
    write_pages(tmp_path / "b.tif", pages)
    with tifffile.TiffFile(tmp_path / "b.tif") as tiff:
        assert tiff.series[0].axes == "TZYX"
        np.testing.assert_array_equal(tiff.asarray(), DEEP)
        kept = tiff.imagej_metadata or {}
        assert (kept["spacing"], kept["unit"], kept["finterval"]) == (0.5, "um", 2.0)
        assert tiff.pages.first.aspage().get_resolution() == pytest.approx((5.0, 4.0))


def test_a_stack_of_ome_keeps_axes_and_physical_sizes(tmp_path: Path) -> None:
    metadata = {"axes": "CZYX", "PhysicalSizeX": 0.1, "PhysicalSizeXUnit": "µm", "PhysicalSizeZ": 0.4}
    tifffile.imwrite(tmp_path / "a.ome.tif", DEEP, ome=True, metadata=metadata)
    pages = read_pages(tmp_path / "a.ome.tif")
    assert (pages.axes, pages.shape, pages.kind) == ("CZ", (3, 2), "ome")
    write_pages(tmp_path / "b.ome.tif", pages)
    again = read_pages(tmp_path / "b.ome.tif")
    assert (again.axes, again.shape, dict(again.scale)) == (pages.axes, pages.shape, dict(pages.scale))
    assert again.scale["PhysicalSizeX"] == 0.1
    np.testing.assert_array_equal(np.stack(again.images), np.stack(pages.images))


def test_indexed_pages_share_a_palette(tmp_path: Path) -> None:
    palette = RNG.integers(0, 256, (6, 3), np.uint8)
    write_pages(tmp_path / "a.tif", STACK % 6, palette=palette)
    np.testing.assert_array_equal(np.stack(read_pages(tmp_path / "a.tif").images), palette[STACK % 6])
    with tifffile.TiffFile(tmp_path / "a.tif") as tiff:
        assert all(page.aspage().photometric == tifffile.PHOTOMETRIC.PALETTE for page in tiff.pages)


def test_masks_and_reduced_copies_are_no_pages(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as tiff:
        tiff.write(COLORS[0], photometric="rgb", metadata=None)
        tiff.write(COLORS[0, ::2, ::2], photometric="rgb", subfiletype=1, metadata=None)
        tiff.write(COLORS[0, ..., 0] > 9, photometric="mask", subfiletype=4, metadata=None)
    assert image_info(tmp_path / "a.tif").frames == 1
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), COLORS[0])
    with tifffile.TiffWriter(tmp_path / "b.tif") as tiff:
        tiff.write(COLORS, photometric="rgb", metadata=None)
        tiff.write(COLORS[0, ::2, ::2], photometric="rgb", subfiletype=1, metadata=None)
    np.testing.assert_array_equal(read_pages(tmp_path / "b.tif").images, COLORS)


def test_pages_of_different_sizes_are_refused_by_name(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as tiff:
        for size in (5, 6):
            tiff.write(np.zeros((size, size), np.uint8), photometric="minisblack", metadata=None)
    with pytest.raises(OSError, match=r"a\.tif: has pages of different sizes or types"):
        read_pages(tmp_path / "a.tif")


def test_what_does_not_fit_is_refused_before_a_file_appears(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"suffix='\.png' must be one of \.tif, \.tiff"):
        write_pages(tmp_path / "a.png", STACK)
    with pytest.raises(ValueError, match="must be in 0"):
        write_pages(tmp_path / "a.tif", STACK, palette=COLORS[0, 0])
    with pytest.raises(ValueError, match="must have one shape and type"):
        Pages((STACK[0], STACK[0, :5]))
    with pytest.raises(ValueError, match=r"axes='TZ' of shape \(2, 2\) must hold 5 images"):
        Pages(tuple(STACK), "TZ", (2, 2))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.timeout(20)
@pytest.mark.parametrize("n_pages", [1, 3])
def test_a_chain_of_pages_that_leads_in_a_circle_is_named_at_once_but_one_page_is_read(
    tmp_path: Path, n_pages: int
) -> None:
    path = tmp_path / "circle.tif"
    tifffile.imwrite(path, np.zeros((n_pages, 8, 8), np.uint8), photometric="minisblack", metadata=None)
    with tifffile.TiffFile(path) as tiff:
        first, last = tiff.pages[0].offset, tiff.pages[-1].offset
    content = bytearray(path.read_bytes())
    (n_tags,) = struct.unpack_from("<H", content, last)
    struct.pack_into("<I", content, last + 2 + 12 * n_tags, first)  # what is the next page of the last one
    path.write_bytes(content)
    if n_pages == 1:
        assert (image_info(path).frames, read_image(path).shape) == (1, (8, 8))
        return
    for read in (read_pages, read_image, image_info):
        with pytest.raises(OSError, match=r"circle\.tif: its chain of pages is circular"):
            read(path)


def test_pages_that_imagej_cannot_hold_keep_their_scale_in_inches(tmp_path: Path) -> None:
    scale = {"resolution": (2.0, 2.0), "resolutionunit": 1, "unit": "mm"}
    images = tuple(np.full((3, 4), number, np.int32) for number in range(2))
    write_pages(tmp_path / "a.tif", Pages(images, "Z", (2,), "imagej", scale))
    again = read_pages(tmp_path / "a.tif")
    assert again.kind == ""
    assert again.scale["resolution"] == pytest.approx((50.8, 50.8))
    assert again.scale["resolutionunit"] == 2
    write_pages(tmp_path / "b.tif", Pages(images, "Z", (2,), "imagej", {**scale, "unit": "furlong"}))
    assert read_pages(tmp_path / "b.tif").scale == {"resolution": (1, 1), "resolutionunit": 1}  # as if none were given


def test_pages_may_exceed_the_limit_of_an_image_together_if_their_file_is_as_large(tmp_path: Path) -> None:
    pages = np.random.default_rng(0).integers(0, 256, (6, 40, 50), np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", pages, photometric="minisblack")
    tifffile.imwrite(tmp_path / "small.tif", 0 * pages, photometric="minisblack", compression="adobe_deflate")
    with pixels_limited(2000):
        np.testing.assert_array_equal(read_pages(tmp_path / "a.tif").images, pages)
        with pytest.raises(OSError, match="has over 2000 pixels"):
            read_pages(tmp_path / "small.tif")
    with pixels_limited(1999), pytest.raises(OSError, match="has over 1999 pixels"):
        read_pages(tmp_path / "a.tif")
