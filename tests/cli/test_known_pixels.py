"""``cvtimg quantize`` with --mask, --nodata and the nodata value of a GeoTIFF."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image

from cvtimg import quantize, read_image, read_palette, write_image
from cvtimg.cli import app as cli
from cvtimg.pictures import image_info

Run = Callable[..., dict[str, Any]]

#: Colors in 100..199, and a band on the left that is to be left out.
COLORS = np.random.default_rng(7).integers(100, 200, (24, 32, 3), dtype=np.uint8)
LEFT_OUT = np.arange(32) < np.full((24, 1), 10)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command in an empty folder; return its first row, or what it complains of under "error"."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> dict[str, Any]:
        status = cli.main(["quantize", *arguments, "--overwrite", "--json"])
        out, err = capsys.readouterr()
        return {**(json.loads(out.splitlines()[0]) if out else {}), "status": status, "error": err}

    return run


def write_raster(name: str, values: np.ndarray[Any, Any], nodata: str, **more: Any) -> None:
    tifffile.imwrite(name, values, extratags=[(42113, "s", 0, nodata)], **more)


def test_masked_pixels_do_not_change_the_palette_and_become_transparent(run: Run) -> None:
    write_image("mask.png", ~LEFT_OUT)
    palettes = []
    for value in (0, 255):
        write_image("in.png", np.where(LEFT_OUT[..., None], np.uint8(value), COLORS), overwrite=True)
        row = run("in.png", "-k", "5", "--mask", "mask.png", "-o", "out.png", "--save-palette", "out.hex")
        assert (row["status"], row["left_out"]) == (0, LEFT_OUT.sum())
        palettes.append(read_palette("out.hex").tolist())
        np.testing.assert_array_equal(read_image("out.png")[..., 3] == 0, LEFT_OUT)
    assert palettes[0] == palettes[1] == quantize(COLORS[:, 10:], 5).palette.tolist()


def test_nodata_of_an_option_is_left_out_and_in_all_bands_only(run: Run) -> None:
    values = np.where(LEFT_OUT[..., None], np.uint8(9), COLORS)
    values[0, 31] = (9, 150, 150)
    write_image("in.png", values)
    assert run("in.png", "-k", "5", "--nodata", "9", "-o", "out.png")["left_out"] == LEFT_OUT.sum()
    assert run("in.png", "-k", "5", "-o", "out.png")["left_out"] == 0


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_nodata_of_a_file_is_left_out_and_stays_nodata(run: Run, dtype: str) -> None:
    values = np.where(LEFT_OUT, 0, COLORS[..., 0]).astype(dtype)
    write_raster("in.tif", values, "0")
    row = run("in.tif", "-k", "4", "-o", "out.tif")
    assert row["left_out"] == LEFT_OUT.sum()
    result = read_image("out.tif")
    assert image_info("out.tif").nodata == 0
    np.testing.assert_array_equal(result == 0, LEFT_OUT)
    np.testing.assert_array_equal(result[~LEFT_OUT], quantize(values[:, 10:], 4).image.ravel())
    assert result.dtype == dtype


def test_no_color_becomes_nodata(run: Run) -> None:
    values = np.array([[7, 6, 8], [7, 8, 6]], np.uint16)  # the mean of 6 and 8 is nodata
    write_raster("in.tif", values, "7")
    assert run("in.tif", "-k", "1", "-o", "out.tif")["left_out"] == 2
    assert (read_image("out.tif") == 7).all()
    assert image_info("out.tif").nodata is None


def test_aims_and_weights_count_the_pixels_that_are_known(run: Run) -> None:
    write_raster("in.tif", np.where(LEFT_OUT, 0, COLORS[..., 0]), "0")
    write_image("known.tif", np.ascontiguousarray(COLORS[:, 10:, 0]))
    for aim in (["--psnr", "35"], ["-k", "auto"]):
        masked, known = (run(name, *aim, "-o", "out.png") for name in ("in.tif", "known.tif"))
        assert [masked[name] for name in ("k", "mse")] == [known[name] for name in ("k", "mse")]
    write_image("weights.png", COLORS[..., 1])
    write_image("weights_known.png", np.ascontiguousarray(COLORS[:, 10:, 1]))
    masked = run("in.tif", "-k", "3", "--weight-map", "weights.png", "-o", "out.png")
    assert masked["mse"] == run("known.tif", "-k", "3", "--weight-map", "weights_known.png", "-o", "out.png")["mse"]


def test_a_shared_palette_is_of_known_pixels(run: Run) -> None:
    for name, at in (("a.tif", 0), ("b.tif", 1)):
        write_raster(name, np.where(LEFT_OUT, 0, COLORS[..., at]), "0")
        write_image(f"known_{name}", np.ascontiguousarray(COLORS[:, 10:, at]))
    for prefix in ("", "known_"):
        names = [f"{prefix}a.tif", f"{prefix}b.tif"]
        options = ["--shared-palette", "--out-dir", "out", "--save-palette", f"{prefix}p.hex"]
        assert run(*names, "-k", "4", *options)["status"] == 0
    assert read_palette("p.hex").tolist() == read_palette("known_p.hex").tolist()


@pytest.mark.parametrize("option", [["--mask", "mask.png"], ["--nodata", "0"]])
def test_pages_and_animations_and_tiles_refuse_to_leave_pixels_out(run: Run, option: list[str]) -> None:
    write_image("mask.png", ~LEFT_OUT)
    tifffile.imwrite("pages.tif", np.stack([COLORS[..., 0]] * 2), photometric="minisblack")
    first, second = (Image.fromarray(COLORS[..., at]) for at in (0, 1))
    first.save("film.gif", save_all=True, append_images=[second])
    write_image("in.tif", COLORS)
    for source, target, why in (
        ("pages.tif", "out.tif", "has several pages"),
        ("film.gif", "out.gif", "is an animation"),
    ):
        row = run(source, "-k", "4", *option, "-o", target)
        assert row["status"] == 1
        assert f"{why}, which {option[0]} cannot be used for" in row["error"]
    pytest.importorskip("zarr")
    row = run("in.tif", "-k", "4", *option, "-o", "out.zarr")
    assert f"is read in tiles, and {option[0]} needs the whole picture" in row["error"]


def test_pages_and_tiles_warn_of_nodata_that_counts(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    write_raster("pages.tif", np.stack([COLORS[..., 0]] * 2), "0", photometric="minisblack")
    assert "nodata value 0 count in files of several pages" in run("pages.tif", "-k", "4", "-o", "p.tif")["warning"]
    monkeypatch.setattr("cvtimg.cli.tiled._LARGE", 100)
    write_raster("in.tif", COLORS[..., 0], "0")
    assert "nodata value 0 count in tiles" in run("in.tif", "-k", "4", "-o", "t.tif")["warning"]


def test_a_mask_of_another_size_is_refused(run: Run) -> None:
    write_image("in.png", COLORS)
    write_image("mask.png", ~LEFT_OUT[:5])
    row = run("in.png", "-k", "4", "--mask", "mask.png", "-o", "out.png")
    assert "has 32 x 24 pixels, but the mask mask.png has 32 x 5" in row["error"]
    assert not Path("out.png").exists()
