"""A palette file says the colors that it was given, in the words of its format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg.palette import PALETTE_WRITERS, write_palette

RGB = np.array([[0, 0, 0], [200, 16, 46], [255, 255, 255]], np.uint8)
RGBA = np.array([[0, 0, 0, 0], [200, 16, 46, 128]], np.uint8)


def read_json(path: Path) -> NDArray[Any]:
    colors = json.loads(path.read_text())["colors"]
    assert [color["hex"][:7] for color in colors] == ["#{:02x}{:02x}{:02x}".format(*color["rgb"]) for color in colors]
    return np.array([color["rgb"] + ([color["alpha"]] if "alpha" in color else []) for color in colors])


def read_gpl(path: Path) -> NDArray[Any]:
    lines = path.read_text().splitlines()
    assert lines[0] == "GIMP Palette"
    assert lines[1] == f"Name: {path.stem}"
    rows = [line for line in lines[3:] if not line.startswith("#")]
    return np.array([[int(value) for value in row.split("\t")[0].split()] for row in rows])


READERS = {".json": read_json, ".gpl": read_gpl}


def test_there_is_a_reader_here_for_each_writer() -> None:
    assert set(READERS) == set(PALETTE_WRITERS)


@pytest.mark.parametrize("suffix", PALETTE_WRITERS)
@pytest.mark.parametrize("n_colors", [1, 2, 256, 300])
def test_a_palette_parses_back(tmp_path: Path, suffix: str, n_colors: int) -> None:
    palette = np.random.default_rng(1).integers(0, 256, (n_colors, 3), np.uint8)
    write_palette(tmp_path / f"a{suffix}", palette)
    np.testing.assert_array_equal(READERS[suffix](tmp_path / f"a{suffix}"), palette)


def test_the_case_of_the_suffix_does_not_matter(tmp_path: Path) -> None:
    write_palette(tmp_path / "a.JSON", RGB)
    np.testing.assert_array_equal(read_json(tmp_path / "a.JSON"), RGB)


def test_json_keeps_alpha_beside_rgb_and_in_the_hex_code(tmp_path: Path) -> None:
    write_palette(tmp_path / "a.json", RGBA)
    np.testing.assert_array_equal(read_json(tmp_path / "a.json"), RGBA)
    assert json.loads((tmp_path / "a.json").read_text())["colors"][1]["hex"] == "#c8102e80"


def test_gpl_keeps_alpha_in_the_name_of_the_color(tmp_path: Path) -> None:
    write_palette(tmp_path / "a.gpl", RGBA)
    np.testing.assert_array_equal(read_gpl(tmp_path / "a.gpl"), RGBA[:, :3])
    assert (tmp_path / "a.gpl").read_text().endswith("200  16  46\t#c8102e80\n")


def test_shares_are_those_of_the_pixels_and_sum_to_one(tmp_path: Path) -> None:
    write_palette(tmp_path / "a.json", RGB, density=[1, 2, 5])
    shares = [color["share"] for color in json.loads((tmp_path / "a.json").read_text())["colors"]]
    assert shares == [1 / 8, 2 / 8, 5 / 8]


def test_without_density_no_share_is_told(tmp_path: Path) -> None:
    write_palette(tmp_path / "a.json", RGB)
    assert "share" not in (tmp_path / "a.json").read_text()


@pytest.mark.parametrize(
    "palette",
    [
        np.array([0, 128, 255], np.uint8),
        np.array([[0], [128], [255]], np.uint8),
        np.array([0, 128 * 257 + 100, 65535], np.uint16),
        np.array([[0], [128 / 255 + 0.001], [1]], np.float32),
    ],
    ids=["uint8", "uint8 column", "uint16", "float32"],
)
def test_grey_of_any_depth_is_written_with_8_bits(tmp_path: Path, palette: NDArray[Any]) -> None:
    write_palette(tmp_path / "a.json", palette)
    np.testing.assert_array_equal(read_json(tmp_path / "a.json"), [[0] * 3, [128] * 3, [255] * 3])


@pytest.mark.parametrize("offset", [-128, 0, 128])
def test_16_bits_go_to_the_nearest_of_8(tmp_path: Path, offset: int) -> None:
    levels = np.arange(256)
    write_palette(tmp_path / "a.gpl", np.clip(levels * 257 + offset, 0, 65535).astype(np.uint16))
    np.testing.assert_array_equal(read_gpl(tmp_path / "a.gpl")[:, 0], levels)


@pytest.mark.parametrize(
    ("palette", "error", "message"),
    [
        (np.zeros((0, 3), np.uint8), ValueError, r"palette of shape \(0, 3\) must be .*have colors"),
        (np.zeros((4, 2), np.uint8), ValueError, r"palette of shape \(4, 2\) must be \(K,\), \(K, 1\)"),
        (np.zeros((4, 3), np.int64), TypeError, "palette of type int64 must be uint8"),
        (np.array([[0.0, 1.5, 0.0]]), ValueError, r"palette of type float64 must be in 0\.\.1"),
        (np.array([[0.0, np.nan, 0.0]]), ValueError, r"must be in 0\.\.1"),
    ],
)
def test_what_is_no_palette_is_refused_and_leaves_nothing(
    tmp_path: Path, palette: NDArray[Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        write_palette(tmp_path / "a.gpl", palette)
    assert not list(tmp_path.iterdir())


def test_an_unknown_suffix_is_refused_with_those_that_are_known(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"a\.xyz: suffix='\.xyz' must be one of \.gpl, \.json"):
        write_palette(tmp_path / "a.xyz", RGB)


def test_density_of_another_length_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"density of shape \(2,\) must be \(3,\)"):
        write_palette(tmp_path / "a.json", RGB, density=[1, 2])


def test_an_existing_file_stays_unless_asked(tmp_path: Path) -> None:
    path = tmp_path / "a.gpl"
    path.write_text("mine")
    with pytest.raises(FileExistsError, match="exists already"):
        write_palette(path, RGB)
    assert path.read_text() == "mine"
    write_palette(path, RGB, overwrite=True)
    np.testing.assert_array_equal(read_gpl(path), RGB)


def test_the_palette_is_named_after_the_file_in_one_line(tmp_path: Path) -> None:
    write_palette(tmp_path / "two\nlines.gpl", RGB)
    assert (tmp_path / "two\nlines.gpl").read_text().splitlines()[1] == "Name: two lines"
