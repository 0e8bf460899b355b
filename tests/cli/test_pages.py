"""No command loses a page: it treats all of them, or says that it takes one image."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray

from cvtimg import quantize, read_image, restore, segment
from cvtimg.cli.app import main
from cvtimg.pictures import read_pages

RNG = np.random.default_rng(2)
STACK = (RNG.integers(0, 4, (3, 20, 30, 3)) * 60 + RNG.integers(0, 9, (3, 20, 30, 3))).astype(np.uint8)
GRAY = STACK[..., 0]


@pytest.fixture(autouse=True)
def stacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    tifffile.imwrite("rgb.tif", STACK, photometric="rgb")
    metadata = {"axes": "ZYX", "spacing": 0.3, "unit": "um"}
    tifffile.imwrite("gray.tif", GRAY, imagej=True, resolution=(7.0, 7.0), metadata=metadata)


def rows(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[dict[str, Any]]:
    assert main([*arguments, "--json"]) == 0
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def pages_of(path: str) -> NDArray[Any]:
    return np.stack(read_pages(path).images)


def test_quantize_finds_one_palette_for_all_pages(capsys: pytest.CaptureFixture[str]) -> None:
    (row,) = rows(capsys, "quantize", "rgb.tif", "-k", "9", "-o", "few.tif", "--save-palette", "few.hex")
    whole = quantize(np.concatenate(STACK), 9)
    np.testing.assert_array_equal(np.concatenate(pages_of("few.tif")), whole.image)
    assert (row["pages"], row["k"], row["energy"]) == (3, 9, pytest.approx(whole.energy))
    (row,) = rows(capsys, "quantize", "rgb.tif", "-k", "9", "-o", "each.tif", "--palette-per-frame")
    np.testing.assert_array_equal(pages_of("each.tif"), np.stack([quantize(page, 9).image for page in STACK]))


def test_a_stack_of_imagej_stays_one(capsys: pytest.CaptureFixture[str]) -> None:
    rows(capsys, "quantize", "gray.tif", "-k", "3", "-o", "few.tif")
    rows(capsys, "segment", "gray.tif", "-k", "3", "-o", "labels.tif")
    for name in ("few.tif", "labels.tif"):
        pages = read_pages(name)
        assert (pages.axes, pages.shape, pages.kind, pages.scale["spacing"]) == ("Z", (3,), "imagej", 0.3)
        assert pages.images[0].shape == (20, 30)
    np.testing.assert_array_equal(np.concatenate(pages_of("few.tif")), quantize(np.concatenate(GRAY), 3).image)


def test_segment_treats_each_page_or_the_volume(capsys: pytest.CaptureFixture[str]) -> None:
    (row,) = rows(capsys, "segment", "rgb.tif", "-k", "3", "-o", "each.tif")
    np.testing.assert_array_equal(pages_of("each.tif"), np.stack([segment(page, 3).labels for page in STACK]))
    assert row["pages"] == 3
    rows(capsys, "segment", "rgb.tif", "-k", "3", "-o", "volume.tif", "--volume")
    np.testing.assert_array_equal(np.concatenate(pages_of("volume.tif")), segment(np.concatenate(STACK), 3).labels)


def test_info_and_palette_count_all_pages(capsys: pytest.CaptureFixture[str]) -> None:
    (row,) = rows(capsys, "info", "rgb.tif")
    assert (row["frames"], row["distinct_colors"]) == (3, len(np.unique(STACK.reshape(-1, 3), axis=0)))
    (row,) = rows(capsys, "palette", "rgb.tif", "-k", "4")
    assert sum(color["pixels"] for color in row["colors"]) == STACK[..., 0].size


def test_restore_takes_pages_for_versions(capsys: pytest.CaptureFixture[str]) -> None:
    versions = np.repeat(STACK[:1], 3, axis=0) + RNG.integers(0, 5, STACK.shape, np.uint8)
    tifffile.imwrite("versions.tif", versions, photometric="rgb")
    (row,) = rows(capsys, "restore", "versions.tif", "-k", "4", "-o", "one.png")
    assert row["versions"] == 3
    np.testing.assert_array_equal(read_image("one.png"), restore(list(versions), 4).image)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (["quantize", "rgb.tif", "-k", "3"], "has several pages: name an output that can hold them, -o FILE.tif"),
        (["quantize", "rgb.tif", "-k", "3", "--depth", "8", "-o", "a.tif"], "--depth cannot be used for"),
        (["segment", "rgb.tif", "-k", "3"], "has several pages: name an output that can hold them, -o FILE.tif"),
        (["segment", "rgb.tif", "-k", "3", "--edges", "e.png"], "has several pages, of which only labels"),
        (["quantize", "one.png", "-k", "3", "--weight-map", "gray.tif"], "has 3 pages, where one image is expected"),
    ],
)
def test_what_has_no_room_for_pages_says_so(
    capsys: pytest.CaptureFixture[str], command: list[str], reason: str
) -> None:
    assert main(command) in (1, 2)
    assert reason in capsys.readouterr().err
    assert {path.name for path in Path().iterdir()} == {"rgb.tif", "gray.tif"}
