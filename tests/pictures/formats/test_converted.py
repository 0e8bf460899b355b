"""Claims about raw files of cameras."""

from pathlib import Path

import numpy as np
import pytest
import tifffile

from cvtimg import read_image, restore
from cvtimg.cli.app import main
from cvtimg.colors.spaces import from_space
from cvtimg.pictures import image_info

pytest.importorskip("rawpy")

#: Sensitivities of a camera, its black and white, and linear sRGB of three stripes.
SENSITIVE, BLACK, WHITE = np.array([0.5, 1, 0.7]), 500, 15500
STRIPES = np.array([[0.4, 0.1, 0.1], [0.5, 0.5, 0.5], [0.05, 0.1, 0.3]])
#: From linear sRGB to CIE XYZ, IEC 61966-2-1.
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def write_raw(path: Path, orientation: int) -> None:
    """Write what a camera with a Bayer mosaic records of three upright stripes, 64 rows of 96 pixels, as DNG."""
    values = BLACK + (WHITE - BLACK) * STRIPES.repeat(32, axis=0) * SENSITIVE
    mosaic = np.empty((64, 96), np.uint16)
    for (down, right), band in {(0, 0): 0, (0, 1): 1, (1, 0): 1, (1, 1): 2}.items():
        mosaic[down::2, right::2] = values[right::2, band]
    to_camera = SENSITIVE[:, None] * np.linalg.inv(TO_XYZ)
    ratios = [np.stack([np.rint(10**4 * one.ravel()), np.full(one.size, 10**4)], 1) for one in (to_camera, SENSITIVE)]
    matrix, neutral = (tuple(one.astype(int).ravel().tolist()) for one in ratios)
    tags = [
        *((33421, "H", 2, (2, 2)), (33422, "B", 4, bytes([0, 1, 1, 2])), (50706, "B", 4, bytes([1, 4, 0, 0]))),
        *((50714, "H", 1, BLACK), (50717, "H", 1, WHITE), (50721, "2i", 9, matrix), (50728, "2I", 3, neutral)),
        *((50778, "H", 1, 21), (274, "H", 1, orientation), (271, "s", 0, "Test"), (272, "s", 0, "Test")),
    ]
    tifffile.imwrite(path, mosaic, photometric=32803, metadata=None, extratags=[(*tag, True) for tag in tags])


@pytest.mark.parametrize("orientation", [1, 6])
def test_raw_files_are_developed_upright_with_the_white_balance_of_the_camera(tmp_path: Path, orientation: int) -> None:
    write_raw(path := tmp_path / "a.dng", orientation)
    image, header = read_image(path), image_info(path)
    assert image.shape == (header.height, header.width, 3) == ((64, 96, 3) if orientation == 1 else (96, 64, 3))
    seen = image[32, [16, 48, 80]] if orientation == 1 else image[[16, 48, 80], 32]
    expected = from_space(STRIPES, "linear", np.dtype(np.uint16))
    np.testing.assert_allclose(seen, expected.astype(float), atol=150)
    assert main(["restore", str(path), "-k", "3", "--effort", "fast", "-o", str(tmp_path / "b.tif"), "--quiet"]) == 0
    restored = restore([image], 3, effort="fast", space="linear").image
    np.testing.assert_array_equal(read_image(tmp_path / "b.tif"), restored)
