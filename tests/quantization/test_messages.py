"""Images that cannot be quantized as they are asked to be, and palettes that cannot be had, are refused by name."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import quantize, read_image
from cvtimg._shared.pixels import AlphaArray

CAT = read_image("sample_images/chelsea.png")[:80, :80]
CLEAR = np.dstack([CAT, np.full(CAT.shape[:2], 255, np.uint8)]).view(AlphaArray)
CLEAR[:40, :, 3] = 0
RED = [[255, 0, 0], [1, 2, 3]]
EIGHT = np.ones((8, 8))
BITS = r"color_bits=.* must be a number of bits in 1..8, or three of them"
NO_LOOKS = "cannot be combined with goal='eyes' or quality"


@pytest.mark.parametrize(
    ("image", "options", "message"),
    [
        (CAT, {}, "n_colors, psnr or palette must be given"),
        (CAT, {"n_colors": 0}, r"n_colors=0 must be in 1\.\.65536, the size of the largest palette"),
        (CAT, {"n_colors": 65537}, r"n_colors=65537 must be in 1\.\.65536"),
        (CAT, {"n_colors": "4"}, "n_colors='4' must be an integer"),
        (CAT, {"n_colors": 16, "psnr": 60}, r"psnr=60 must be at most \d\d\.\d\d dB, which 16 colors reach"),
        (CAT, {"max_bytes": 4}, r"max_bytes=4 must be at least \d+, for the fewest colors, 1"),
        (CAT, {"n_colors": 2, "psnr": 30, "locked": np.eye(3)}, "n_colors=2 must be an integer >= 3, for locked"),
        (CAT, {"n_colors": 4, "palette": np.eye(3, dtype=np.uint8)}, r"n_colors=4 must be .*1\.\.3"),
        *(
            (CAT, {"palette": RED, name: value}, f"palette must not be given with {name}")
            for name, value in {"psnr": 30, "locked": RED, "weights": EIGHT, "effort": "best", "color_bits": 5}.items()
        ),
        (CAT, {"n_colors": 4, "locked": [[1, 2, 300]]}, r"locked must be whole numbers in 0\.\.255, as the image is"),
        *((CAT, {"n_colors": 4, "locked": [[1, 2, x]]}, "locked must be whole numbers") for x in (-3, 3.5, np.nan)),
        (CAT, {"n_colors": 4, "locked": np.zeros((2, 5))}, "palette of 5 channels must have"),
        (CAT, {"n_colors": 4, "locked": np.zeros((0, 3))}, r"locked of shape \(0, 3\)"),
        (CAT, {"n_colors": 4, "locked": [["a"]]}, "locked of shape"),
        (CLEAR, {"n_colors": 1}, "n_colors=1 must be an integer >= 2, for locked colors, opaque"),
        (CLEAR, {"n_colors": 3, "locked": [[1, 2, 3, 9], [3, 2, 1, 9]]}, "n_colors=3 must be an integer >= 4"),
        (CLEAR / 127, {"n_colors": 4, "alpha": True}, r"alpha in 0\.\.2.* must be in 0\.\.1"),
        (
            CAT[:8, :8],
            {"n_colors": 4, "weights": EIGHT[:3, :3]},
            r"weights of shape \(3, 3\) must be \(8, 8\), one weight",
        ),
        (CAT[:8, :8], {"n_colors": 4, "weights": 0 * EIGHT}, "weights must be finite and >= 0, and not all 0"),
        (CAT[:8, :8], {"n_colors": 4, "weights": -EIGHT}, "weights must be finite and >= 0"),
        (CAT[:8, :8], {"n_colors": 4, "weights": np.nan * EIGHT}, "weights must be finite"),
        *((CAT, {"n_colors": 8, "color_bits": bits}, BITS) for bits in (0, 9, (5, 5), (5, 5, 0), (5, 5, 5, 5), 2.5)),
        (CAT / 255, {"n_colors": 8, "color_bits": 5}, "float64 must be unsigned integers"),
        (np.zeros((3, 3, 5), np.uint8), {"n_colors": 2, "color_bits": 5}, "an image"),
        (CAT, {"goal": "ears"}, "goal='ears' must be one of"),
        (CAT, {"quality": 70, "psnr": 30}, f"psnr=30 {NO_LOOKS}"),
        (CAT, {"goal": "eyes", "space": "lab"}, "space='lab' cannot be combined"),
        (CAT, {"quality": 70, "dither": "floyd-steinberg"}, "dither='floyd-steinberg' must be 'compact'"),
        (CAT, {"n_colors": 300, "dither": "compact"}, "at most 256 colors with dither='compact'"),
    ],
)
def test_wrong_arguments_are_named(image: NDArray[Any], options: dict[str, Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        quantize(image, **options)
