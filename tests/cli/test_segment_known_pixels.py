"""``cvtimg segment --mask`` for pages and in tiles."""

from __future__ import annotations

import numpy as np
import pytest
import tifffile

from cvtimg import read_image, segment, write_image
from cvtimg.cli import app as cli

RNG = np.random.default_rng(3)
PAGES = RNG.integers(0, 4000, (3, 24, 32), np.uint16)
INSIDE = np.arange(32) >= np.full((24, 1), 10)


def run(*arguments: str) -> int:
    return cli.main(["segment", *arguments, "--quiet", "--overwrite"])


@pytest.mark.parametrize("volume", [[], ["--volume"]])
def test_pages_are_segmented_inside_a_mask(volume: list[str]) -> None:
    write_image("one.png", INSIDE)
    each = np.stack([INSIDE, ~INSIDE, INSIDE])
    tifffile.imwrite("each.tif", each.astype(np.uint8), photometric="minisblack")
    tifffile.imwrite("pages.tif", PAGES, photometric="minisblack")
    for name, inside in (("one.png", np.stack([INSIDE] * 3)), ("each.tif", each)):
        assert run("pages.tif", "-k", "3", "--mask", name, "-o", "labels.tif", *volume) == 0
        labels = tifffile.imread("labels.tif")
        if volume:
            expected = segment(PAGES.reshape(-1, 32), 3, mask=inside.reshape(-1, 32)).labels.reshape(PAGES.shape)
        else:
            expected = np.stack([segment(page, 3, mask=own).labels for page, own in zip(PAGES, inside, strict=True)])
        np.testing.assert_array_equal(labels, expected)
        assert (labels[~inside] == 0).all()


@pytest.mark.parametrize("mask", ["mask.png", "mask.tif"])
def test_tiles_are_segmented_inside_a_mask(monkeypatch: pytest.MonkeyPatch, mask: str) -> None:
    monkeypatch.setattr("cvtimg.pictures.tiles._LARGE", 100)
    monkeypatch.setattr("cvtimg.pictures.tiles.BAND_PIXELS", 100)
    tifffile.imwrite("in.tif", PAGES[0], rowsperstrip=5)
    inside = INSIDE.copy()
    inside[5:11] = False  # whole bands
    write_image("mask.png", inside)
    tifffile.imwrite("mask.tif", inside.astype(np.uint8), rowsperstrip=7, photometric="minisblack")
    assert run("in.tif", "-k", "3", "--edge-weight", "2", "--mask", mask, "-o", "labels.tif") == 0
    labels = read_image("labels.tif")
    np.testing.assert_array_equal(labels, segment(PAGES[0], 3, edge_weight=2, mask=inside).labels)
