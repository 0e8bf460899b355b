"""Claims about ``cvtimg segment``: what is asked for is written, agrees with the labels, and is named."""

import csv
import json
import os
import signal
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from commands import RowOf, Run
from images import discs
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

from cvtimg import find_contours, find_edges, read_image, segment, segment_hierarchy, write_image
from cvtimg._shared.types import Array
from cvtimg.batch.tasks import Task
from cvtimg.cli import app as cli
from cvtimg.cli import segment_command
from cvtimg.labels import read_labels, region_table
from cvtimg.options.segment_options import KINDS
from cvtimg.pictures import image_info
from cvtimg.plotting.sheets import draw_edges
from cvtimg.segmentation import RegionHierarchy

RNG = np.random.default_rng(6)
#: Soft blots of three colors.
FIELDS = gaussian_filter(RNG.normal(size=(40, 50, 3)), (4, 4, 0))
RGB = np.rint(255 * (FIELDS - FIELDS.min()) / np.ptp(FIELDS)).astype(np.uint8)

KEYS = {"input", "output", "width", "height", "channels", "left_out", "k", "elbow", "edge_weight", "regions"}
KEYS |= {"edge_length", "energy", "n_iter", "converged", "input_bytes", "output_bytes", "seconds"}


@pytest.fixture
def run(run: Run) -> Run:
    """Run ``cvtimg segment`` in an empty folder but for rgb.png."""
    write_image("rgb.png", RGB)
    return lambda *arguments: run("segment", *arguments, "--json")


def listing() -> set[str]:
    return {str(path) for path in Path().rglob("*") if path.is_file()}


def test_what_is_named_is_written_or_else_labels_beside_the_input(run: Run) -> None:
    (row,) = run("rgb.png", "-k", "3").rows
    assert listing() == {"rgb.png", "rgb-labels.png"}
    assert set(row) == KEYS
    assert (row["output"], row["k"], row["left_out"]) == ("rgb-labels.png", 3, 0)
    assert (row["width"], row["height"], row["channels"]) == (50, 40, 3)
    labels = read_labels("rgb-labels.png")
    assert np.unique(labels).tolist() == [1, 2, 3]
    brightness = [RGB[labels == label].mean() for label in (1, 2, 3)]
    assert brightness == sorted(brightness)
    assert run("rgb.png", "-k", "2", "--table", "t.csv", "--edges", "e.png").status == 0
    assert listing() == {"rgb.png", "rgb-labels.png", "t.csv", "e.png"}


def test_without_a_number_segments_are_the_regions_of_the_tree(run: Run) -> None:
    assert run("rgb.png", "-o", "regions.npy").status == 0
    np.testing.assert_array_equal(np.load("regions.npy"), segment_hierarchy(RGB).cut())


def test_every_output_agrees_with_the_labels(run: Run) -> None:
    files = ["-o", "l.npy", "--mean", "m.png", "--edges", "e.png", "--overlay", "o.png", "--table", "t.csv"]
    files += ["--contours", "v.svg", "--write", "contours.geojson"]
    looks = ["--edge-mode", "thick", "--line-color", "#ff8000", "--line-width", "2"]
    assert run("rgb.png", "-k", "3", *files, *looks).status == 0
    labels = np.load("l.npy")
    np.testing.assert_array_equal(read_image("e.png") > 0, find_edges(labels, mode="thick"))
    np.testing.assert_array_equal(read_image("o.png"), draw_edges(RGB, labels, color=(255, 128, 0), thickness=2))
    table = region_table(labels, RGB)
    with Path("t.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    assert names == ["image", *table]
    assert {row.pop(0) for row in rows} == {"rgb.png"}
    np.testing.assert_allclose(np.array(rows, float).T, list(table.values()))
    means = np.rint([RGB[labels == label].mean(axis=0) for label in (1, 2, 3)])
    np.testing.assert_array_equal(read_image("m.png"), means[labels - 1])
    features = json.loads(Path("rgb-contours.geojson").read_text())["features"]
    assert [one["properties"]["area"] for one in features] == table["area"].tolist()
    assert [one["properties"]["mean"][1] for one in features] == pytest.approx(table["mean_2"].tolist())
    assert Path("v.svg").read_text().count("<path") == 3


def places(file: str) -> list[Any]:
    """List the first ring of each polygon."""
    shapes = [one["geometry"] for one in json.loads(Path(file).read_text())["features"]]
    pieces = (shape["coordinates"] if shape["type"] == "MultiPolygon" else [shape["coordinates"]] for shape in shapes)
    return [polygon[0] for polygons in pieces for polygon in polygons]


def test_contours_are_exact_or_between_pixels_or_simple(run: Run) -> None:
    lengths = []
    for more in ([], ["--subpixel"], ["--simplify", "2"], ["--subpixel", "--simplify", "2"]):
        assert run("rgb.png", "-k", "2", "--contours", "a.geojson", "-o", "l.npy", *more, "--overwrite").status == 0
        options = {"tolerance": 2 if "2" in more else 0}
        contours = find_contours(np.load("l.npy"), RGB if "--subpixel" in more else None, **options)
        wanted = [polygon.rings[0] for polygon in contours.polygons]
        for found, ring in zip(places("a.geojson"), wanted, strict=True):
            np.testing.assert_allclose(found, ring, atol=1e-4)
        lengths.append(sum(map(len, wanted)))
    assert lengths[2] < lengths[0]
    assert lengths[3] < lengths[1]


def test_many_inputs_get_all_kinds_by_their_names(run: Run) -> None:
    write_image("grey.png", RGB[:, :, 0])
    kinds = [kind + suffix for kind, suffixes in KINDS.items() for suffix in suffixes[:2]]
    assert run("rgb.png", "grey.png", "-k", "2", "--out-dir", "out", "--write", ",".join(kinds)).status == 0
    made = {f"out/{name}-{kind}" for name in ("rgb", "grey") for kind in kinds}
    assert listing() == {"rgb.png", "grey.png", *made}
    assert run("rgb.png", "grey.png", "-k", "2", "--out-dir", "more").status == 0
    assert {name for name in listing() if name.startswith("more/")} == {"more/rgb-labels.png", "more/grey-labels.png"}


# What is left out


LEFT_OUT = np.zeros(RGB.shape[:2], bool)
LEFT_OUT[5:20, 8:30] = True


def test_masked_transparent_unknown_and_nodata_pixels_are_left_out(run: Run) -> None:
    write_image("mask.png", ~LEFT_OUT)
    write_image("rgba.png", np.dstack([RGB, np.where(LEFT_OUT, 0, 255).astype(np.uint8)]))
    for name, value in (("nan.npy", np.nan), ("nodata.npy", -9999.0)):
        np.save(name, np.where(LEFT_OUT, value, FIELDS[:, :, 0]))
    for given in ("rgb.png --mask mask.png", "rgba.png", "nan.npy", "nodata.npy --nodata -9999"):
        (row,) = run(*given.split(), "-k", "2", "-o", "l.npy", "--overwrite").rows
        np.testing.assert_array_equal(np.load("l.npy") == 0, LEFT_OUT)
        assert row["left_out"] == LEFT_OUT.sum()


def test_the_border_of_what_is_left_out_is_no_edge_and_has_no_color(run: Run) -> None:
    write_image("mask.png", ~LEFT_OUT)
    files = ["--edges", "e.png", "--mean", "m.png", "--contours", "a.geojson"]
    assert run("rgb.png", "-k", "1", "--mask", "mask.png", *files).status == 0
    assert not read_image("e.png").any()
    assert not read_image("m.png")[LEFT_OUT].any()
    (feature,) = json.loads(Path("a.geojson").read_text())["features"]
    assert len(feature["geometry"]["coordinates"]) == 2


#: Pixels of 10 m in UTM zone 33, of which 7 is nodata.
GEO = [
    (33550, "d", 3, (10.0, 10.0, 0.0)),
    (33922, "d", 6, (0.0, 0.0, 0.0, 500_000.0, 4_600_000.0, 0.0)),
    (34735, "H", 8, (1, 1, 0, 1, 3072, 0, 1, 32633)),
    (42113, "s", 0, "7"),
]


def test_contours_of_a_geotiff_are_in_its_coordinates_and_its_nodata_is_left_out(run: Run) -> None:
    image = np.zeros((6, 8), np.uint16)
    image[:, 4:] = 900
    image[0] = 7
    tifffile.imwrite("geo.tif", image, extratags=GEO)
    (row,) = run("geo.tif", "-k", "2", "--contours", "a.geojson").rows
    assert row["left_out"] == 8
    whole = json.loads(Path("a.geojson").read_text())
    assert whole["crs"]["properties"]["name"].endswith("EPSG::32633")
    left, right = places("a.geojson")
    for ring, west in ((left, 500_000), (right, 500_040)):
        x, y = np.array(ring).T
        assert (x.min(), x.max(), y.min(), y.max()) == (west, west + 40, 4_599_940, 4_599_990)


@pytest.mark.parametrize("is_in_meters", [True, False])
def test_a_table_of_a_geotiff_is_in_its_coordinates(run: Run, is_in_meters: bool) -> None:
    image = np.zeros((6, 8), np.uint16)
    image[:, 4:] = 900
    keys = (1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32633 if is_in_meters else 2263)
    tifffile.imwrite("geo.tif", image, extratags=[*GEO[:2], (34735, "H", len(keys), keys)])
    run("geo.tif", "-k", "2", "--table", "a.csv")
    header, first, _ = (line.split(",") for line in Path("a.csv").read_text().splitlines())
    row = dict(zip(header, first, strict=True))
    assert (float(row["x_map"]), float(row["y_map"])) == (500_020, 4_599_970)
    assert row.get("area_m2") == ("2400" if is_in_meters else None)


def test_superpixels_may_be_more_than_segments(run: Run) -> None:
    write_image("flat.png", RNG.integers(0, 256, (280, 300), np.uint8))
    (row,) = run("flat.png", "-k", "70000", "--superpixels", "-o", "l.npy").rows
    assert row["k"] == np.load("l.npy").max() > 65536
    assert "1..65536" in run("flat.png", "-k", "70000").err


def test_labels_and_reduced_colors_of_a_geotiff_lie_where_it_does(run: Run) -> None:
    rgb = np.repeat(RGB, 2, axis=0)
    tifffile.imwrite("geo.tif", rgb, photometric="rgb", extratags=GEO)
    assert run("geo.tif", "-k", "2", "-o", "labels.tif", "--mean", "mean.tif").status == 0
    drawn = ["--strengths", "strengths.tif", "--edges", "edges.tif", "--overlay", "overlay.tif"]
    assert run("geo.tif", "--hierarchy", *drawn).status == 0
    assert cli.main(["quantize", "geo.tif", "-k", "3", "-o", "few.tif", "--quiet"]) == 0
    place = image_info("geo.tif").geo_transform
    assert place == (10, 0, 500_000, 0, -10, 4_600_000)
    for name in ("labels", "mean", "few", "strengths", "edges", "overlay"):
        assert image_info(f"{name}.tif").geo_transform == place
    # 7 is a label like others; 0 stands for pixels that are left out.
    assert [image_info(name).nodata for name in ("labels.tif", "few.tif")] == [0, None]


# How it is segmented


@pytest.fixture
def micrograph(run: Run) -> NDArray[np.uint16]:
    """Write stack.tif as ImageJ does: two channels in three planes, with pixels of 0.5 um."""
    stack = RNG.integers(0, 900, (3, 2, 20, 30), np.uint16)
    stack[:, 0, 5:15, 10:20] += 30000
    metadata = {"axes": "ZCYX", "unit": "um", "spacing": 2.0, "Labels": ["DAPI", "GFP"] * 3}
    tifffile.imwrite("stack.tif", stack, imagej=True, resolution=(2, 2), metadata=metadata)
    return stack


def test_outputs_are_in_the_units_of_the_image(run: Run, micrograph: NDArray[np.uint16]) -> None:
    outputs = ["-o", "l.tif", "--table", "t.csv", "--contours", "c.geojson", "--mean", "m.tif"]
    assert run("stack.tif", "-k", 2, "--channel", "DAPI", "--z", 2, *outputs).status == 0
    lines = Path("t.csv").read_text().splitlines()
    rows = [{name: float(value) for name, value in row.items() if name != "image"} for row in csv.DictReader(lines)]
    for row in rows:
        assert row["area_um2"] == row["area"] / 4
        for name in ("x", "y", "perimeter"):
            assert row[f"{name}_um"] == pytest.approx(row[name] / 2)
        assert row["equivalent_diameter_um"] == pytest.approx(np.sqrt(row["area"] / np.pi))
    assert (rows[1]["area"], rows[1]["x_um"]) == (100, 7.5)
    assert rows[1]["mean_DAPI"] == pytest.approx(micrograph[1, 0, 5:15, 10:20].mean())
    drawn = json.loads(Path("c.geojson").read_text())
    assert drawn["unit"] == "um"
    assert np.ptp(drawn["features"][1]["geometry"]["coordinates"][0], axis=0).tolist() == [5, 5]
    for name in ("l.tif", "m.tif"):
        with tifffile.TiffFile(name) as tiff:
            assert (tiff.imagej_metadata or {})["unit"] == "um"
            assert tiff.pages.first.aspage().get_resolution() == pytest.approx((2, 2))


@pytest.mark.usefixtures("micrograph")
def test_the_smallest_detail_may_be_a_length(row_of: RowOf) -> None:
    given = ["stack.tif", "-k", 2, "--z", 1, "--overwrite", "-o", "l.tif", "--smallest-detail"]
    in_pixels, *by_length = (row_of(*given, size)["edge_weight"] for size in (2, "1um", "1000nm"))
    assert by_length == pytest.approx([in_pixels] * 2)


def test_intensities_are_columns_by_the_names_of_channels(run: Run, micrograph: NDArray[np.uint16]) -> None:
    outputs = ["--table", "t.csv", "-o", "l.tif", "--pixel-size", "1x1x3nm"]
    assert run("stack.tif", "-k", 2, "--properties", "intensity_max,centroid", *outputs).status == 0
    assert str(image_info("l.tif").pixel_size) == "1 x 1 x 3 nm"
    columns = Path("t.csv").read_text().splitlines()[0].split(",")
    assert {"mean_DAPI", "std_GFP", "intensity_max_DAPI", "intensity_max_GFP", "centroid-0"} <= {*columns}


def test_objects_are_counted_without_settings_and_what_was_measured_is_told(run: Run) -> None:
    inside = discs([(20, 16, 9), (20, 40, 9)], (40, 60)) > 0
    write_image("cells.png", np.uint8(40 + 150 * inside + RNG.integers(0, 9, inside.shape)))
    outcome = run("cells.png", "--objects", "-o", "l.png", "--table", "t.csv")
    assert (outcome.rows[0]["k"], outcome.rows[0]["dark"]) == (2, False)
    assert outcome.rows[0]["radius"] == pytest.approx(9, abs=1)
    assert len(np.unique(read_labels("l.png"))) == 3
    write_image("empty.png", np.full((9, 9), 7, np.uint8))
    kinds = ["--write", "table,overlay,contours.geojson,mean,edges"]
    assert run("empty.png", "--objects", *kinds).rows[0]["k"] == 0


# Hierarchies


@pytest.fixture
def small(photograph: Array) -> Array:
    image = np.asarray(Image.fromarray(photograph).resize((96, 80)))
    write_image("photo.png", image)
    return image


@pytest.fixture
def tree(run: Run) -> RowOf:
    """Run ``cvtimg segment --hierarchy``."""
    return lambda *arguments: run("photo.png", "--hierarchy", *arguments).rows[0]


def test_all_outputs_of_a_hierarchy_are_written(small: Array, tree: RowOf) -> None:
    row = tree("-k", "7", "--write", "labels.npy,table,tree,strengths,strengths.npy,overlay")
    hierarchy = segment_hierarchy(small)
    assert row["k"] == 7
    np.testing.assert_array_equal(np.load("photo-labels.npy"), hierarchy.cut(7))
    np.testing.assert_array_equal(RegionHierarchy.load("photo-tree.npz").cut(30), hierarchy.cut(30))
    strengths = np.load("photo-strengths.npy")
    np.testing.assert_array_equal(strengths, hierarchy.find_edges(strength=True))
    np.testing.assert_array_equal(read_image("photo-strengths.png"), np.rint(255 * strengths))
    assert Path("photo-table.csv").read_text().count("\n") == 8


def test_auto_cuts_at_the_threshold(small: Array, tree: RowOf) -> None:
    hierarchy = segment_hierarchy(small)
    for number in (["-k", "auto"], []):
        assert tree(*number, "-o", "a.png", "--overwrite")["k"] == hierarchy.n_regions()
        row = tree(*number, "--threshold", "0.6", "-o", "b.png", "--overwrite")
        assert row["k"] == hierarchy.n_regions(0.6)


@pytest.mark.slow
def test_contours_by_chance_are_lines_that_tell_it(small: Array, tree: RowOf) -> None:
    tree("--chance", "0.2", "--contours", "lines.geojson", "--write", "contours.svg")
    found = segment_hierarchy(small).find_lines(0.2)
    features = json.loads(Path("lines.geojson").read_text())["features"]
    assert [feature["geometry"]["coordinates"] for feature in features] == [line.tolist() for line in found.lines]
    np.testing.assert_allclose([feature["properties"]["chance"] for feature in features], found.chances, atol=1e-4)
    assert Path("photo-contours.svg").read_text().count("data-chance=") == len(found.lines)
    tree("--strongest", "3", "--contours", "lines.svg", "--simplify", "1")
    assert Path("lines.svg").read_text().count("data-chance=") == 3


# Objects


@pytest.fixture
def cells() -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Two discs that touch and one that does not, in a file of the folder that tests work in."""
    inside = discs([(20, 20, 10), (20, 36, 10), (40, 70, 10)], (60, 90)) > 0
    image = np.clip(40 + 150 * inside + np.random.default_rng(0).normal(0, 9, inside.shape), 0, 255).astype(np.uint8)
    write_image("cells.png", image)
    return image


def test_objects_are_split_and_the_background_is_in_no_table(cells: np.ndarray[Any, Any], row_of: RowOf) -> None:
    how = ["cells.png", "-k", "2", "--edge-weight", "auto", "--objects", "--properties", "eccentricity, solidity"]
    outputs = ["-o", "l.png", "--table", "t.csv", "--overlay", "o.png", "--contours", "c.svg"]
    row = row_of(*how, *outputs)
    labels = read_labels("l.png")
    assert row["k"] == labels.max() == 3
    assert row["left_out"] == (labels == 0).sum() > labels.size / 2
    with Path("t.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["label"]) for row in rows] == [1, 2, 3]
    assert all(float(row["eccentricity"]) < 0.6 and float(row["solidity"]) > 0.9 for row in rows)
    drawn = (read_image("o.png") == [255, 255, 0]).all(axis=2)
    assert drawn.sum() > 3 * 40  # the rims of all three, though their other side has label 0
    assert row_of(*how, "--neck-depth", 9, "-o", "m.png")["k"] == 2


def test_auto_counts_what_is_segmented(cells: np.ndarray[Any, Any], row_of: RowOf) -> None:
    known = np.broadcast_to(np.arange(90) < 60, cells.shape)
    write_image("mask.png", known)
    how = ["--averaging", "2", "--edge-weight", "auto", "--mask", "mask.png"]
    row = row_of("cells.png", "-k", "auto", *how)
    expected = segment(cells, "auto", averaging=2, edge_weight="auto", mask=known)
    assert expected.n_segments != segment(cells, "auto").n_segments
    assert expected.curve is not None
    assert row["k"] == expected.n_segments
    assert row["elbow"] == expected.curve.elbows()
    np.testing.assert_array_equal(read_labels("cells-labels.png"), expected.labels)


@pytest.mark.parametrize(
    ("measure", "columns"),
    [("all", ["mean_DAPI", "mean_GFP"]), ("GFP", ["mean_GFP"]), ("2,DAPI", ["mean_GFP", "mean_DAPI"])],
)
def test_one_channel_is_segmented_and_others_are_measured(run: Run, measure: str, columns: list[str]) -> None:
    down, right = np.mgrid[:60, :90]
    nuclei = np.uint8(20 + 150 * ((np.hypot(down - 30, right - 25) < 9) | (np.hypot(down - 30, right - 65) < 9)))
    metadata = {"axes": "CYX", "Labels": ["DAPI", "GFP"]}
    tifffile.imwrite("a.tif", np.stack([nuclei, right.astype(np.uint8)]), imagej=True, metadata=metadata)
    how = ["--objects", "--channel", "DAPI", "--measure", measure, "--table", "t.csv"]
    assert run("a.tif", *how).status == 0
    header, *rows = (line.split(",") for line in Path("t.csv").read_text().splitlines())
    assert [name for name in header if name.startswith("mean")] == columns
    means = sorted(float(row[header.index("mean_GFP")]) for row in rows)
    assert means == pytest.approx([25, 65], abs=0.5)
    assert run("a.tif", *how[:4], "RFP", "--table", "u.csv").status == 1


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_one_table_has_the_objects_of_all_images_and_a_run_that_goes_on_keeps_its_rows(
    cells: np.ndarray[Any, Any], run: Run, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for place, image in {"a/one.png": cells, "a/two.png": 255 - cells, "b/one.png": cells[:30]}.items():
        Path(place).parent.mkdir(exist_ok=True)
        write_image(place, image)
    table, how = Path(f"all.{suffix}"), ["a", "b", "--objects", "--table", f"all.{suffix}"]
    assert run(*how).status == 0
    assert run(*how).status != 0  # the file is there
    whole, last = table.read_bytes(), Path("b/one.png").read_bytes()
    table.unlink()
    if suffix == "csv":
        segment_one = segment_command._segment

        def stopped(task: Task, *way: Any, **more: Any) -> Any:
            return os.kill(os.getpid(), signal.SIGINT) if "b" in task.source.parts else segment_one(task, *way, **more)

        with monkeypatch.context() as patch:
            patch.setattr(segment_command, "_segment", stopped)
            assert run(*how).status == 130
    else:
        Path("b/one.png").write_bytes(b"")
        assert run(*how).status == 1
        Path("b/one.png").write_bytes(last)
    resumed = run(*how, "--skip-existing")
    assert [row.get("skipped", False) for row in resumed.rows] == [True, True, False]
    if suffix == "csv":
        assert table.read_bytes() == whole
        Path("other.csv").write_text("a,b\n1,2\n")
        assert "--table: other.csv has no rows of images" in run(*how[:-1], "other.csv", "--skip-existing").err
        with table.open() as file:
            images = Counter(row["image"] for row in csv.DictReader(file))
        assert images == {"a/one.png": 3, "two.png": 3, "b/one.png": 2}
