"""No command loses a page: it treats all of them, or says that it takes one image."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from commands import RowOf
from images import discs

from cvtimg import find_edges, quantize, read_image, restore, segment
from cvtimg._shared.types import Array, Bytes
from cvtimg.cli.app import main
from cvtimg.labels import mean_picture, track_labels
from cvtimg.pictures import image_info, read_pages
from cvtimg.plotting import draw_edges

RNG = np.random.default_rng(2)
STACK = (RNG.integers(0, 4, (3, 20, 30, 3)) * 60 + RNG.integers(0, 9, (3, 20, 30, 3))).astype(np.uint8)
GRAY = STACK[..., 0]


@pytest.fixture(autouse=True)
def stacks() -> None:
    tifffile.imwrite("rgb.tif", STACK, photometric="rgb")
    metadata = {"axes": "ZYX", "spacing": 0.3, "unit": "um"}
    tifffile.imwrite("gray.tif", GRAY, imagej=True, resolution=(7.0, 7.0), metadata=metadata)


def pages_of(path: str) -> Array:
    return np.stack(read_pages(path).images)


def test_quantize_finds_one_palette_for_all_pages(row_of: RowOf) -> None:
    row = row_of("quantize", "rgb.tif", "-k", "9", "-o", "few.tif", "--save-palette", "few.hex")
    whole = quantize(np.concatenate(STACK), 9)
    np.testing.assert_array_equal(np.concatenate(pages_of("few.tif")), whole.image)
    assert (row["pages"], row["k"], row["energy"]) == (3, 9, pytest.approx(whole.energy))
    row = row_of("quantize", "rgb.tif", "-k", "9", "-o", "each.tif", "--palette-per-frame")
    np.testing.assert_array_equal(pages_of("each.tif"), np.stack([quantize(page, 9).image for page in STACK]))


def test_info_and_palette_count_all_pages(row_of: RowOf) -> None:
    row = row_of("info", "rgb.tif")
    assert (row["frames"], row["distinct_colors"]) == (3, len(np.unique(STACK.reshape(-1, 3), axis=0)))
    row = row_of("palette", "rgb.tif", "-k", "4")
    assert sum(color["pixels"] for color in row["colors"]) == STACK[..., 0].size


def test_restore_takes_pages_for_versions(row_of: RowOf) -> None:
    versions = np.repeat(STACK[:1], 3, axis=0) + RNG.integers(0, 5, STACK.shape, np.uint8)
    tifffile.imwrite("versions.tif", versions, photometric="rgb")
    row = row_of("restore", "versions.tif", "-k", "4", "-o", "one.png")
    assert row["versions"] == 3
    np.testing.assert_array_equal(read_image("one.png"), restore(list(versions), 4).image)


@pytest.fixture
def channels() -> Bytes:
    """Write channels.tif as ImageJ does: two channels in three planes."""
    stack = np.stack([GRAY, 255 - GRAY // 2], axis=1)
    metadata = {"axes": "ZCYX", "unit": "um", "spacing": 0.3, "Labels": ["DAPI", "GFP"] * 3}
    tifffile.imwrite("channels.tif", stack, imagej=True, resolution=(7.0, 7.0), metadata=metadata)
    return stack


def test_all_outputs_of_a_stack_hold_all_pages(channels: Bytes, row_of: RowOf) -> None:
    files = ["-o", "l.tif", "--overlay", "o.tif", "--edges", "e.tif", "--mean", "m.tif"]
    files += ["--table", "t.csv", "--contours", "c.geojson"]
    row = row_of("segment", "channels.tif", "-k", "3", "--edge-weight", "0", *files)
    labels, each = pages_of("l.tif"), np.moveaxis(channels, 1, -1)
    np.testing.assert_array_equal(labels, [segment(page, 3, edge_weight=0).labels for page in each])
    np.testing.assert_array_equal(pages_of("e.tif") > 0, [find_edges(page) for page in labels])
    np.testing.assert_array_equal(pages_of("o.tif"), [draw_edges(*own) for own in zip(each, labels, strict=True)])
    means = [mean_picture(*own) for own in zip(labels, each, strict=True)]
    np.testing.assert_array_equal(np.stack(read_pages("m.tif").joined().images), means)
    for name in ("l.tif", "o.tif", "m.tif"):
        found = image_info(name)
        assert (found.axes[0], str(found.pixel_size)) == ("Z", "0.142857 x 0.142857 x 0.3 um")
    assert image_info("m.tif").channels == ("DAPI", "GFP")
    with Path("t.csv").open(newline="") as file:
        table = [(int(line["z"]), int(line["label"]), float(line["area"])) for line in csv.DictReader(file)]
    areas = {(z + 1, k): int((labels[z] == k).sum()) for z in range(3) for k in (1, 2, 3)}
    assert {(z, k): area for z, k, area in table} == areas
    drawn = [one["properties"] for one in json.loads(Path("c.geojson").read_text())["features"]]
    assert {(one["z"], one["label"]): one["area"] for one in drawn} == areas
    assert row["pages"] == 3


def test_objects_of_a_volume_are_counted_and_measured_in_its_unit(row_of: RowOf) -> None:
    z, y, x = np.mgrid[:9, :40, :60]
    balls = [np.hypot(np.hypot(3 * (z - 4), y - 20), x - at) < 9 for at in (15, 30, 48)]
    frame = np.uint8(30 + 150 * np.any(balls, axis=0) + RNG.integers(0, 9, z.shape))
    metadata = {"axes": "TZYX", "unit": "um", "spacing": 1.5}
    tifffile.imwrite("tz.tif", np.stack([frame, frame]), imagej=True, resolution=(2.0, 2.0), metadata=metadata)
    files = ["-o", "l.tif", "--table", "t.csv", "--contours", "c.geojson", "--overlay", "o.tif"]
    row = row_of("segment", "tz.tif", "--objects", "--volume", *files)
    assert row["k"] == 6
    assert "warning" not in row
    row = row_of("segment", "tz.tif", "--objects", "-o", "planes.tif")
    assert row["warning"] == "objects are those of each plane by itself; --volume finds them in three dimensions"
    labels = read_pages("l.tif")
    assert (labels.axes, labels.shape, str(labels.pixel_size)) == ("TZ", (2, 9), "0.5 x 0.5 x 1.5 um")
    assert np.stack(labels.images).max() == 3
    with Path("t.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert {line.pop("image") for line in lines} == {"tz.tif"}
    table = [{name: float(value) for name, value in line.items()} for line in lines]
    assert [(one["t"], one["label"]) for one in table] == [(t, k) for t in (1, 2) for k in (1, 2, 3)]
    whole = 4 / 3 * np.pi * (9 / 2) ** 3
    assert max(one["volume_um3"] for one in table) == pytest.approx(whole, rel=0.15)
    assert sorted(one["x_um"] for one in table[:3]) == pytest.approx([7.5, 15, 24], abs=0.8)
    drawn = [one["properties"] for one in json.loads(Path("c.geojson").read_text())["features"]]
    assert {(one["t"], one["z"], one["label"]) for one in drawn} >= {(1, 5, 1), (2, 5, 3)}


def test_objects_keep_their_label_from_frame_to_frame(row_of: RowOf) -> None:
    # One goes, and another comes where it was.
    centers = [[(12, 15), (12, 40)], [(12, 43), (28, 12)], [(12, 46), (28, 15)]]
    frames = np.stack([discs([(y, x, 7) for y, x in one], (40, 70)) > 0 for one in centers])
    series = np.uint8(30 + 150 * frames + RNG.integers(0, 9, frames.shape))
    tifffile.imwrite("t.tif", series, imagej=True, metadata={"axes": "TYX"})
    row = row_of("segment", "t.tif", "--objects", "--track", "-o", "l.tif")
    assert row["tracks"] == 3
    row_of("segment", "t.tif", "--objects", "-o", "each.tif")
    np.testing.assert_array_equal(pages_of("l.tif"), track_labels(pages_of("each.tif")))


def test_deep_pages_are_as_bright_beside_each_other_as_they_are(row_of: RowOf) -> None:
    deep = np.stack([GRAY[0], GRAY[0] * 3.0]).astype(np.uint16) * 50
    tifffile.imwrite("deep.tif", deep, photometric="minisblack")
    row_of("segment", "deep.tif", "-k", "1", "--overlay", "o.tif")
    dim, bright = pages_of("o.tif")
    assert np.median(bright[GRAY[0] > 100] / dim[GRAY[0] > 100]) == pytest.approx(3, rel=0.1)


def test_channels_belong_to_the_pixel(channels: Bytes, row_of: RowOf, capsys: pytest.CaptureFixture[str]) -> None:
    joined = np.concatenate(np.moveaxis(channels, 1, -1))
    row = row_of("quantize", "channels.tif", "-k", "4", "-o", "q.tif")
    assert row["pages"] == 3
    found = read_pages("q.tif")
    assert (found.axes, found.shape, found.channels) == ("ZC", (3, 2), ("DAPI", "GFP"))
    assert (found.kind, found.scale["spacing"]) == ("imagej", 0.3)
    pixels = np.concatenate(found.joined().images).reshape(-1, 2)
    assert len(np.unique(pixels, axis=0)) == 4
    nearest = np.square(joined.reshape(-1, 1, 2).astype(float) - np.unique(pixels, axis=0)).sum(axis=2).min(axis=1)
    np.testing.assert_allclose(np.square(pixels - joined.reshape(-1, 2).astype(float)).sum(axis=1), nearest)
    row = row_of("info", "channels.tif")
    assert row["distinct_colors"] == len(np.unique(joined.reshape(-1, 2), axis=0))
    assert main(["info", "channels.tif"]) == 0
    assert "DAPI,GFP  0.142857 x 0.142857 x 0.3 um" in capsys.readouterr().out


def test_planes_are_restored_one_by_one_and_versions_along_an_axis(channels: Bytes, row_of: RowOf) -> None:
    row = row_of("restore", "gray.tif", "-k", "3", "-o", "r.tif", "--labels", "l.tif")
    assert (row["pages"], row["versions"]) == (3, 1)
    each = [restore([page], 3) for page in GRAY]
    np.testing.assert_array_equal(pages_of("r.tif"), [one.image for one in each])
    np.testing.assert_array_equal(pages_of("l.tif"), [one.labels for one in each])
    assert str(image_info("r.tif").pixel_size) == "0.142857 x 0.142857 x 0.3 um"
    row = row_of("restore", "gray.tif", "-k", "3", "--merge", "Z", "-o", "one.png")
    np.testing.assert_array_equal(read_image("one.png"), restore(list(GRAY), 3).image)
    row_of("restore", "channels.tif", "-k", "3", "-o", "c.tif")
    assert image_info("c.tif").channels == ("DAPI", "GFP")
    first = restore([np.moveaxis(channels[0], 0, -1)], 3, alpha=False)
    np.testing.assert_array_equal(read_pages("c.tif").joined().images[0], first.image)
