"""``cvtimg quantize`` and ``segment`` with --mask, --nodata and the nodata value of a GeoTIFF."""

from functools import partial
from typing import Any

import numpy as np
import pytest
import tifffile
from commands import RowOf
from PIL import Image

from cvtimg import quantize, read_image, read_palette, segment, write_image
from cvtimg.pictures import image_info, read_frames, read_pages

#: Colors in 100..199, and a band on the left that is to be left out.
COLORS = np.random.default_rng(7).integers(100, 200, (24, 32, 3), dtype=np.uint8)
LEFT_OUT = np.arange(32) < np.full((24, 1), 10)


@pytest.fixture
def few(told: RowOf) -> RowOf:
    return partial(told, "quantize")


def write_pages(name: str, pages: Any) -> None:
    tifffile.imwrite(name, np.asarray(pages), photometric="minisblack")


def write_raster(name: str, values: np.ndarray[Any, Any], nodata: str, **more: Any) -> None:
    tifffile.imwrite(name, values, extratags=[(42113, "s", 0, nodata)], **more)


def test_masked_pixels_do_not_change_the_palette_and_become_transparent(few: RowOf) -> None:
    write_image("mask.png", ~LEFT_OUT)
    write_image("in.png", np.where(LEFT_OUT[..., None], np.uint8(255), COLORS))
    row = few("in.png", "-k", "5", "--mask", "mask.png", "-o", "out.png", "--save-palette", "out.hex")
    assert (row["status"], row["left_out"]) == (0, LEFT_OUT.sum())
    np.testing.assert_array_equal(read_image("out.png")[..., 3] == 0, LEFT_OUT)
    assert read_palette("out.hex").tolist() == quantize(COLORS[:, 10:], 5).palette.tolist()
    tifffile.imwrite("pages.tif", np.stack([COLORS] * 3), photometric="rgb")
    assert few("pages.tif", "-k", "4", "--mask", "mask.png", "-o", "out.tif")["left_out"] == 3 * LEFT_OUT.sum()
    for page in read_pages("out.tif").images:
        np.testing.assert_array_equal(page[..., 3] == 0, LEFT_OUT)


def test_nodata_of_an_option_is_left_out_and_in_all_bands_only(few: RowOf) -> None:
    values = np.where(LEFT_OUT[..., None], np.uint8(9), COLORS)
    values[0, 31] = (9, 150, 150)
    write_image("in.png", values)
    assert few("in.png", "-k", "5", "--nodata", "9", "-o", "out.png")["left_out"] == LEFT_OUT.sum()
    assert few("in.png", "-k", "5", "-o", "out.png")["left_out"] == 0


@pytest.mark.parametrize(("dtype", "large"), [("uint8", 1000), ("uint16", 1000), ("float32", 1000), ("int16", 100)])
def test_nodata_of_a_file_is_left_out_and_stays_nodata_in_tiles_too(
    few: RowOf, monkeypatch: pytest.MonkeyPatch, dtype: str, large: int
) -> None:
    monkeypatch.setattr("cvtimg.pictures.tiles.MOST_IN_MEMORY", large)
    values = np.where(LEFT_OUT, 0, COLORS[..., 0]).astype(dtype)
    write_raster("in.tif", values, "0")
    row = few("in.tif", "-k", "4", "-o", "out.tif")
    assert row["left_out"] == LEFT_OUT.sum()
    result = read_image("out.tif")
    assert image_info("out.tif").nodata == 0
    np.testing.assert_array_equal(result == 0, LEFT_OUT)
    np.testing.assert_array_equal(result[~LEFT_OUT], quantize(values[:, 10:], 4).image.ravel())
    assert result.dtype == dtype


def test_no_color_becomes_nodata(few: RowOf) -> None:
    values = np.array([[7, 6, 8], [7, 8, 6]], np.uint16)  # the mean of 6 and 8 is nodata
    write_raster("in.tif", values, "7")
    assert few("in.tif", "-k", "1", "-o", "out.tif")["left_out"] == 2
    assert (read_image("out.tif") == 7).all()
    assert image_info("out.tif").nodata is None


def test_aims_and_weights_count_the_pixels_that_are_known(few: RowOf) -> None:
    write_raster("in.tif", np.where(LEFT_OUT, 0, COLORS[..., 0]), "0")
    write_image("known.tif", np.ascontiguousarray(COLORS[:, 10:, 0]))
    for aim in (["--psnr", "35"], ["-k", "auto"]):
        masked, known = (few(name, *aim, "-o", "out.png") for name in ("in.tif", "known.tif"))
        assert [masked[name] for name in ("k", "mse")] == [known[name] for name in ("k", "mse")]
    write_image("weights.png", COLORS[..., 1])
    write_image("weights_known.png", np.ascontiguousarray(COLORS[:, 10:, 1]))
    masked = few("in.tif", "-k", "3", "--weight-map", "weights.png", "-o", "out.png")
    assert masked["mse"] == few("known.tif", "-k", "3", "--weight-map", "weights_known.png", "-o", "out.png")["mse"]


def test_a_shared_palette_is_of_known_pixels(few: RowOf) -> None:
    for name, at in (("a.tif", 0), ("b.tif", 1)):
        write_raster(name, np.where(LEFT_OUT, 0, COLORS[..., at]), "0")
        write_image(f"known_{name}", np.ascontiguousarray(COLORS[:, 10:, at]))
    for prefix in ("", "known_"):
        names = [f"{prefix}a.tif", f"{prefix}b.tif"]
        options = ["--shared-palette", "--out-dir", "out", "--save-palette", f"{prefix}p.hex"]
        assert few(*names, "-k", "4", *options)["status"] == 0
    assert read_palette("p.hex").tolist() == read_palette("known_p.hex").tolist()


def test_pages_leave_out_the_pixels_of_one_mask_or_of_as_many(few: RowOf) -> None:
    other = LEFT_OUT[:, ::-1]
    masks = {"one.png": np.stack([~LEFT_OUT] * 2), "two.tif": np.stack([~LEFT_OUT, ~other])}
    write_image("one.png", ~LEFT_OUT)
    write_pages("two.tif", masks["two.tif"].astype(np.uint8))
    for name, inside in masks.items():
        found = []
        for left_out in (-3000, 2000):
            pages = np.where(inside, np.stack([COLORS[..., 0], COLORS[..., 1]]).astype(np.int16) - 150, left_out)
            write_pages("pages.tif", pages.astype(np.int16))
            row = few("pages.tif", "-k", "4", "--mask", name, "-o", "out.tif")
            assert (row["status"], row["left_out"]) == (0, (~inside).sum())
            reduced = tifffile.imread("out.tif")
            assert reduced.dtype == np.int16
            assert (reduced[~inside] == left_out).all()
            found.append(reduced[inside])
        np.testing.assert_array_equal(*found)
        assert len(np.unique(found[0])) == 4


@pytest.mark.parametrize("mask", ["one.png", "all.gif"])
def test_animations_leave_out_pixels_of_each_frame(few: RowOf, mask: str) -> None:
    frames = [np.where(LEFT_OUT[..., None], np.uint8(value), COLORS) for value in (0, 255)]
    first, second = map(Image.fromarray, frames)
    first.save("film.png", save_all=True, append_images=[second])
    write_image("one.png", ~LEFT_OUT)
    inside = [np.where(LEFT_OUT, np.uint8(0), np.uint8(level)) for level in (255, 254)]  # equal frames become one
    Image.fromarray(inside[0]).save("all.gif", save_all=True, append_images=[Image.fromarray(inside[1])])
    for target in ("out.png", "out.gif"):
        row = few("film.png", "-k", "256", "--mask", mask, "-o", target)
        assert (row["status"], row["left_out"], row["frames"]) == (0, 2 * LEFT_OUT.sum(), 2)
        for image in read_frames(target).images:
            np.testing.assert_array_equal(image[..., 3] == 0, LEFT_OUT)


@pytest.mark.parametrize("volume", [[], ["--volume"]])
def test_pages_are_segmented_inside_a_mask(told: RowOf, volume: list[str]) -> None:
    pages, inside = np.stack([COLORS[..., 0]] * 3), np.stack([~LEFT_OUT, LEFT_OUT, ~LEFT_OUT])
    write_pages("each.tif", inside.astype(np.uint8))
    write_pages("pages.tif", pages)
    assert told("segment", "pages.tif", "-k", "3", "--mask", "each.tif", "-o", "l.tif", *volume)["status"] == 0
    wholes = [(pages.reshape(-1, 32), inside.reshape(-1, 32))] if volume else zip(pages, inside, strict=True)
    expected = np.concatenate([segment(one, 3, mask=own).labels for one, own in wholes]).reshape(pages.shape)
    labels = tifffile.imread("l.tif")
    assert np.mean(labels == expected) > (0.99 if volume else 0.9999)
    assert (labels[~inside] == 0).all()


@pytest.mark.parametrize("mask", ["mask.png", "mask.tif"])
@pytest.mark.parametrize("command", ["quantize in.tif -k 4", "segment in.tif -k 3 --edge-weight 2"])
def test_tiles_leave_out_what_the_whole_image_does(
    told: RowOf, monkeypatch: pytest.MonkeyPatch, mask: str, command: str
) -> None:
    tifffile.imwrite("in.tif", COLORS[..., 0].astype(np.int16), rowsperstrip=5)
    inside = ~LEFT_OUT
    inside[5:11] = False  # whole bands
    write_image("mask.png", inside)
    tifffile.imwrite("mask.tif", inside.astype(np.uint8), rowsperstrip=7, photometric="minisblack")
    whole = told(*command.split(), "--mask", mask, "-o", "whole.tif")
    monkeypatch.setattr("cvtimg.pictures.tiles.MOST_IN_MEMORY", 100)
    monkeypatch.setattr("cvtimg.pictures.tiles.PIXELS_AT_ONCE", 100)
    tiled = told(*command.split(), "--mask", mask, "-o", "tiled.tif")
    assert (tiled["status"], tiled["k"], tiled["left_out"]) == (0, whole["k"], (~inside).sum())
    np.testing.assert_array_equal(read_image("tiled.tif"), read_image("whole.tif"))


def test_a_type_that_a_format_cannot_hold_is_said(few: RowOf) -> None:
    write_image("in.tif", COLORS[..., 0].astype(np.int16))
    row = few("in.tif", "-k", "4", "-o", "out.png")
    assert "int16 samples are written as uint16 with the same values" in row["warning"]
    expected = quantize(COLORS[..., 0].astype(np.int16), 4).image.astype(np.uint16)
    np.testing.assert_array_equal(read_image("out.png"), expected, strict=True)
