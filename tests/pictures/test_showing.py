"""Images of more than 8 bits are shown in the range that they fill."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from cvtimg import quantize, read_image, restore
from cvtimg.pictures.showing import limits_to_show, natural_limits, shown

RAMP = np.add.outer(np.arange(40), np.arange(60))
#: 12-bit data in 16 bits, as cameras of microscopes write it, with a hot pixel; heights; and a dark exposure.
DARK = {
    "12 bits": (RAMP * 40).astype(np.uint16),
    "heights": (RAMP * 3 - 200).astype(np.int16),
    "counts": (RAMP * 7).astype(np.uint32),
    "exposure": (RAMP / 5000).astype(np.float32),
}
for _values in DARK.values():
    _values[3, 4] = 30000 if _values.dtype.kind in "iu" else 1


def brightness(png: bytes) -> np.ndarray:
    image = np.asarray(Image.open(BytesIO(png)).convert("L")).astype(float)
    return np.array([np.quantile(image, 0.02), np.median(image), np.quantile(image, 0.98)])


@pytest.mark.parametrize("kind", DARK)
def test_dark_images_are_not_shown_black(kind: str) -> None:
    image = DARK[kind]
    for result in (quantize(image, 40), quantize(np.dstack([image] * 3), 40), restore([image, image], 12)):
        low, middle, high = brightness(result._repr_png_())
        assert low < 60
        assert 90 < middle < 165
        assert high > 195


def test_bright_images_are_shown_as_they_are() -> None:
    for white, dtype in ((65535, np.uint16), (1, np.float32)):
        image = (np.linspace(0.1, 0.8, 200).reshape(10, 20, 1) * white).astype(dtype)
        assert natural_limits(image) == (0, white)
        np.testing.assert_allclose(shown(image, (0, white))[..., 1] / 255, image[..., 0] / white, atol=0.003)


def test_limits_leave_out_what_is_rare_or_not_finite() -> None:
    values = np.linspace(100, 200, 5000)
    values[:2] = np.nan, np.inf
    values[2:5] = -1e6, 1e6, 1e9
    low, high = limits_to_show([values[:, None], np.full((3, 1), 9, np.uint8)])
    assert 99 < low < 101
    assert 199 < high < 201
    assert limits_to_show([np.full((4, 1), 9, np.uint8)]) == (0, 0)


def test_masked_values_do_not_darken_the_others() -> None:
    image = DARK["12 bits"].copy()
    image[:, :20] = 65535
    assert brightness(quantize(image, 30, mask=image < 65535)._repr_png_())[1] > 100


def test_a_fourth_band_is_no_transparency(tmp_path) -> None:  # type: ignore[no-untyped-def]
    image = np.dstack([DARK["12 bits"]] * 3 + [np.zeros_like(DARK["12 bits"])])
    (tmp_path / "a.png").write_bytes(quantize(image, 30)._repr_png_())
    assert read_image(tmp_path / "a.png").shape[2] == 3
