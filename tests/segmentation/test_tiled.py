"""Segments by strips are those of the picture in one piece, edges and all."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from commands import Run
from picture_files import write_tiff

from cvtimg import segment, write_image
from cvtimg._shared.types import Array, Bytes
from cvtimg.colors import counting
from cvtimg.labels import region_means
from cvtimg.pictures import image_info, tiles
from cvtimg.segmentation import segment_file
from cvtimg.segmentation import tiled as tiled_segmentation

RNG = np.random.default_rng(8)
zarr = pytest.importorskip("zarr")


@pytest.fixture(autouse=True)
def small_strips(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder, with several strips in a picture."""
    monkeypatch.setattr(tiles, "PIXELS_AT_ONCE", 20_000)
    monkeypatch.setattr(tiled_segmentation, "STRIP_PIXELS", 4000)


write = partial(write_tiff, tile=(64, 64))


def noisy(shape: tuple[int, int] = (310, 200), sigma: float = 25) -> Bytes:
    """Return discs of three colors under noise, so that strips cut through many."""
    down, right = np.mgrid[: shape[0], : shape[1]]
    rings = (np.hypot(down - 150, right - 90) // 23).astype(int) % 3
    colors = np.array([[60, 70, 90], [120, 150, 80], [190, 120, 170]], float)
    return np.clip(colors[rings] + RNG.normal(0, sigma, (*shape, 3)), 0, 255).astype(np.uint8)


KINDS = {
    "grey": lambda photograph: photograph[..., 1],
    "rgb": lambda photograph: photograph,
    "deep": lambda photograph: photograph.astype(np.uint16) * 200,
    "signed": lambda photograph: photograph.astype(np.int16) * 100 - 9000,
    "bands": lambda photograph: np.concatenate([photograph, photograph[..., :2][:, ::-1]], axis=2),
    "float": lambda photograph: (photograph / 255).astype(np.float32),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", [{"edge_weight": 0}, {"edge_weight": 12}, {}], ids=str)
def test_by_strips_is_as_in_one_piece(photograph: Array, kind: str, way: dict[str, Any]) -> None:
    image = np.ascontiguousarray(KINDS[kind](photograph)[:200, 20:180])
    write(image)
    result, whole = segment_file("a.tif", "b.tif", 4, **way), segment(image, 4, **way)
    labels = tifffile.imread("b.tif")
    assert np.mean(labels == whole.labels) > 0.999
    np.testing.assert_array_equal(np.bincount(labels.ravel())[1:], result.masses)
    means = region_means(whole.labels, image)[1:]
    np.testing.assert_allclose(result.generators, means.reshape(result.generators.shape), rtol=1e-4)
    assert result.energy == pytest.approx(whole.energy, rel=1e-3)
    assert result.energies[-1] == pytest.approx(whole.energies[-1], rel=1e-4)
    assert (result.converged, result.exact, result.shape) == (True, True, image.shape)
    assert {path.name for path in Path().iterdir()} == {"a.tif", "b.tif"}


@pytest.mark.parametrize("radius", [1, 3, pytest.param(9, marks=pytest.mark.slow)])
def test_noise_leaves_no_seams(radius: int, monkeypatch: pytest.MonkeyPatch) -> None:
    image = noisy()
    write(image)
    monkeypatch.setattr(tiled_segmentation, "_ENOUGH_AVERAGES", 10_000)
    result = segment_file("a.tif", "b.tif", 3, edge_weight="auto", edge_radius=radius)
    whole = segment(image, 3, edge_weight="auto", edge_radius=radius)
    assert result.edge_weight == pytest.approx(whole.edge_weight, rel=1e-3)
    differs = tifffile.imread("b.tif") != whole.labels
    assert differs.mean() < 1e-3
    starts = np.arange(32, len(image), 32)
    near = np.abs(np.arange(len(image))[:, None] - starts).min(axis=1) <= radius
    assert differs[near].mean() <= differs[~near].mean() + 1e-3


def test_what_is_not_known_has_label_0(photograph: Array) -> None:
    image = photograph.copy()
    image[40:90, 30:200] = 7
    write(image)
    segment_file("a.tif", "b.tif", 4, edge_weight=9, nodata=7)
    expected = segment(image, 4, edge_weight=9, mask=(image != 7).any(axis=2))
    assert np.mean(tifffile.imread("b.tif") == expected.labels) > 0.999
    write(np.dstack([image, np.where((image == 7).all(axis=2), 0, 200).astype(np.uint8)]), extrasamples=["unassalpha"])
    segment_file("a.tif", "c.tif", 4, edge_weight=9)
    assert np.mean(tifffile.imread("c.tif") == tifffile.imread("b.tif")) > 0.999
    holes = np.where(image == 7, np.nan, image).astype(np.float32)
    write(holes)
    segment_file("a.tif", "d.tif", 4, edge_weight=9 * 255**2)
    assert ((tifffile.imread("d.tif") == 0) == np.isnan(holes).any(axis=2)).all()
    write(np.full((70, 50), 3, np.uint8))
    with pytest.raises(ValueError, match="at least one pixel that is known"):
        segment_file("a.tif", "e.tif", 2, nodata=3)
    assert {path.name for path in Path().iterdir()} == {f"{name}.tif" for name in "abcd"}


def test_exact_says_whether_all_colors_were_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    write(noisy((96, 80)).astype(np.uint16) * 200)
    assert segment_file("a.tif", "b.tif", 3).exact
    monkeypatch.setattr(counting, "MOST_COLORS", 500)
    assert not segment_file("a.tif", "b.tif", 3, overwrite=True).exact


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"n_segments": 0}, ValueError, "n_segments=0 must be in 1..65535"),
        ({"edge_radius": 31}, ValueError, "edge_radius=31"),
        ({"max_pixels": 60}, ValueError, "has over 60 pixels"),
        ({"target": "b.png"}, ValueError, "b.png: suffix"),
        ({"source": "missing.tif"}, OSError, "no such file"),
    ],
)
def test_wrong_arguments_are_named(options: dict[str, Any], error: type[Exception], message: str) -> None:
    write(noisy()[..., 0])
    given = {"source": "a.tif", "target": "b.tif", "n_segments": 2, **options}
    with pytest.raises(error, match=message):
        segment_file(**given)
    assert {path.name for path in Path().iterdir()} == {"a.tif"}


# The command


def test_large_tiffs_go_by_tiles_by_themselves(photograph: Array, monkeypatch: Any, run: Run) -> None:
    scale, points = (30.0, 30.0, 0.0), (0.0, 0.0, 0.0, 500.0, 900.0, 0.0)
    write(photograph, extratags=[(42113, 2, 2, "7", True), (33550, 12, 3, scale, True), (33922, 12, 6, points, True)])
    monkeypatch.setattr(tiles, "MOST_IN_MEMORY", 1000)
    monkeypatch.setattr("cvtimg.read_image", lambda path: pytest.fail("read in one piece"))
    how = ["segment", "a.tif", "-k", "4", "--edge-weight", "8", "--space", "oklab", "-o", "b.tif", "--json"]
    (row,) = run(*how).rows
    known = (photograph != 7).any(axis=2)
    expected = segment(photograph, 4, edge_weight=8, space="oklab", mask=known)
    assert np.mean(tifffile.imread("b.tif") == expected.labels) > 0.999
    assert (row["k"], row["left_out"], row["exact"]) == (4, (~known).sum(), True)
    assert image_info("b.tif").geo_transform == (30, 0, 500, 0, -30, 900)
    with tifffile.TiffFile("b.tif") as tiff:
        assert (tiff.pages.first.dtype, tiff.pages.first.is_tiled) == (np.uint8, True)
    assert row["energy"] == pytest.approx(expected.energy, rel=1e-4)
    assert "exists already" in run(*how).err
    assert "has over 65535 pixels" in run(*how, "--overwrite", "--max-pixels", "65535").err
    monkeypatch.setattr("PIL.Image.MAX_IMAGE_PIXELS", 1000)
    assert run(*how, "--overwrite").status == 0


def test_zarr_goes_by_tiles(photograph: Array, run: Run) -> None:
    source = zarr.create_array("a.zarr", shape=photograph.shape, chunks=(128, 128, 3), dtype=np.uint8)
    source[:] = photograph
    assert run("segment", "a.zarr", "-k", 3, "-o", "b.zarr").status == 0
    assert np.mean(zarr.open_array("b.zarr", mode="r")[:] == segment(photograph, 3).labels) > 0.999
    assert run("segment", "a.zarr", "-k", 300, "--edge-weight", 0, "-o", "many.zarr").status == 0
    many = zarr.open_array("many.zarr", mode="r")[:]
    assert (many.dtype, many.max()) == (np.uint16, 300)
    for outputs in (["--edges", "e.png"], ["-o", "c.zarr", "--mean", "m.png"]):
        said = run("segment", "a.zarr", "-k", 3, *outputs).err
        assert "a.zarr is read and written in tiles, and only labels can be" in said
    write_image("a.png", photograph)
    assert run("segment", "a.png", "-k", 3, "-o", "c.zarr").err.startswith("cvtimg: a.png: ")
    assert {path.name for path in Path().iterdir()} == {"a.zarr", "b.zarr", "many.zarr", "a.png"}


def test_what_needs_the_whole_picture_is_refused(photograph: Array, monkeypatch: Any, run: Run) -> None:
    write(photograph[:96, :96])
    monkeypatch.setattr(tiles, "MOST_IN_MEMORY", 1000)
    for options in (["--components"], ["--averaging", "2"], ["--superpixels"], ["-k", "auto"]):
        option = "-k auto" if "auto" in options else options[0]
        said = run("segment", "a.tif", "-k", 4, "-o", "b.tif", *options).err
        assert f"is read in tiles, and {option} needs the whole image" in said
        assert not Path("b.tif").exists()
    assert run("segment", "a.tif", "-k", 4, "-o", "b.png", "--components").status == 0
