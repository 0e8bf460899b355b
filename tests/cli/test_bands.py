"""Bands are bands: none is taken for transparency unless the file says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from commands import RowOf

from cvtimg import quantize, read_image
from cvtimg.cli.app import main
from cvtimg.pictures import image_info

RNG = np.random.default_rng(3)
BANDS = RNG.integers(0, 65536, (20, 30, 4), np.uint16)


@pytest.mark.parametrize("n_bands", [2, 4])
def test_quantize_reduces_all_bands_of_a_file_without_alpha(
    tmp_path: Path, row_of: RowOf, capsys: pytest.CaptureFixture[str], n_bands: int
) -> None:
    image = BANDS[..., :n_bands]
    kind = {"photometric": "rgb" if n_bands == 4 else "minisblack", "planarconfig": "contig"}
    tifffile.imwrite(tmp_path / "a.tif", image, extrasamples=["unspecified"], **kind)
    command = ["quantize", str(tmp_path / "a.tif"), "-k", "20", "-o"]
    row = row_of(*command, str(tmp_path / "b.tif"))
    few = read_image(tmp_path / "b.tif")
    assert few.shape == image.shape
    assert not image_info(tmp_path / "b.tif").has_alpha
    mse = np.square(few.astype(float) - image).mean()  # over the bands that there are
    assert row["mse"] == pytest.approx(mse)
    assert mse == pytest.approx(quantize(image, 20, alpha=False).mse)
    assert main([*command, str(tmp_path / "b.png")]) == 1
    assert "bands that are not colors" in capsys.readouterr().err
