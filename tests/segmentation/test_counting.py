"""Objects are counted without settings, whatever their size, light, noise and polarity."""

from typing import Any

import numpy as np
import pytest
from images import discs
from scipy import ndimage
from skimage import data

from cvtimg._shared.types import Array, Bytes, Floats
from cvtimg.segmentation import count_objects, field_of_view

RIGHT = np.mgrid[:120, :160][1].astype(np.float64)
#: Centers and radii: pairs that touch, one alone, and one that is cut off.
DISCS = [
    (30, 30, 13),
    (30, 53, 13),
    (85, 40, 15),
    (85, 66, 13),
    (40, 110, 14),
    (100, 120, 12),
    (98, 142, 12),
    (60, 155, 12),
]


def drawn(scale: float = 1.0, levels: Any = 1.0) -> Floats:
    """Draw discs."""
    labels = discs([(y * scale, x * scale, radius * scale) for y, x, radius in DISCS], RIGHT.shape)
    return np.append(0.0, np.broadcast_to(levels, len(DISCS)))[labels]


def noisy(image: Floats, sigma: float) -> Floats:
    return image + np.random.default_rng(0).normal(0, sigma, image.shape)


LIGHT = 0.6 + 0.8 * RIGHT / 160


@pytest.mark.parametrize(
    "image",
    [
        noisy(drawn(), 0.05),
        noisy(drawn(), 0.4),
        noisy((drawn() + 0.4) * LIGHT, 0.05),
        noisy(1.5 - (drawn() + 0.2) * LIGHT, 0.05),
        noisy(drawn(0.5), 0.05),
        noisy(drawn(levels=[1, 0.4, 0.3, 1, 0.35, 1, 0.5, 0.8]), 0.03),
        np.uint8(noisy(drawn() * 150 + 40, 5).clip(0, 255)),
    ],
    ids=["clean", "noisy", "uneven light", "dark on uneven light", "small", "dim and bright", "8 bits"],
)
def test_all_objects_are_found_and_no_other(image: Array) -> None:
    found = count_objects(image)
    scale = 0.5 if found.counting is not None and found.counting.radius < 9 else 1.0
    centers = [(round(y * scale), round(x * scale)) for y, x, _ in DISCS]
    assert found.n_segments == len(DISCS)
    assert len({int(found.labels[center]) for center in centers} - {0}) == len(DISCS)


def test_an_object_covers_what_is_nearer_to_it_than_to_the_background() -> None:
    image = drawn(levels=[1, 1, 0.5, 1, 1, 1, 1, 1])
    found = count_objects(noisy(image, 0.02))
    assert np.mean((found.labels > 0) == (image > 0)) > 0.99


def test_specks_do_not_count_unless_they_are_asked_for() -> None:
    image = drawn()
    image[5:8, 80:84] = image[110:113, 10:14] = 1
    assert count_objects(noisy(image, 0.05)).n_segments == len(DISCS)
    assert count_objects(noisy(image, 0.05), min_size=5).n_segments == len(DISCS) + 2


def test_the_background_can_be_named() -> None:
    image = noisy(1.0 - drawn(), 0.05)
    assert count_objects(image, background="brightest").n_segments == len(DISCS)
    other = count_objects(image, background="darkest")
    assert other.counting is not None
    assert not other.counting.dark
    assert other.labels[5, 90] > 0


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (60, 50)])
def test_nothing_is_found_where_there_is_nothing(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    for image in (np.zeros(shape), rng.normal(0, 1, (60, 50)), rng.choice([0, 9, 18], (60, 50), p=[0.02, 0.96, 0.02])):
        assert not count_objects(image).labels.any()
    assert count_objects(np.full((3, *shape), 7, np.uint8), spacing=(1, 1, 1)).n_segments == 0


def test_pixels_outside_the_mask_have_no_objects_and_no_influence() -> None:
    image = noisy(drawn(), 0.05)
    mask = RIGHT < 75
    found = count_objects(image, mask=mask)
    assert found.n_segments == 4
    assert not found.labels[~mask].any()
    spoiled = np.where(mask, image, np.nan)
    np.testing.assert_array_equal(count_objects(spoiled).labels, found.labels)


def test_what_is_measured_can_be_said() -> None:
    levels = [1, 1, 1, 1, 0.3, 1, 1, 1]
    image = noisy(drawn(levels=levels), 0.02)
    assert count_objects(image, neck_depth=np.inf).n_segments == len(DISCS) - 3
    assert count_objects(image, neck_depth=2).n_segments == len(DISCS)
    assert count_objects(image, min_contrast=0.5).n_segments == len(DISCS) - 1
    whole = count_objects(image, exclude_edges=True)
    assert whole.n_segments == len(DISCS) - 1
    assert not whole.labels[60, 155]
    said = count_objects(image, diameter=28).counting
    assert said is not None
    assert said.radius == 14
    assert said.least_size == pytest.approx(0.12 * np.pi * 14**2)


def test_doubtful_counts_say_why() -> None:
    half = pytest.warns(UserWarning, match="above half of the image")
    with half, pytest.warns(UserWarning, match="cover 9[0-9]% of what counts"):
        count_objects(noisy(1.0 - drawn(0.3), 0.05), background="darkest")
    volume = np.stack([noisy(drawn(), 0.1) * (1 < plane < 5) for plane in range(7)])
    with pytest.warns(UserWarning, match="objects are flat, 3 planes"):
        count_objects(volume, spacing=(1, 1, 1))


def test_wrong_arguments_are_named() -> None:
    wrong: dict[str, Any] = {"diameter": 0.0, "min_contrast": 1.5, "neck_depth": -1, "min_size": -1}
    for name, value in {**wrong, "background": "dim"}.items():
        with pytest.raises(ValueError, match=f"{name}={value!r} must be"):
            count_objects(drawn(), **{name: value})


def lit(kind: str, seed: int) -> tuple[Bytes, int]:
    """Draw discs apart from each other: rings with dim middles, or faces in relief."""
    rng = np.random.default_rng(seed)
    down, right = np.mgrid[:200, :200]
    image, n = np.zeros((200, 200)), 0
    for y, x in np.mgrid[30:200:45, 30:200:45].reshape(2, -1).T:
        radius = rng.uniform(12, 18)
        away = np.hypot(down - y, right - x)
        image += (away < radius) * (1 - 0.75 * (away < 0.5 * radius) if kind == "rings" else 1.0)
        n += 1
    relief = ndimage.gaussian_filter(rng.normal(size=image.shape), 2)
    smooth = ndimage.gaussian_filter(image, 1) * (1 + (0.2 * relief / relief.std() if kind == "relief" else 0))
    return np.uint8((30 + 120 * smooth + rng.normal(0, 4, image.shape)).clip(0, 255)), n


@pytest.mark.parametrize("kind", ["rings", "relief"])
def test_objects_with_holes_and_texture_stay_whole(kind: str) -> None:
    for seed in range(3):
        image, n = lit(kind, seed)
        for polarity in (image, 255 - image):
            assert abs(count_objects(polarity).n_segments - n) <= 1


@pytest.mark.parametrize("scale", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_coins_are_counted_at_any_scale(scale: int) -> None:
    assert count_objects(ndimage.zoom(data.coins(), scale, order=1, grid_mode=True, mode="nearest")).n_segments == 24


@pytest.mark.parametrize("n_rings", [2, 3])
def test_discs_of_a_clump_are_counted_however_round_it_is(n_rings: int) -> None:
    steps = np.arange(-n_rings, n_rings + 1)
    places = [(110 + 17.3 * b, 110 + 20 * a + 10 * b, 10) for a in steps for b in steps if abs(a + b) <= n_rings]
    clump = ndimage.gaussian_filter(np.float64(discs(places, (220, 220)) > 0), 0.8)
    assert count_objects(noisy(clump, 0.06)).n_segments == len(places)


#: Shapes in a frame of their own, in radii.
SHAPES: dict[str, Any] = {
    "dim and bright": lambda u, v, rng: (np.hypot(u, v) < rng.uniform(0.4, 1.15)) * rng.choice([1, 0.6, 0.35, 0.22]),
    "pairs": lambda u, v, _: (np.hypot(u - 0.8, v) < 1) | (np.hypot(u + 0.8, v) < 1),
    "unequal pairs": lambda u, v, _: (np.hypot(u - 0.8, v) < 1) | (np.hypot(u + 0.8, v) < 0.6),
}


def crowd(kind: str, sigma: float, seed: int) -> tuple[Bytes, int]:
    """Draw shapes side by side, turned at random, with noise; return the image and how many objects are in it."""
    rng, side, radius = np.random.default_rng(seed), 160, 6
    image, step = np.zeros((side, side)), int((3.3 if "dim" in kind else 4.4) * radius) + 2
    places = np.mgrid[step // 2 : side - step // 2 : step, step // 2 : side - step // 2 : step].reshape(2, -1).T
    for y, x in places:
        turn, (down, right) = np.exp(1j * rng.uniform(0, np.pi)), np.mgrid[:side, :side]
        at = ((right - x) + 1j * (down - y)) * turn / radius
        image = np.maximum(image, SHAPES[kind](at.real, at.imag, rng))
    smooth = ndimage.gaussian_filter(image, 0.8) + rng.normal(0, sigma, image.shape)
    return np.uint8((60 + 120 * smooth).clip(0, 255)), len(places) * (1 + ("pairs" in kind))


@pytest.mark.parametrize(
    ("kind", "sigma", "seed"), [("dim and bright", 0.08, 3), ("unequal pairs", 0.15, 0), ("pairs", 0.2, 1)]
)
def test_each_of_many_objects_is_found_by_itself(kind: str, sigma: float, seed: int) -> None:
    image, n = crowd(kind, sigma, seed)
    assert count_objects(image).n_segments == n


def test_blur_follows_the_noise_as_far_as_necks_and_sampling_allow() -> None:
    counts = [count_objects(noisy(drawn(), sigma)).counting for sigma in (0.05, 0.3, 1.5)]
    assert [count.blur for count in counts if count] == pytest.approx([0.7, 1.2, 3], rel=0.2)


def test_light_is_a_polynomial_of_the_fourth_degree() -> None:
    y, x = np.meshgrid(np.linspace(-1, 1, 40), np.linspace(-1, 1, 60), indexing="ij")
    for degree, is_light in ((4, True), (5, False)):
        light = np.float32(x**degree - x ** (degree - 2) * y**2)
        away = field_of_view._light(light, np.ones(light.shape, bool)) - (light - np.median(light))
        assert (np.ptp(away) < 0.01) == is_light


def test_a_bright_field_of_view_has_three_objects_on_it_or_more() -> None:
    field = discs([(60, 60, 50)], (120, 120)) > 0
    for n in (2, 3):
        objects = field & (discs([(60, 40 + 20 * number, 5) for number in range(n)], field.shape) == 0)
        around = field_of_view.surroundings(np.float32(objects), objects, np.ones(field.shape, bool), 3)
        assert (around is not None) == (n == 3)
