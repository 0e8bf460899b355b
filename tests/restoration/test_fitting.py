"""Versions that cannot be laid over each other are told, and left out."""

from typing import Any

import numpy as np
import pytest
from damaging import psnr
from skimage.transform import EuclideanTransform, warp

from cvtimg import denoise, restore
from cvtimg._shared.types import Array, Bytes, Floats
from cvtimg.restoration.evidence import MOST_MISFIT, misfits
from cvtimg.restoration.versions import stack_versions

RNG = np.random.default_rng(3)


@pytest.fixture
def photograph(photograph: Array) -> Array:
    """Return a part of the photograph."""
    return np.ascontiguousarray(photograph[:176, 40:216])


def noisy(image: Array, sigma: float = 18) -> Bytes:
    return np.clip(image + RNG.normal(0, sigma, image.shape), 0, 255).astype(np.uint8)


def turned(image: Array, degrees: float, shift: tuple[float, float]) -> Array:
    transform = EuclideanTransform(rotation=np.radians(degrees), translation=shift)
    return warp(image, transform, mode="edge", preserve_range=True)


def misfit(*images: Array, noise: float = 18) -> Floats:
    return misfits(stack_versions(images), np.full(len(images), noise))


@pytest.fixture
def turned_series(photograph: Array) -> list[Bytes]:
    return [noisy(photograph), noisy(turned(photograph, 4, (5, -7))), noisy(turned(photograph, -3, (-6, 5)))]


@pytest.mark.slow
@pytest.mark.parametrize("align", [False, "translation"])
def test_turned_frames_are_left_out_with_a_warning(turned_series: list[Bytes], photograph: Array, align: Any) -> None:
    with pytest.warns(UserWarning, match=r"images\[1\], images\[2\] cannot be laid over images\[0\] and are left out"):
        result = denoise(turned_series, align=align, effort="fast")
    alone = denoise(turned_series[:1], effort="fast")
    truth = photograph / 255
    assert psnr(result.image / 255, truth) > psnr(alone.image / 255, truth) - 0.1
    assert (result.left_out[100:150, 100:150] == 2).all()


def test_nothing_is_left_out_with_hidden_none_but_said(turned_series: list[Bytes]) -> None:
    with pytest.warns(UserWarning, match=r"images\[2\] .* may spoil the result"):
        result = restore(turned_series, 4, hidden="none", effort="fast")
    assert not result.left_out.any()


def test_the_odd_one_is_left_out_even_if_it_comes_first(photograph: Array) -> None:
    photograph = np.ascontiguousarray(photograph[::2, ::2])
    other = noisy(np.ascontiguousarray(photograph[::-1]))
    with pytest.warns(UserWarning, match=r"^images\[0\] cannot be laid over images\[1\] and is left out"):
        result = restore([other, noisy(photograph), noisy(photograph)], 4, effort="fast")
    np.testing.assert_array_equal(result.left_out, 1)


def test_versions_that_fit_have_no_misfit_whatever_noise_gaps_and_exposure(photograph: Array) -> None:
    painted, salted = photograph.copy(), photograph.copy()
    painted[:, :100] = 60
    where = RNG.random(photograph.shape[:2]) < 0.1
    salted[where] = RNG.integers(0, 256, (int(where.sum()), 3))
    holes = noisy(photograph).astype(np.float32)
    holes[RNG.random(holes.shape[:2]) < 0.3] = np.nan
    whole = noisy(photograph)
    assert misfit(whole, noisy(painted), noisy(salted), noisy(photograph * 0.6)).max() < 0.15
    assert misfit(whole.astype(np.float32), holes).max() < 0.15
    assert misfit(whole, noisy(turned(photograph, 0, (0.5, 0)))).max() < 0.15
    assert misfit(whole, noisy(turned(photograph, 0, (3, 0)))).max() > 2 * MOST_MISFIT
    assert misfit(np.full((40, 50), 9, np.uint8), np.full((40, 50), 99, np.uint8)).max() == 0


def test_a_version_without_a_known_pixel_is_no_hang() -> None:
    image = RNG.integers(0, 256, (30, 40), np.uint8)
    result = restore([image, image], 3, masks=[None, np.zeros((30, 40))], align=True)
    np.testing.assert_array_equal(result.coverage, 1)


def test_one_version_to_align_is_told() -> None:
    with pytest.warns(UserWarning, match="align='auto' has nothing to align: there is one version"):
        restore([noisy(np.full((8, 9), 90))], 1, align=True, edge_weight=0, effort="fast")


@pytest.mark.slow
def test_a_copy_is_told_and_counts_once_for_detail(photograph: Array) -> None:
    image = noisy(photograph[:40, :40])
    with pytest.warns(UserWarning, match=r"images\[1\] is a copy of images\[0\] and counts once"):
        twice = denoise([image, image], effort="fast")
    np.testing.assert_array_equal(twice.image, denoise([image], effort="fast").image)


def test_small_versions_of_another_image_are_told(photograph: Array) -> None:
    small = photograph[40:136, 40:136]
    found = misfit(noisy(small), noisy(small), noisy(small[::-1]))
    np.testing.assert_allclose(found[0], [0, 0, 2], atol=0.3)
    with pytest.warns(UserWarning, match=r"images\[1\] cannot be laid over images\[0\]"):
        restore([noisy(small), noisy(small[::-1])], 4, effort="fast")  # what they differ by is not their noise


def test_copies_of_a_flat_image_stay_as_they_are() -> None:
    flat = np.full((3, 9), 90, np.uint8)
    with pytest.warns(UserWarning, match="counts once"):
        found = denoise([flat, flat], align=True)
    np.testing.assert_array_equal(found.image, flat)
