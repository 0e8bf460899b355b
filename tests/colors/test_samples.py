from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from cvtimg._shared.types import Array
from cvtimg.colors import color_samples

DTYPES = [np.uint8, np.uint16, np.float32, np.float64]


def images(dtype: Any) -> st.SearchStrategy[Array]:
    shapes = hnp.array_shapes(min_dims=2, max_dims=3, min_side=1, max_side=6)
    # Few values, so that colors repeat.
    values = st.sampled_from([0, 1, 2, 255] if np.dtype(dtype).kind == "u" else [-0.0, 0.0, 0.5, 1e-30, 3e5])
    return shapes.flatmap(lambda shape: hnp.arrays(dtype, shape, elements=values))


@pytest.mark.parametrize("dtype", DTYPES)
def test_samples_agree_with_numpy_unique(dtype: Any) -> None:
    @settings(max_examples=40)
    @given(images(dtype))
    def check(image: Array) -> None:
        samples = color_samples(image)
        rows = image.reshape(image.shape[0] * image.shape[1], -1)
        colors, counts = np.unique(rows, axis=0, return_counts=True)
        order = np.lexsort(samples.colors.T[::-1])
        np.testing.assert_array_equal(samples.colors[order], colors)
        np.testing.assert_array_equal(samples.density[order], counts)
        assert samples.colors.dtype == image.dtype
        np.testing.assert_array_equal(samples.colors[samples.inverse].reshape(image.shape), image)

    check()


@pytest.mark.slow
def test_every_24_bit_color_is_counted() -> None:
    values = np.arange(1 << 24, dtype=np.uint32).view(np.uint8).reshape(4096, 4096, 4)
    samples = color_samples(np.ascontiguousarray(values[..., :3]))
    assert samples.n_colors == 1 << 24
    assert (samples.density == 1).all()


def test_similar_colors_are_near_each_other(photograph: Array) -> None:
    colors = color_samples(photograph).colors.astype(float)
    step = np.linalg.norm(np.diff(colors, axis=0), axis=1).mean()
    shuffled = np.random.default_rng(0).permutation(colors)
    assert step < 0.1 * np.linalg.norm(np.diff(shuffled, axis=0), axis=1).mean()


def test_the_image_stays_as_it_was_and_results_cannot_be_changed(photograph: Array) -> None:
    before = photograph.copy()
    samples = color_samples(photograph)
    np.testing.assert_array_equal(photograph, before)
    with pytest.raises(ValueError, match="read-only"):
        samples.colors[0] = 0


@pytest.mark.parametrize(
    ("image", "error", "message"),
    [
        (np.zeros(5, np.uint8), ValueError, r"image of shape \(5,\) must be"),
        (np.zeros((0, 4), np.uint8), ValueError, r"image of shape \(0, 4\) must be"),
        (np.zeros((2, 2, 2, 2), np.uint8), ValueError, "must be"),
        (np.full((2, 2), np.nan), ValueError, "image must have at least one pixel that counts"),
        (np.full((2, 2), np.inf, np.float32), ValueError, "image must have at least one pixel"),
        (np.full((2, 2), 1j), TypeError, "image of type complex128 must be"),
        (np.full((2, 2), "a"), TypeError, "image of type <U1 must be"),
    ],
)
def test_what_is_not_an_image_is_refused(image: Array, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        color_samples(image)


@pytest.mark.parametrize("mode", ["P", "PA", "CMYK", "HSV", "YCbCr"])
def test_pillow_images_are_taken_by_their_colors(mode: str, photograph: Array) -> None:
    image = Image.fromarray(photograph[::8, ::8]).convert("P" if mode == "PA" else mode).convert(mode)
    samples = color_samples(image)
    expected = np.asarray(image.convert("RGBA" if mode == "PA" else "RGB"))
    np.testing.assert_array_equal(samples.colors[samples.inverse], expected)
