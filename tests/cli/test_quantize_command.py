"""``cvtimg quantize``: targets, palettes, locked colors, spaces, dithering, weights and depth on files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import RowOf
from numpy.typing import NDArray
from PIL import Image

from cvtimg import quantize, read_image, read_palette, write_image
from cvtimg.cli import app as cli
from cvtimg.options.common import color


@pytest.fixture
def run(told: RowOf) -> RowOf:
    return lambda *arguments: told("quantize", *arguments, "-o", "out.png")


@pytest.fixture
def picture(photograph: NDArray[Any], run: RowOf) -> NDArray[Any]:
    """Write in.png."""
    small = np.ascontiguousarray(photograph[::4, ::4])
    write_image("in.png", small)
    return small


def colors_of(path: str) -> set[tuple[int, ...]]:
    image = read_image(path)
    return set(map(tuple, image.reshape(-1, image.shape[2]).tolist()))


def test_a_size_that_leaves_one_color_is_warned_of(
    run: RowOf, picture: NDArray[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    assert "--max-bytes 300 leaves one color of" in run("in.png", "--max-bytes", "300")["warning"]
    assert cli.main(["quantize", "in.png", "--max-bytes", "300", "-o", "b.png"]) == 0
    assert "in.png: --max-bytes 300 leaves one color of" in capsys.readouterr().err


def test_a_palette_file_is_taken_as_it_is(run: RowOf, picture: NDArray[Any]) -> None:
    Path("p.hex").write_text("081820\n346856\n88c070\ne0f8d0\n")
    assert run("in.png", "--palette", "p.hex")["k"] == 4
    assert colors_of("out.png") <= {(8, 24, 32), (52, 104, 86), (136, 192, 112), (224, 248, 208)}
    deep = picture.astype(np.uint16) * 257
    write_image("deep.png", deep)
    run("deep.png", "--palette", "p.hex")
    assert (8 * 257, 24 * 257, 32 * 257) in colors_of("out.png")


def test_a_weight_map_tells_what_counts(run: RowOf, picture: NDArray[Any]) -> None:
    weights = np.zeros(picture.shape[:2], np.uint8)
    weights[20:30, 20:30] = 200
    write_image("w.png", weights)
    run("in.png", "-k", "8", "--weight-map", "w.png")
    np.testing.assert_array_equal(read_image("out.png"), quantize(picture, 8, weights=weights).image)


def test_depth_stays_or_becomes_what_is_asked(run: RowOf, picture: NDArray[Any]) -> None:
    deep = picture.astype(np.uint16) * 257 + np.arange(64, dtype=np.uint16)[:, None]
    write_image("deep.png", deep)
    run("deep.png", "-k", "7")
    after = read_image("out.png")
    np.testing.assert_array_equal(after, quantize(deep, 7).image)
    assert after.dtype == np.uint16
    run("deep.png", "-k", "7", "--depth", "8")
    rounded = np.rint(deep / 257).astype(np.uint8)
    np.testing.assert_array_equal(read_image("out.png"), quantize(rounded, 7).image)
    run("in.png", "-k", "7", "--depth", "16")
    np.testing.assert_array_equal(read_image("out.png"), quantize(picture.astype(np.uint16) * 257, 7).image)
    write_image("float.tif", (picture[..., 0] / 255).astype(np.float32))
    run("float.tif", "-k", "7", "--depth", "8")
    np.testing.assert_array_equal(
        read_image("out.png"), quantize(picture[..., 0], 7).image.repeat(3).reshape(64, 64, 3)
    )


def test_transparency_stays_in_the_file(run: RowOf, picture: NDArray[Any]) -> None:
    y, x = np.mgrid[:64, :64]
    alpha = np.clip(4 * (30 - np.hypot(x - 32, y - 32)) / 30, 0, 1) * 255
    image = np.dstack([picture, np.rint(alpha)]).astype(np.uint8)
    write_image("alpha.png", image)
    run("alpha.png", "-k", "16")
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


def test_lock_takes_a_palette_file_beside_free_colors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, photograph: NDArray[np.uint8]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_image("in.png", photograph[::4, ::4])
    Path("house.pal").write_text("JASC-PAL\n0100\n2\n1 2 3\n250 0 250\n")
    words = ["quantize", "in.png", "-k", "8", "--lock", "house.pal", "--lock", "white", "--save-palette", "out.hex"]
    assert cli.main([*words, "--quiet"]) == 0
    palette = read_palette("out.hex").tolist()
    assert len(palette) == 8
    for locked in ([1, 2, 3], [250, 0, 250], [255, 255, 255]):
        assert locked in palette


def test_without_an_aim_images_are_for_eyes_and_the_output_says_so(
    run: RowOf, picture: NDArray[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    row = run("in.png", "--effort", "fast")
    assert row["goal"] == "eyes"
    np.testing.assert_array_equal(read_image("out.png"), quantize(picture, goal="eyes", effort="fast").image)
    assert cli.main(["quantize", "in.png", "--effort", "fast"]) == 0
    assert "goal: eyes, a small file that looks the same" in capsys.readouterr().err
    assert "goal" not in run("in.png", "-k", "9")


def test_a_quality_out_of_reach_is_told_and_the_best_is_written(run: RowOf, picture: Any) -> None:
    answer = run("in.png", "--quality", "99", "-k", "8", "--effort", "fast")
    assert re.search(r"--quality 99 is out of reach of 8 colors: -?\d+\.\d", answer["warning"])
    assert answer["quality"] < 99
    assert Path("out.png").exists()


def test_deep_images_of_few_colors_are_said_to_be_smaller_with_8_bits(run: RowOf) -> None:
    write_image("g16.png", np.random.default_rng(0).normal(30_000, 4_000, (60, 80)).astype(np.uint16))
    deep, flat = run("g16.png", "-k", 32), run("g16.png", "-k", 32, "--depth", 8)
    assert "--depth 8 gives an indexed file" in deep["warning"]
    assert "warning" not in flat
    assert flat["output_bytes"] < deep["output_bytes"]


def test_a_file_that_grew_is_told_and_what_would_make_it_smaller(run: RowOf, picture: NDArray[Any]) -> None:
    Image.fromarray(picture).save("small.jpg", quality=50)
    many, few = run("small.jpg", "-k", 999), run("small.jpg", "-k", 2)
    assert many["output_bytes"] > many["input_bytes"]
    assert "larger than the input; --skip-if-larger" in many["warning"]
    assert "-k 256 has an index" in many["warning"]
    assert "warning" not in few


@pytest.mark.parametrize(
    ("image", "name"),
    [
        (np.linspace(0, 1, 60, dtype=np.float32).reshape(6, 10), "a-quantized.tif"),
        (np.arange(60, dtype=np.int32).reshape(6, 10) * 10**6, "a-quantized.tif"),
        (np.zeros((6, 10, 5), np.uint8), "a-quantized.tif"),
        (np.arange(60, dtype=np.uint16).reshape(6, 10) * 1000, "a-quantized.png"),
    ],
)
def test_samples_that_png_cannot_hold_stay_in_a_tiff(
    image: NDArray[Any], name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_image(tmp_path / "a.tif", image)
    assert cli.main(["quantize", str(tmp_path / "a.tif"), "-k", "4"]) == 0
    assert (tmp_path / name).exists()
    if image.dtype.itemsize == 4 and image.dtype.kind == "i":
        assert cli.main(["palette", str(tmp_path / "a.tif")]) == 1  # and not one black
        assert "has int32 samples, of which nothing tells which is white" in capsys.readouterr().err
