"""Transparency: what is seen counts, what is opaque or fully transparent stays so."""

from typing import Any

import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cvtimg import quantize, tessellate
from cvtimg._shared.pixels import AlphaArray
from cvtimg._shared.types import Array, Bytes
from cvtimg.colors import SPACES, color_samples
from cvtimg.colors.places import from_places, to_places
from cvtimg.quantization import DITHERS

HEIGHT, WIDTH = 60, 80


def scene(dtype: Any = np.uint8) -> Array:
    """Draw a shaded opaque ball with soft edges and a soft shadow, on full transparency."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    ball = np.clip(20.5 - np.hypot(x - 30, y - 25), 0, 1)
    shadow = 0.7 / (1 + np.exp((np.hypot(x - 42, y - 36) - 18) / 2.5))
    shadow[shadow < 0.01] = 0
    shade = np.clip(1.1 - np.hypot(x - 24, y - 18) / 50, 0, 1)
    light = np.stack([shade, 0.6 * shade, 0.2 + 0 * shade], axis=-1)
    alpha = ball + shadow * (1 - ball)
    dark = np.array([0.02, 0.02, 0.1])
    seen = (light * ball[..., None] + dark * (shadow * (1 - ball))[..., None]) / np.maximum(alpha, 1e-9)[..., None]
    peak = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1
    picture = np.dstack([seen, alpha]) * peak
    return (np.rint(picture) if peak > 1 else picture).astype(dtype).view(AlphaArray)


SCENE = scene()
CLEAR, OPAQUE = SCENE[..., 3] == 0, SCENE[..., 3] == 255


def with_hidden_colors() -> Bytes:
    """Return the scene with noise under full transparency."""
    hidden = SCENE.copy()
    hidden[CLEAR, :3] = np.random.default_rng(0).integers(0, 256, (CLEAR.sum(), 3))
    return hidden


@given(hnp.arrays(np.uint8, (2, 4)), st.booleans())
def test_distances_of_places_are_squared_errors_over_black_and_white(pair: Bytes, grey: bool) -> None:
    colors = pair[:, 2:] if grey else pair
    one, other = to_places(colors, "rgb", alpha=True)
    expected = reference.seen_energy(colors[None, :1], colors[None, 1:])
    assert ((one - other) ** 2).sum() == pytest.approx(expected, rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float64])
def test_colors_come_back_from_their_places(space: str, dtype: Any) -> None:
    colors = scene(dtype).reshape(-1, 4)
    back = from_places(to_places(colors, space, True), space, np.dtype(dtype), True)
    assert back.dtype == dtype
    np.testing.assert_allclose(back[colors[:, 3] > 0], colors[colors[:, 3] > 0], atol=1 if dtype is np.uint8 else 1e-3)
    assert (back[colors[:, 3] == 0] == 0).all()


@pytest.mark.parametrize("space", SPACES)
def test_a_few_transparent_pixels_change_nothing_for_opaque_ones(space: str, photograph: Array) -> None:
    picture = photograph[::4, ::4]
    holed = np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)]).view(AlphaArray)
    holed[:5, :5, 3] = 0
    weights = np.where(holed[..., 3] > 0, 1, 0)
    result, plain = quantize(holed, 13, space=space), quantize(picture, 12, space=space, weights=weights)
    np.testing.assert_array_equal(result.image[weights > 0, :3], plain.image[weights > 0])
    assert (result.image[weights == 0] == 0).all()


@pytest.mark.parametrize(
    ("n_colors", "space", "dither"),
    [(k, space, None) for k in (2, 3, 9, 40) for space in SPACES] + [(9, "oklab", dither) for dither in DITHERS],
)
def test_opaque_and_transparent_pixels_stay_so(n_colors: int, space: str, dither: str | None) -> None:
    result = quantize(SCENE, n_colors, space=space, dither=dither)
    assert (result.image[CLEAR] == 0).all()
    assert (result.image[OPAQUE][:, 3] == 255).all()
    assert len(result.palette) <= n_colors


@pytest.mark.parametrize("background", [0.0, 1.0, "checkerboard"])
def test_a_soft_shadow_is_nearer_than_by_plain_distances(background: Any) -> None:
    if background == "checkerboard":
        y, x = np.mgrid[:HEIGHT, :WIDTH]
        background = np.where((y // 8 + x // 8) % 2, 0.4, 0.6)[..., None]
    hidden = with_hidden_colors()
    samples = color_samples(hidden)
    plain = tessellate(samples, 16)
    colors = np.rint(plain.generators[plain.labels])[samples.inverse].astype(np.uint8)
    before = reference.composite(hidden, background)

    def error(image: Array) -> float:
        return float(((reference.composite(image, background) - before) ** 2).sum())

    assert error(quantize(hidden, 16).image) < 0.5 * error(colors)


def test_half_transparent_edges_have_the_color_of_the_object() -> None:
    y, x = np.mgrid[:40, :40]
    alpha = np.clip(12.5 - np.hypot(x - 20, y - 20) / 1.3, 0, 1)
    disc = np.dstack([np.broadcast_to([250, 200, 40], (40, 40, 3)), np.rint(255 * alpha)]).astype(np.uint8)
    disc[alpha == 0] = 0  # black under full transparency, which must not come through
    result = quantize(disc, 5, alpha=True)
    partly = (result.palette[:, 3] > 0) & (result.palette[:, 3] < 255)
    assert partly.sum() >= 2
    assert np.abs(result.palette[result.palette[:, 3] > 0, :3].astype(int) - [250, 200, 40]).max() <= 2


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_depth_makes_no_difference_to_transparency(dtype: Any) -> None:
    deep = scene(dtype)
    result, plain = quantize(deep, 16), quantize(SCENE, 16)
    assert result.image.dtype == dtype
    assert result.psnr == pytest.approx(plain.psnr, abs=0.5)
    peak = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1
    assert (result.image[deep[..., 3] == 0] == 0).all()
    assert (result.image[deep[..., 3] == peak][:, 3] == peak).all()


def test_grey_with_alpha_is_quantized_as_its_colors() -> None:
    grey = SCENE[..., [0, 3]]
    color = SCENE[..., [0, 0, 0, 3]]
    one, other = quantize(grey, 8), quantize(color, 8)
    assert one.image.shape == grey.shape
    np.testing.assert_allclose(one.psnr, other.psnr, atol=0.3)


def test_weights_of_nothing_opaque_leave_opaque_pixels_opaque() -> None:
    result = quantize(SCENE, 6, weights=np.where(OPAQUE, 0, 1))
    assert (result.image[OPAQUE][:, 3] == 255).all()
    assert (result.image[CLEAR] == 0).all()


def test_weighted_cells_stay_so_with_transparency() -> None:
    assert quantize(SCENE, 12, volume_power=2).energy > 1.05 * quantize(SCENE, 12).energy
