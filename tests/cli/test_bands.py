"""Bands are bands: none is taken for transparency unless the file says so."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile

from cvtimg import quantize, read_image
from cvtimg.cli.app import main
from cvtimg.pictures import image_info

RNG = np.random.default_rng(3)
BANDS = RNG.integers(0, 65536, (20, 30, 4), np.uint16)


@pytest.mark.parametrize("n_bands", [2, 4])
def test_quantize_reduces_all_bands_of_a_file_without_alpha(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], n_bands: int
) -> None:
    image = BANDS[..., :n_bands]
    kind = {"photometric": "rgb" if n_bands == 4 else "minisblack", "planarconfig": "contig"}
    tifffile.imwrite(tmp_path / "a.tif", image, extrasamples=["unspecified"], **kind)
    command = ["quantize", str(tmp_path / "a.tif"), "-k", "20", "-o"]
    assert main([*command, str(tmp_path / "b.tif"), "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    few = read_image(tmp_path / "b.tif")
    assert few.shape == image.shape
    assert not image_info(tmp_path / "b.tif").has_alpha
    mse = np.square(few.astype(float) - image).mean()  # over the bands that there are
    assert row["mse"] == pytest.approx(mse)
    assert mse == pytest.approx(quantize(image, 20, alpha=False).mse)
    assert main([*command, str(tmp_path / "b.png")]) == 1
    assert "bands that are not colors" in capsys.readouterr().err


def test_quantize_keeps_the_transparency_that_a_file_has(tmp_path: Path) -> None:
    image = BANDS.copy()
    image[:10, :, 3], image[10:, :, 3] = 0, 65535
    options = {"photometric": "rgb", "planarconfig": "contig", "extrasamples": ["unassalpha"]}
    tifffile.imwrite(tmp_path / "a.tif", image, **options)
    assert main(["quantize", str(tmp_path / "a.tif"), "-k", "20", "-o", str(tmp_path / "b.tif"), "--quiet"]) == 0
    assert image_info(tmp_path / "b.tif").has_alpha
    np.testing.assert_array_equal(read_image(tmp_path / "b.tif")[..., 3], image[..., 3])
