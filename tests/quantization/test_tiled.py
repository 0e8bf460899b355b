"""By tiles a picture becomes what it becomes in one piece, whatever way its file is cut."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from commands import RowOf
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from picture_files import write_tiff

from cvtimg import find_palette, quantize, read_image, write_image
from cvtimg.colors import counting
from cvtimg.colors.counting import Count
from cvtimg.colors.samples import color_samples
from cvtimg.pictures import tiles
from cvtimg.quantization import QuantizedSeries, QuantizeOptions, Reading, Writing, files, map_to_palette

RNG = np.random.default_rng(31)
zarr = pytest.importorskip("zarr")
PICTURE = np.kron(RNG.integers(0, 250, (12, 10, 3), np.uint8), np.ones((50, 60, 1), np.uint8))
PICTURE = PICTURE + RNG.integers(0, 6, PICTURE.shape, np.uint8)
LAYOUTS: dict[str, dict[str, Any]] = {
    "tiles": {"tile": (64, 128)},
    "compressed tiles": {"tile": (128, 64), "compression": "zstd", "predictor": True},
    "big": {"tile": (256, 256), "bigtiff": True, "compression": "lzw"},
    "strips": {"rowsperstrip": 7, "compression": "adobe_deflate"},
    "plain": {},
    "big-endian": {"byteorder": ">"},
}


@pytest.fixture(autouse=True)
def small_bands(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder, with several bands in a picture."""
    monkeypatch.setattr(tiles, "PIXELS_AT_ONCE", 40_000)


def quantize_file(
    source: str, target: str, n_colors: int | None = None, *, overwrite: bool = False, **how: Any
) -> QuantizedSeries:
    given = {"reading": Reading(tiles=True), "writing": Writing(overwrite=overwrite)}
    return files.quantize_file(source, target, QuantizeOptions(n_colors, **how), **given)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_by_tiles_is_as_in_one_piece(layout: dict[str, Any]) -> None:
    write_tiff(PICTURE, **layout)
    result = quantize_file("a.tif", "b.tif", 12)
    whole = quantize(PICTURE, 12)
    np.testing.assert_array_equal(read_image("b.tif"), whole.image)
    np.testing.assert_array_equal(result.palette, whole.palette)
    assert result.energy == pytest.approx(whole.energy)
    assert result.psnr == pytest.approx(whole.psnr)
    assert (result.n_distinct, result.results[0].exact) == (color_samples(PICTURE).n_colors, True)
    with tifffile.TiffFile("b.tif") as tiff:
        assert tiff.pages.first.is_tiled
        assert tiff.pages.first.photometric.name == "PALETTE"


KINDS = {
    "grey": PICTURE[..., 0],
    "rgba": np.dstack([PICTURE, np.where(PICTURE[..., 0] > 200, 0, 255).astype(np.uint8)]),
    "deep": PICTURE.astype(np.uint16) * 200,
    "bands": np.concatenate([PICTURE, PICTURE[..., :2]], axis=2),
    "float": (PICTURE / 255).astype(np.float32),
}


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("grey", "b.tif"),
        ("bands", "b.zarr"),
        pytest.param("deep", "b.tif", marks=pytest.mark.slow),
        pytest.param("rgba", "b.zarr", marks=pytest.mark.slow),
        pytest.param("float", "b.tif", marks=pytest.mark.slow),
    ],
)
def test_every_kind_of_samples_goes_by_tiles(name: str, target: str) -> None:
    image = KINDS[name]
    write_tiff(image, tile=(64, 64))
    quantize_file("a.tif", target, 9)
    after = read_image(target) if target == "b.tif" else zarr.open_array(target, mode="r")[:]
    expected = quantize(image, 9, alpha=name == "rgba")
    assert after.shape == image.shape
    assert after.dtype == image.dtype
    assert len(np.unique(after.reshape(-1, image.shape[2] if image.ndim == 3 else 1), axis=0)) <= 9
    error = ((after.astype(float) - image) ** 2).sum()
    assert error <= 1.02 * ((expected.image.astype(float) - image) ** 2).sum()


def test_a_given_palette_a_space_and_locked_colors_go_by_tiles() -> None:
    write_tiff(PICTURE, tile=(64, 64))
    palette = [[0, 0, 0], [255, 255, 255], [200, 30, 30]]
    quantize_file("a.tif", "b.tif", palette=palette, space="oklab")
    np.testing.assert_array_equal(read_image("b.tif"), map_to_palette(PICTURE, palette, space="oklab").image)
    result = quantize_file("a.tif", "c.tif", 5, locked=[[1, 2, 3]])
    assert [1, 2, 3] in result.palette.tolist()


def test_large_tiffs_go_by_tiles_by_themselves_and_say_that_this_is_exact(monkeypatch: Any, row_of: RowOf) -> None:
    write_tiff(PICTURE, tile=(64, 64))
    monkeypatch.setattr("cvtimg.read_image", lambda path: pytest.fail("read in one piece"))
    monkeypatch.setattr(tiles, "MOST_IN_MEMORY", 1000)
    assert row_of("quantize", "a.tif", "-k", 12, "-o", "b.tif", "--save-palette", "p.gpl")["exact"] is True
    np.testing.assert_array_equal(tifffile.imread("b.tif"), quantize(PICTURE, 12).indices)


def test_profile_and_place_on_earth_stay() -> None:
    scale, points = (30.0, 30.0, 0.0), (0.0, 0.0, 0.0, 500.0, 900.0, 0.0)
    geo = [(33550, 12, 3, scale, True), (33922, 12, 6, points, True)]
    write_tiff(PICTURE, tile=(64, 64), extratags=geo, iccprofile=b"profile" * 30)
    quantize_file("a.tif", "b.tif", 4)
    with tifffile.TiffFile("b.tif") as tiff:
        page = tiff.pages.first
        assert page.iccprofile == b"profile" * 30
        assert (page.tags.valueof(33550), page.tags.valueof(33922)) == (scale, points)


def test_what_cannot_be_read_in_tiles_says_why() -> None:
    write_tiff(np.moveaxis(PICTURE, 2, 0), planarconfig="separate", tile=(64, 64))
    with pytest.raises(OSError, match=r"a\.tif: cannot be read in tiles|holds"):
        quantize_file("a.tif", "b.tif", 4)
    write_image("a.png", PICTURE)
    with pytest.raises(OSError, match=r"a\.png: cannot be read in tiles: it is neither a TIFF file nor a Zarr array"):
        quantize_file("a.png", "b.tif", 4)
    Path("no.zarr").mkdir()
    with pytest.raises(OSError, match="is not a Zarr array"):
        quantize_file("no.zarr", "b.tif", 4)
    with pytest.raises(OSError, match="no such file"):
        quantize_file("missing.tif", "b.tif", 4)


def test_a_damaged_tile_leaves_no_output() -> None:
    write_tiff(PICTURE, tile=(64, 64), compression="adobe_deflate")
    content = bytearray(Path("a.tif").read_bytes())
    content[len(content) // 2 : len(content) // 2 + 500] = bytes(500)
    Path("a.tif").write_bytes(content)
    with pytest.raises(OSError, match=r"a\.tif: is truncated or damaged"):
        quantize_file("a.tif", "b.tif", 4)
    assert {path.name for path in Path().iterdir()} == {"a.tif"}


# Counting


@pytest.mark.slow
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cuts=st.lists(st.integers(1, 599), max_size=5), channels=st.sampled_from([1, 2, 3, 4, 5]))
def test_counting_in_parts_is_counting(cuts: list[int], channels: int) -> None:
    image = np.repeat(PICTURE, 2, axis=2)[..., :channels]
    count, whole = Count(), color_samples(image)
    for part in np.split(image, sorted(set(cuts))):
        count = count.plus(color_samples(part))
    assert count.exact
    np.testing.assert_array_equal(count.of_some().colors, whole.colors)
    np.testing.assert_array_equal(count.of_some().density, whole.density)


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_of_too_many_colors_neighbours_are_taken_together(dtype: type, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(counting, "MOST_COLORS", 2000)
    image = RNG.integers(0, 65536, (100, 100, 3)).astype(dtype)
    count = Count()
    for part in np.split(image, 10):
        count = count.plus(color_samples(part))
    samples, exact, _ = count
    assert samples is not None
    assert not exact
    assert samples.n_colors <= 2000
    assert samples.density.sum() == 10_000
    mean = samples.density @ samples.colors / 10_000
    np.testing.assert_allclose(mean, image.reshape(-1, 3).mean(axis=0), rtol=1e-3)
    few = map_to_palette(image, find_palette(samples, 8).colors)
    assert few.energy < 1.05 * quantize(image, 8).energy


def test_a_folder_is_replaced_only_by_a_whole_one() -> None:
    write_tiff(PICTURE, tile=(64, 64))
    quantize_file("a.tif", "b.zarr", 4)
    before = zarr.open_array("b.zarr", mode="r")[:]
    shutil.copy("a.tif", "c.tif")
    Path("c.tif").write_bytes(Path("a.tif").read_bytes()[:50_000])
    with pytest.raises(OSError, match=r"c\.tif"):
        quantize_file("c.tif", "b.zarr", 3, overwrite=True)
    np.testing.assert_array_equal(zarr.open_array("b.zarr", mode="r")[:], before)
