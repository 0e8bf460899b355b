import io
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from reference import shoelace
from skimage import data
from skimage.draw import polygon
from skimage.segmentation import slic

import cvtimg
from cvtimg import mosaic, read_image
from cvtimg._shared.pixels import peak
from cvtimg.artwork import tilings
from cvtimg.artwork.tilings import DelaunayTiling, Painted, VoronoiTiling, division_gains, paint, removal_costs

PHOTO = data.coffee()[::3, ::3]


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(-10 * np.log10(((a.astype(float) - b) ** 2).mean() / 255**2))


@pytest.mark.parametrize("shape", ["cells", "triangles"])
@pytest.mark.parametrize("n_cells", [2, 3, 50, 301])
def test_tiles_are_as_many_as_asked_for_and_fill_the_image_in_their_mean_colors(shape: str, n_cells: int) -> None:
    result = mosaic(PHOTO, n_cells, shape=shape, effort="fast")
    assert len(result.colors) == n_cells == len(result.polygons())
    for tile in np.unique(result.labels)[:20]:
        mean = PHOTO[result.labels == tile].mean(axis=0)
        assert np.abs(result.colors[tile] - mean).max() <= 0.51
    squared = ((result.image.astype(float) - PHOTO) ** 2).sum()
    assert squared == pytest.approx(result.energy, rel=0.02)
    assert sum(map(shoelace, result.polygons())) == pytest.approx(PHOTO.shape[0] * PHOTO.shape[1])


@pytest.mark.parametrize("shape", ["cells", "triangles"])
def test_the_descent_lowers_the_error_and_keeps_the_least(shape: str) -> None:
    result = mosaic(PHOTO, 200, shape=shape)
    assert result.energy == pytest.approx(min(result.energies))
    assert result.energy < 0.8 * result.energies[0]


def test_cells_are_nearer_to_the_image_than_superpixels_in_their_means() -> None:
    labels = slic(PHOTO, n_segments=400, start_label=0, compactness=10)
    means = np.stack([PHOTO[labels == label].mean(axis=0) for label in range(labels.max() + 1)])
    assert psnr(mosaic(PHOTO, labels.max() + 1).image, PHOTO) > psnr(means[labels], PHOTO) + 1


@pytest.mark.parametrize("shape", ["cells", "triangles"])
def test_the_gradient_is_what_differences_of_the_error_tell(shape: str) -> None:
    # A smooth image, where steps of whole pixels average out.
    y, x = np.mgrid[:90, :120] / 30
    image = np.stack([np.sin(x + y), np.cos(1.5 * y - x)], axis=2).astype(np.float32)
    rng = np.random.default_rng(0)
    points = rng.random((12, 2)) * [100, 70] + 10
    corners = np.array([[0, 0], [120, 0], [120, 90], [0, 90]], np.float64)
    tiling: VoronoiTiling | DelaunayTiling
    if shape == "cells":
        tiling = VoronoiTiling((90, 120), len(points))
    else:
        points = np.concatenate([corners, points])
        tiling = DelaunayTiling((90, 120), points)

    labels = tiling.labels(points)

    def painted(places: np.ndarray) -> Painted:
        if isinstance(tiling, DelaunayTiling):
            for label, triangle in enumerate(tiling.triangles):  # as they are: others would be another error
                labels[polygon(*(places[triangle, ::-1].T - 0.5), labels.shape)] = label
            return paint(image, labels, tiling.n_tiles)
        return paint(image, tiling.labels(places), tiling.n_tiles)

    gradient = tiling.gradient(image, points, painted(points))
    moved = range(4, len(points)) if shape == "triangles" else range(len(points))
    differences = np.zeros_like(points)
    for point in moved:
        for axis in (0, 1):
            step = np.zeros_like(points)
            step[point, axis] = 1.0
            differences[point, axis] = (painted(points + step).energy - painted(points - step).energy) / 2
    chosen = list(moved)
    error = np.abs(gradient - differences)[chosen].max()
    assert error < 0.12 * np.abs(differences).max()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float64])
def test_mosaics_are_of_the_type_of_the_image(dtype: type) -> None:
    assert mosaic((PHOTO / 255 * peak(np.dtype(dtype))).astype(dtype), 9, effort="fast").image.dtype == dtype


def test_gray_stays_gray_and_alpha_stays_alpha() -> None:
    gray = PHOTO[:, :, 0]
    assert mosaic(gray, 9, effort="fast").image.shape == gray.shape
    alpha = np.where(np.arange(gray.shape[1]) < 100, 0, 255).astype(np.uint8)
    image = np.dstack([PHOTO, np.broadcast_to(alpha, gray.shape)])
    result = mosaic(image, 150, space="oklab")
    assert set(np.unique(result.image[:, 130:, 3])) == {255}
    assert not result.image[:, :70, 3].any()


@pytest.mark.parametrize("shape", ["cells", "triangles"])
def test_a_shape_without_half_transparency_has_no_slivers_nor_lines_around_it(tmp_path: Path, shape: str) -> None:
    y, x = np.mgrid[: PHOTO.shape[0], : PHOTO.shape[1]]
    apart = np.hypot(x - 100, y - 66) - 50
    image = np.dstack([PHOTO, np.where(apart < 0, 255, 0).astype(np.uint8)])
    result = mosaic(image, 150, shape=shape)
    assert set(np.unique(result.colors[:, 3])) == {0, 255}
    assert not result.draw(outline=1)[apart > 8, 3].any()
    result.save(tmp_path / "a.geojson")
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert {feature["properties"]["fill-opacity"] for feature in features} == {1}


def test_a_palette_restricts_the_colors() -> None:
    assert len(np.unique(mosaic(PHOTO, 100, palette=5, effort="fast").colors, axis=0)) == 5
    palette = np.array([[0, 0, 0], [255, 128, 0], [255, 255, 255]], np.uint8)
    found = np.unique(mosaic(PHOTO, 100, palette=palette, effort="fast").colors, axis=0)
    assert {tuple(color) for color in found.tolist()} <= {tuple(color) for color in palette.tolist()}


@pytest.mark.parametrize("shape", ["cells", "triangles"])
def test_files_hold_each_tile_once(tmp_path: Path, shape: str) -> None:
    result = mosaic(PHOTO, 40, shape=shape, effort="fast")
    result.save(tmp_path / "a.svg")
    paths = [node for node in ElementTree.parse(tmp_path / "a.svg").iter() if node.tag.endswith("path")]
    assert len(paths) == 40
    assert all(node.get("fill") == node.get("stroke") for node in paths)
    result.save(tmp_path / "a.geojson")
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert len(features) == 40
    assert sum(feature["properties"]["pixels"] for feature in features) == result.labels.size
    result.save(tmp_path / "a.png")
    assert psnr(read_image(tmp_path / "a.png"), result.image) > 25
    result.save(tmp_path / "b.png", outline=2, scale=2)
    assert read_image(tmp_path / "b.png").shape == (2 * PHOTO.shape[0], 2 * PHOTO.shape[1], 3)
    with pytest.raises(FileExistsError, match="exists"):
        result.save(tmp_path / "b.png")
    with pytest.raises(ValueError, match=r"suffix='.xyz' must be one of .svg"):
        result.save(tmp_path / "b.xyz")


@pytest.mark.parametrize("shape", ["cells", "triangles"])
def test_tiles_without_pixels_have_the_color_of_the_place_where_they_are(shape: str) -> None:
    image = np.full((8, 8), 30, np.uint8)
    image[:, 4:] = 200
    result = mosaic(image, 64, shape=shape)
    tiles = result.points if result.triangles is None else result.points[result.triangles].mean(axis=1)
    empty = np.bincount(result.labels.ravel(), minlength=64) == 0
    assert empty.any()
    assert np.array_equal(result.colors[empty, 0], np.where(tiles[empty, 0] < 4, 30, 200))


@pytest.mark.parametrize("shape", ["cells", "triangles"])
@pytest.mark.parametrize("scale", [0.37, 1.0, *(pytest.param(s, marks=pytest.mark.slow) for s in (1.3, 2.71))])
def test_no_background_shines_through_when_rendered(tmp_path: Path, shape: str, scale: float) -> None:
    resvg = pytest.importorskip("resvg_py")
    result = mosaic(PHOTO, 120, shape=shape, effort="fast")
    result.save(tmp_path / "a.svg")
    width = round(PHOTO.shape[1] * scale)

    def rendered(background: str) -> np.ndarray:
        found = resvg.svg_to_bytes(svg_path=str(tmp_path / "a.svg"), width=width, background=background)
        with Image.open(io.BytesIO(bytes(found))) as image:
            return np.asarray(image.convert("RGB"))[1:-1, 1:-1]

    assert np.array_equal(rendered("#ff00ff"), rendered("#00ff00"))
    if scale == 1:
        assert psnr(rendered("#000000"), result.draw()[1:-1, 1:-1]) > 30


def test_opaque_tiles_are_drawn_twice_without_seams_and_translucent_ones_once(tmp_path: Path) -> None:
    alpha = np.full(PHOTO.shape[:2], 255, np.uint8)
    alpha[:, : alpha.shape[1] // 2] = 128
    mosaic(np.dstack([PHOTO, alpha]), 40, effort="fast").save(tmp_path / "a.svg")
    text = (tmp_path / "a.svg").read_text()
    assert '<use href="#tiles"' in text
    twice, once = text[text.index('<g id="tiles">') :].split("</g>")[:2]
    assert twice.count("<path") > 0 < once.count("<path")
    assert "opacity" not in twice
    assert once.count("opacity") == once.count("<path")


SAMPLES = Path(__file__).parents[2] / "sample_images"


def strips(n_columns: int, n_strips: int) -> np.ndarray:
    """Label strips of equal width."""
    return np.tile(np.repeat(np.arange(n_strips, dtype=np.int32), n_columns // n_strips), (10, 1))


def test_removing_a_cell_costs_its_pixels_the_difference_to_the_neighbor():
    labels = strips(40, 2)
    image = np.where(labels == 0, 0.25, 0.75).astype(np.float32)[:, :, np.newaxis]
    costs = removal_costs(paint(image, labels, 2))
    assert costs == pytest.approx([200 * 0.25, 200 * 0.25])


@pytest.mark.parametrize("turned", [False, True])
def test_the_gain_of_a_division_is_that_of_two_halves(turned):
    ramp = np.tile(np.arange(40, dtype=np.float32), (10, 1))
    image, whole, halves = ramp[:, :, np.newaxis], strips(40, 1), strips(40, 2)
    if turned:
        image, whole, halves = (np.ascontiguousarray(np.swapaxes(a, 0, 1)) for a in (image, whole, halves))
    gains, middles, offsets = division_gains(image, paint(image, whole, 1))
    true = paint(image, whole, 1).energy - paint(image, halves, 2).energy
    assert gains[0] == pytest.approx(true, rel=1e-2)
    center, half = ([5, 20], [0, 10]) if turned else ([20, 5], [10, 0])
    assert middles[0] == pytest.approx(center)
    assert np.abs(offsets[0]) == pytest.approx(half, abs=0.05)


@pytest.mark.parametrize(("effort", "n_steps"), [("fast", 25), ("balanced", 80), ("best", 480)])
def test_efforts_are_numbers_of_steps(effort: Any, n_steps: int) -> None:
    assert len(cvtimg.mosaic(PHOTO[:9, :9], 3, effort=effort).energies) == n_steps + 1


@pytest.mark.parametrize(("n_cells", "n_starts"), [(64, 2), (65, 1)])
def test_few_cells_begin_twice(n_cells: int, n_starts: int) -> None:
    steps: list[int] = []
    cvtimg.mosaic(PHOTO[:40, :40], n_cells, effort="fast", callback=lambda step, energy: steps.append(step))
    assert steps == n_starts * list(range(26))


def test_relocation_lowers_the_error_of_a_mosaic(monkeypatch):
    image = cvtimg.read_image(SAMPLES / "bone_texture.png")[::2, ::2]
    relocated = cvtimg.mosaic(image, 300).energy
    monkeypatch.setattr(tilings, "DESCENT", tilings.Descent(every=10**9))
    assert relocated < 0.99 * cvtimg.mosaic(image, 300).energy


def test_cells_that_settle_on_a_smaller_image_first_fit_better(monkeypatch):
    image = cvtimg.read_image(SAMPLES / "coffee.png")[:200, :300]
    both = cvtimg.mosaic(image, 200, effort="fast").energy
    monkeypatch.setattr(tilings, "DESCENT", tilings.Descent(coarsest=np.inf))
    assert both < 0.99 * cvtimg.mosaic(image, 200, effort="fast").energy
