"""``cvtimg quantize``: targets, palettes, locked colors, spaces, dithering, weights and depth on files."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from commands import RowOf
from PIL import Image

from cvtimg import quantize, read_image, read_palette, write_image
from cvtimg._shared.types import Array
from cvtimg.cli import app as cli
from cvtimg.options.common import color
from cvtimg.pictures import image_info


@pytest.fixture
def few(told: RowOf) -> RowOf:
    return lambda *arguments: told("quantize", *arguments, "-o", "out.png")


@pytest.fixture
def picture(photograph: Array, few: RowOf) -> Array:
    """Write in.png."""
    small = np.ascontiguousarray(photograph[::4, ::4])
    write_image("in.png", small)
    return small


def colors_of(path: str) -> set[tuple[int, ...]]:
    image = read_image(path)
    return set(map(tuple, image.reshape(-1, image.shape[2]).tolist()))


def test_a_size_that_leaves_one_color_is_warned_of(few: RowOf, picture: Array) -> None:
    assert "--max-bytes 300 leaves one color of" in few("in.png", "--max-bytes", "300")["warning"]


def test_a_palette_file_is_taken_as_it_is(few: RowOf, picture: Array) -> None:
    Path("p.hex").write_text("081820\n346856\n88c070\ne0f8d0\n")
    assert few("in.png", "--palette", "p.hex")["k"] == 4
    assert colors_of("out.png") <= {(8, 24, 32), (52, 104, 86), (136, 192, 112), (224, 248, 208)}
    deep = picture.astype(np.uint16) * 257
    write_image("deep.png", deep)
    few("deep.png", "--palette", "p.hex")
    assert (8 * 257, 24 * 257, 32 * 257) in colors_of("out.png")


def test_depth_stays_or_becomes_what_is_asked(few: RowOf, picture: Array) -> None:
    deep = picture.astype(np.uint16) * 257 + np.arange(64, dtype=np.uint16)[:, None]
    write_image("deep.png", deep)
    few("deep.png", "-k", "7")
    after = read_image("out.png")
    np.testing.assert_array_equal(after, quantize(deep, 7).image)
    assert after.dtype == np.uint16
    few("deep.png", "-k", "7", "--depth", "8")
    rounded = np.rint(deep / 257).astype(np.uint8)
    np.testing.assert_array_equal(read_image("out.png"), quantize(rounded, 7).image)
    few("in.png", "-k", "7", "--depth", "16")
    np.testing.assert_array_equal(read_image("out.png"), quantize(picture.astype(np.uint16) * 257, 7).image)
    write_image("float.tif", (picture[..., 0] / 255).astype(np.float32))
    few("float.tif", "-k", "7", "--depth", "8")
    expected = quantize(picture[..., 0], 7).image.repeat(3).reshape(64, 64, 3)
    np.testing.assert_array_equal(read_image("out.png"), expected)


def test_transparency_stays_in_the_file(few: RowOf, picture: Array) -> None:
    y, x = np.mgrid[:64, :64]
    alpha = np.clip(4 * (30 - np.hypot(x - 32, y - 32)) / 30, 0, 1) * 255
    image = np.dstack([picture, np.rint(alpha)]).astype(np.uint8)
    write_image("alpha.png", image)
    few("alpha.png", "-k", "16")
    after = read_image("out.png")
    assert (after[image[..., 3] == 0] == 0).all()
    assert (after[image[..., 3] == 255][:, 3] == 255).all()
    with Image.open("out.png") as file:
        assert file.mode == "P"
        alphas = file.info["transparency"]
    assert b"\xff" not in alphas.rstrip(b"\xff")  # so that a file need not tell of the opaque ones


@pytest.mark.parametrize(
    ("text", "digits"),
    [("#fff", "ffffffff"), ("#1a2b", "11aa22bb"), ("#102030", "102030ff"), ("White", "ffffffff"), ("navy", "000080ff")],
)
def test_colors_are_written_as_in_style_sheets(text: str, digits: str) -> None:
    assert color(text) == digits


def test_lock_takes_a_palette_file_beside_free_colors(few: RowOf, picture: Array) -> None:
    Path("house.pal").write_text("JASC-PAL\n0100\n2\n1 2 3\n250 0 250\n")
    few("in.png", "-k", 8, "--lock", "house.pal", "--lock", "white", "--save-palette", "out.hex")
    palette = read_palette("out.hex").tolist()
    assert len(palette) == 8
    for locked in ([1, 2, 3], [250, 0, 250], [255, 255, 255]):
        assert locked in palette


def test_without_an_aim_images_are_for_eyes_and_the_output_says_so(
    few: RowOf, picture: Array, capsys: pytest.CaptureFixture[str]
) -> None:
    row = few("in.png", "--effort", "fast")
    assert row["goal"] == "eyes"
    np.testing.assert_array_equal(read_image("out.png"), quantize(picture, goal="eyes", effort="fast").image)
    assert cli.main(["quantize", "in.png", "--effort", "fast"]) == 0
    assert "goal: eyes, a small file that looks the same" in capsys.readouterr().err
    assert "goal" not in few("in.png", "-k", "9")


def test_a_quality_out_of_reach_is_told_and_the_best_is_written(few: RowOf, picture: Any) -> None:
    answer = few("in.png", "--quality", "99", "-k", "8", "--effort", "fast")
    assert re.search(r"--quality 99 is out of reach of 8 colors: -?\d+\.\d", answer["warning"])
    assert answer["quality"] < 99
    assert Path("out.png").exists()


def test_deep_images_of_few_colors_are_said_to_be_smaller_with_8_bits(few: RowOf) -> None:
    write_image("g16.png", np.random.default_rng(0).normal(30_000, 4_000, (60, 80)).astype(np.uint16))
    deep, flat = few("g16.png", "-k", 32), few("g16.png", "-k", 32, "--depth", 8)
    assert "--depth 8 gives an indexed file" in deep["warning"]
    assert "warning" not in flat
    assert flat["output_bytes"] < deep["output_bytes"]


def test_a_file_that_grew_is_told_and_what_would_make_it_smaller(few: RowOf, picture: Array) -> None:
    Image.fromarray(picture).save("small.jpg", quality=50)
    many, two = few("small.jpg", "-k", 999), few("small.jpg", "-k", 2)
    assert many["output_bytes"] > many["input_bytes"]
    assert "larger than the input; --skip-if-larger" in many["warning"]
    assert "-k 256 has an index" in many["warning"]
    assert "warning" not in two


@pytest.mark.parametrize(
    ("image", "name"),
    [
        (np.linspace(0, 1, 60, dtype=np.float32).reshape(6, 10), "a-quantized.tif"),
        (np.arange(60, dtype=np.int32).reshape(6, 10) * 10**6, "a-quantized.tif"),
        (np.zeros((6, 10, 5), np.uint8), "a-quantized.tif"),
        (np.arange(60, dtype=np.uint16).reshape(6, 10) * 1000, "a-quantized.png"),
    ],
)
def test_samples_that_png_cannot_hold_stay_in_a_tiff(image: Array, name: str, told: RowOf) -> None:
    write_image("a.tif", image)
    told("quantize", "a.tif", "-k", 4)
    assert Path(name).exists()
    if image.dtype.itemsize == 4 and image.dtype.kind == "i":  # and not one black
        assert "has int32 samples, of which nothing tells which is white" in told("palette", "a.tif")["error"]


RNG = np.random.default_rng(3)
BANDS = RNG.integers(0, 65536, (20, 30, 4), np.uint16)


@pytest.mark.parametrize("n_bands", [2, 4])
def test_all_bands_of_a_file_without_alpha_are_reduced(told: RowOf, n_bands: int) -> None:
    image = BANDS[..., :n_bands]
    kind = {"photometric": "rgb" if n_bands == 4 else "minisblack", "planarconfig": "contig"}
    tifffile.imwrite("a.tif", image, extrasamples=["unspecified"], **kind)
    row = told("quantize", "a.tif", "-k", 20, "-o", "b.tif")
    reduced = read_image("b.tif")
    assert reduced.shape == image.shape
    assert not image_info("b.tif").has_alpha
    mse = np.square(reduced.astype(float) - image).mean()  # over the bands that there are
    assert row["mse"] == pytest.approx(mse)
    assert mse == pytest.approx(quantize(image, 20, alpha=False).mse)
    assert "bands that are not colors" in told("quantize", "a.tif", "-k", 20, "-o", "b.png")["error"]
