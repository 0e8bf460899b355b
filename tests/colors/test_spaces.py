import numpy as np
import pytest
from skimage.color import deltaE_ciede2000

from cvtimg.colors.spaces import SPACES, from_space, to_depth, to_space

CUBE = np.stack(np.meshgrid(*[np.arange(0, 256, 17)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float64])
def test_every_color_comes_back_from_every_space(space: str, dtype: type) -> None:
    scale = {np.uint8: 1, np.uint16: 257, np.float64: 1 / 255}[dtype]
    colors = (CUBE * scale).astype(dtype)
    back = from_space(to_space(colors, space).astype(np.float64), space, np.dtype(dtype))
    assert back.dtype == dtype
    if dtype is np.float64:
        np.testing.assert_allclose(back, colors, atol=1e-3 if space == "lab" else 1e-6)
    else:
        assert np.abs(back.astype(int) - colors).max() <= (dtype is np.uint16) * 20


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_grey_comes_back_from_every_space(space: str, dtype: type) -> None:
    greys = np.arange(np.iinfo(dtype).max + 1, dtype=dtype)[:, np.newaxis]
    places = to_space(greys, space)
    assert places.shape == greys.shape
    assert space == "rgb" or places[-1, 0] == pytest.approx(SPACES[space].white)
    assert (np.diff(places[:, 0].astype(float)) > 0).all()
    back = from_space(places.astype(np.float64), space, np.dtype(dtype))
    assert np.abs(back.astype(int) - greys).max() <= (dtype is np.uint16)


@pytest.mark.parametrize("space", ["linear", "lab", "oklab"])
def test_places_outside_the_gamut_come_back_inside(space: str) -> None:
    rng = np.random.default_rng(0)
    places = to_space(CUBE.astype(np.uint8), space)
    outside = places.mean(axis=0) + 3 * (places - places.mean(axis=0)) + rng.normal(0, 0.01, places.shape)
    colors = from_space(outside, space, np.dtype(np.float64))
    assert np.isfinite(colors).all()
    assert colors.min() >= 0
    assert colors.max() <= 1


def test_oklab_and_lab_agree_with_perceived_difference_better_than_rgb() -> None:
    rng = np.random.default_rng(1)
    one = rng.integers(0, 250, (2000, 3))
    other = np.clip(one + rng.integers(-12, 13, one.shape), 0, 255)
    pair = [colors.astype(np.uint8) for colors in (one, other)]
    seen = deltaE_ciede2000(*(to_space(colors, "lab") for colors in pair))

    def agreement(space: str) -> float:
        first, second = (to_space(colors, space).astype(float) for colors in pair)
        return float(np.corrcoef(np.linalg.norm(first - second, axis=1), seen)[0, 1])

    assert agreement("lab") > agreement("rgb") + 0.05
    assert agreement("oklab") > agreement("rgb") + 0.1


def test_known_colors_have_the_coordinates_of_the_literature() -> None:
    red = np.array([[255, 0, 0]], np.uint8)
    np.testing.assert_allclose(to_space(red, "oklab")[0] / [1, 2, 2], [0.6279, 0.2249, 0.1258], atol=2e-4)
    np.testing.assert_allclose(to_space(red, "lab")[0], [53.24, 80.09, 67.20], atol=0.02)
    np.testing.assert_allclose(to_space(np.array([[188]], np.uint8), "linear")[0], [0.5029], atol=1e-4)


def test_depths_agree_and_integers_are_rounded() -> None:
    deep = np.arange(65536, dtype=np.uint16)[:, np.newaxis]
    np.testing.assert_array_equal(to_depth(deep, np.dtype(np.uint8)), np.rint(deep / 257))
    eight = np.arange(256, dtype=np.uint8)[:, np.newaxis]
    np.testing.assert_array_equal(to_depth(eight, np.dtype(np.uint16)), eight * np.uint16(257))
    for colors in (deep, eight):
        unit = to_depth(colors, np.dtype(np.float64))
        assert (unit.min(), unit.max()) == (0, 1)
        np.testing.assert_array_equal(to_depth(unit, colors.dtype), colors)
    with pytest.raises(ValueError, match=r"samples in 0\.\.2 must be in 0\.\.1 to become uint8"):
        to_depth(np.array([[0.0, 2.0]]), np.dtype(np.uint8))


def test_bad_spaces_and_colors_are_refused() -> None:
    with pytest.raises(ValueError, match="space='hsv' must be one of rgb, linear, lab, oklab"):
        to_space(CUBE, "hsv")
    with pytest.raises(ValueError, match="an image of 5 channels must have 1 or 3, for space='lab'"):
        to_space(np.zeros((4, 5)), "lab")
    with pytest.raises(ValueError, match=r"float64 samples in .* must be in 0\.\.1 for space"):
        to_space(np.array([[0.5, 2.0, 0]]), "linear")
