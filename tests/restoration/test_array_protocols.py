"""Verbs take what exports an array: DLPack alone, as tensors do, and xarray."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile

import cvtimg
from cvtimg._shared.types import Array
from cvtimg.cli import app as cli

IMAGE = np.kron(np.random.default_rng(1).integers(0, 255, (6, 8, 3), np.uint8), np.ones((8, 8, 1), np.uint8))


class Tensor:
    """An array that is reached by the DLPack protocol only."""

    def __init__(self, array: Array) -> None:
        self._array = array.copy()

    def __dlpack__(self, **options: Any) -> Any:
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self) -> Any:
        return self._array.__dlpack_device__()


VERBS: dict[str, Callable[[Any], Any]] = {
    "quantize": lambda image: cvtimg.quantize(image, 4).image,
    "segment": lambda image: cvtimg.segment(image, 3).labels,
    "averaged": lambda image: cvtimg.segment(image, 3, averaging=2, mask=IMAGE[..., 0] > 20).labels,
    "superpixels": lambda image: cvtimg.superpixels(image, 12).labels,
    "restore": lambda image: cvtimg.restore([image, image], 3).image,
    "energy_curve": lambda image: cvtimg.energy_curve(image, 5).energies,
    "stipple": lambda image: cvtimg.stipple(image, 30).points,
    "contours": lambda image: [
        one.area for one in cvtimg.find_contours(cvtimg.segment(IMAGE, 3).labels, image).polygons
    ],
}


@pytest.mark.parametrize("verb", VERBS)
def test_exported_arrays_are_as_good_as_arrays(verb: str) -> None:
    expected = VERBS[verb](IMAGE)
    np.testing.assert_array_equal(VERBS[verb](Tensor(IMAGE)), expected)
    xarray = pytest.importorskip("xarray")
    np.testing.assert_array_equal(VERBS[verb](xarray.DataArray(IMAGE, dims=("y", "x", "band"))), expected)


def test_rows_are_taken_from_exported_arrays() -> None:
    rows = IMAGE.reshape(-1, 3).astype(np.float32)
    expected = cvtimg.tessellate(rows, 4).generators
    np.testing.assert_array_equal(cvtimg.tessellate(Tensor(rows), 4).generators, expected)  # type: ignore[arg-type]


def test_a_fourth_band_of_a_file_is_restored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    bands = np.dstack([IMAGE, np.where(IMAGE[..., 0] > 100, 0, 200).astype(np.uint8)]).astype(np.uint16) * 257
    tifffile.imwrite("a.tif", bands, photometric="rgb", planarconfig="contig", extrasamples=["unspecified"])
    assert cli.main(["restore", "a.tif", "a.tif", "-k", "48", "--edge-weight", "0", "-o", "b.tif", "--quiet"]) == 0
    restored = cvtimg.read_image("b.tif")
    assert restored.shape == bands.shape
    np.testing.assert_array_equal(restored[..., 3] > 20000, bands[..., 3] > 20000)


@pytest.mark.slow
def test_only_large_images_depend_on_the_seed() -> None:
    rng = np.random.default_rng(7)
    gray = np.add.outer(np.arange(280), np.arange(270)) / 4
    noisy = [(gray + rng.normal(20, 4, gray.shape)).astype(np.uint8) for _ in range(2)]
    for rows, differs in ((60, False), (280, True)):
        versions = [version[:rows] for version in noisy]
        one, other = (cvtimg.denoise(versions, effort="fast", rng=seed).image for seed in (0, 1))
        assert np.array_equal(one, other) is not differs
