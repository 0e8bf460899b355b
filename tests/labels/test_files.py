"""Claims about files of segments."""

import csv
import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import tifffile
from PIL import Image
from reference import inside_rings, signed_area
from skimage.color import rgb2lab

from cvtimg import find_contours
from cvtimg._shared.types import Floats
from cvtimg.labels import Drawing, read_labels, region_table, write_contours, write_labels, write_table
from cvtimg.pictures import read_indices, write_image

RNG = np.random.default_rng(4)
LABELS = np.kron(RNG.integers(0, 5, (5, 7)), np.ones((3, 2), int))
IMAGE = RNG.integers(0, 256, (*LABELS.shape, 3), np.uint8)


# Labels


@pytest.mark.parametrize(
    ("name", "highest", "dtype"),
    [
        ("a.png", 255, np.uint8),
        ("a.png", 256, np.uint16),
        ("a.tif", 255, np.uint8),
        ("a.tiff", 65535, np.uint16),
        ("a.tif", 65536, np.uint32),
        ("a.npy", 7, np.int32),
        ("a.npy", 70000, np.int32),
    ],
)
def test_labels_come_back_from_the_least_depth_that_holds_them(
    tmp_path: Path, name: str, highest: int, dtype: type
) -> None:
    labels = np.array([[0, 1, 2], [highest, 3, 1]])
    write_labels(tmp_path / name, labels)
    if name.endswith(".npy"):
        back = np.load(tmp_path / name)
    else:
        back = tifffile.imread(tmp_path / name) if ".tif" in name else read_indices(tmp_path / name)
    assert back.dtype == dtype
    np.testing.assert_array_equal(back, labels)
    np.testing.assert_array_equal(read_labels(tmp_path / name), labels)


def test_labels_are_read_from_equal_bands_and_from_colors(tmp_path: Path) -> None:
    mask = np.array([[0, 255, 255], [0, 0, 255]], np.uint8)
    colors = np.array([[0, 0, 0], [9, 200, 0], [250, 0, 7]], np.uint8)
    shown = np.array([[0, 1, 1], [2, 0, 1]])
    opaque = np.full((2, 3, 1), 255, np.uint8)
    for image, expected in {
        "gray": (np.stack([mask] * 3, axis=2), mask),
        "with alpha": (np.dstack([mask, mask, mask, opaque]), mask),
        "clear": (np.dstack([opaque] * 3 + [mask]), mask),
        "black on nothing": (np.dstack([opaque * 0] * 3 + [mask]), mask // 255),
        "black": (np.dstack([opaque * 0] * 3 + [opaque]), mask * 0),
        "colors": (colors[shown], shown),
        "colors with alpha": (np.dstack([colors[shown], opaque]), shown),
    }.values():
        write_image(tmp_path / "a.png", image, overwrite=True)
        np.testing.assert_array_equal(read_labels(tmp_path / "a.png"), expected)
    write_image(tmp_path / "a.png", np.random.default_rng(0).integers(0, 256, (20, 20, 3), np.uint8), overwrite=True)
    with pytest.raises(ValueError, match=r"colors of an image of labels must have at most 256.* segment a photograph"):
        read_labels(tmp_path / "a.png")


def test_labels_in_a_png_can_be_seen_apart(tmp_path: Path) -> None:
    labels = np.arange(256).reshape(16, 16)
    write_labels(tmp_path / "a.png", labels)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.mode == "P"
        np.testing.assert_array_equal(np.asarray(picture), labels)  # what other programs read
        seen = rgb2lab(np.asarray(picture.convert("RGB")) / 255).reshape(256, 3)
    assert seen[0].tolist() == [0, 0, 0]
    assert seen[1:, 0].min() > 30  # of 100
    for step in (1, 2, 3):
        assert np.linalg.norm(seen[1 + step :] - seen[1:-step], axis=1).min() > 20
    assert len(np.unique(seen, axis=0)) == 256


def test_labels_that_a_file_cannot_hold_are_refused_and_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"must be in 0\.\.65535, which \.png holds; use \.tif or \.npy"):
        write_labels(tmp_path / "a.png", [[65536]])
    with pytest.raises(ValueError, match=r"suffix='\.jpg' must be one of \.png, \.tif, \.tiff, \.npy"):
        write_labels(tmp_path / "a.jpg", [[1]])
    assert not list(tmp_path.iterdir())


# Tables


def test_a_table_reads_back_exactly(tmp_path: Path) -> None:
    table = region_table(LABELS, IMAGE)
    write_table(tmp_path / "a.csv", table)
    with (tmp_path / "a.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    assert names == list(table)
    assert names[:9] == ["label", "area", "perimeter", "x", "y", "left", "top", "right", "bottom"]
    np.testing.assert_array_equal(np.array(rows, float).T, list(table.values()))
    assert rows[0][:2] == ["1", str(int((LABELS == 1).sum()))]


# Contours


@pytest.mark.parametrize("image", [None, IMAGE])
def test_svg_paths_cover_the_segments_in_their_colors(tmp_path: Path, image: Any) -> None:
    colors = RNG.integers(0, 256, (5, 3), np.uint8)
    write_contours(tmp_path / "a.svg", Drawing(find_contours(LABELS, image).polygons, LABELS.shape, colors, {}))
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("14", "15", "0 0 14 15")
    (group,) = root
    assert group.get("fill-rule") == "evenodd"
    assert [path.get("id") for path in group] == [f"segment-{label}" for label in (1, 2, 3, 4)]
    for label, path in enumerate(group, 1):
        assert path.get("fill") == "#{:02x}{:02x}{:02x}".format(*colors[label])
        drawing = path.get("d", "")
        assert re.fullmatch(r"(M-?[\d.]+,[\d.]+( [\d.]+,[\d.]+)+Z)+", drawing)
        rings = [
            np.array([*places, places[0]], float)
            for ring in drawing.removesuffix("Z").split("Z")
            for places in [[place.split(",") for place in ring.removeprefix("M").split(" ")]]
        ]
        np.testing.assert_array_equal(inside_rings(rings, LABELS.shape), label == LABELS)


def features(path: Path) -> dict[int, list[list[Floats]]]:
    """Read the polygons of each label."""
    whole = json.loads(path.read_text())
    assert whole["type"] == "FeatureCollection"
    found = {}
    for feature in whole["features"]:
        shape = feature["geometry"]
        pieces = [shape["coordinates"]] if shape["type"] == "Polygon" else shape["coordinates"]
        assert (len(pieces) > 1) == (shape["type"] == "MultiPolygon")
        found[feature["properties"]["label"]] = [[np.array(ring) for ring in piece] for piece in pieces]
    return found


def test_geojson_polygons_cover_the_segments(tmp_path: Path) -> None:
    properties = {label: {"area": label * 10} for label in range(1, 5)}
    drawing = Drawing(find_contours(LABELS).polygons, LABELS.shape, IMAGE[0], properties)
    write_contours(tmp_path / "a.geojson", drawing)
    whole = json.loads((tmp_path / "a.geojson").read_text())
    assert [one["properties"] for one in whole["features"]] == [{"label": n, "area": 10 * n} for n in range(1, 5)]
    assert "crs" not in whole
    for label, pieces in features(tmp_path / "a.geojson").items():
        rings = [ring for piece in pieces for ring in piece]
        np.testing.assert_array_equal(inside_rings(rings, LABELS.shape), label == LABELS)


@pytest.mark.parametrize(
    "transform",
    [
        None,
        [[30, 0, 500_000], [0, -30, 4_600_000]],  # north up: mirrored
        [[1e-5, 0, 12.5], [0, -1e-5, 47.25]],
        [[0, 2, 0], [2, 0, 0]],  # mirrored
        [[0, -2, 0], [2, 0, 0]],  # turned
    ],
)
def test_outer_rings_run_counterclockwise_and_places_are_where_the_transform_leads(
    tmp_path: Path, transform: Any
) -> None:
    labels = np.ones((9, 9), int)
    labels[3:6, 2:5] = 2
    drawing = Drawing(find_contours(labels).polygons, (9, 9), IMAGE[0], {1: {}, 2: {}}, transform, epsg=32633)
    write_contours(tmp_path / "a.geojson", drawing)
    found = features(tmp_path / "a.geojson")
    matrix = np.eye(2, 3) if transform is None else np.array(transform, float)
    pixel = abs(np.linalg.det(matrix[:, :2]))
    assert [signed_area(ring) / pixel for ring in found[1][0]] == pytest.approx([81, -9], rel=1e-3)
    assert [signed_area(ring) / pixel for ring in found[2][0]] == pytest.approx([9], rel=1e-3)
    wanted = {tuple(matrix @ (x, y, 1)) for x in (2, 5) for y in (3, 6)}
    for place in found[2][0][0]:
        assert min(np.hypot(*(np.array(place) - corner)) for corner in wanted) < 1e-4 * pixel**0.5
    system = json.loads((tmp_path / "a.geojson").read_text())["crs"]
    assert system["properties"]["name"] == "urn:ogc:def:crs:EPSG::32633"
