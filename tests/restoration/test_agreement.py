"""Claims about versions that disagree: what was added to one, and what hides an object."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from conftest import SAMPLES
from damaging import card, damage, psnr, two_phases
from skimage.draw import disk, ellipse, line

from cvtimg import denoise, read_image, restore
from cvtimg._shared.types import Array, Floats
from cvtimg.restoration import evidence
from cvtimg.restoration.evidence import without_background, without_motion, without_outliers
from cvtimg.restoration.versions import stack_versions

Damage = damage.Damage


def exposures(clean: Floats, sigma: float, seed: int = 0) -> list[Floats]:
    """Four noisy exposures: cosmic rays in the first, dust in the second, hot pixels in the third, then a passer-by."""
    rng = np.random.default_rng(seed)
    height, width = shape = clean.shape[:2]
    rays, dusty, hot, passed = (clean.copy() for _ in range(4))
    for _ in range(12):
        row, column = rng.integers(height - 20), rng.integers(width - 20)
        rays[line(row, column, row + rng.integers(20), column + rng.integers(20))] = 1
    for _ in range(10):
        dusty[disk((rng.integers(height), rng.integers(width)), rng.integers(3, 8), shape=shape)] *= 0.35
    hot[rng.random(shape) < 0.01] = 1
    passed[ellipse(0.6 * height, 0.35 * width, 0.3 * height, 0.09 * width, shape=shape)] = 0.15, 0.2, 0.55
    return [one + sigma * rng.standard_normal(clean.shape) for one in (rays, dusty, hot, passed)]


@pytest.mark.slow
@pytest.mark.parametrize("verb", [partial(restore, n_generators=16), denoise])
def test_what_is_added_in_one_exposure_is_left_out(verb: Callable[..., Any]) -> None:
    clean = read_image(SAMPLES / "europe_night.png")[20:260, 100:400] / 255
    versions = exposures(clean, 0.08)
    median = psnr(np.median(versions, axis=0), clean)
    result = verb(versions, effort="fast")
    assert psnr(result.image, clean) > median + 1
    assert psnr(verb(versions, effort="fast", hidden=None).image, clean) < psnr(result.image, clean) - 3
    np.testing.assert_array_equal(result.coverage, 4)
    assert 0.03 < (result.left_out > 0).mean() < 0.12


def test_nothing_is_left_out_of_a_quiet_version_among_noisy_ones() -> None:
    sigmas = np.array([2.0, 8.0, 8.0])
    values = sigmas[:, None, None] * np.random.default_rng(0).standard_normal((3, 200, 200))
    versions = stack_versions(list(values))
    assert np.count_nonzero(~without_outliers(versions, sigmas).known) < 20


def test_spikes_are_left_out_of_flat_segments_where_holes_leave_no_majority() -> None:
    clean, _ = card(64)
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.1, holes=0.3), seed=0)
    rng = np.random.default_rng(1)
    spiked = [version.copy() for version in versions]
    for version in spiked:
        hit = rng.random(clean.shape[:2]) < 0.02
        version[hit] = rng.integers(2, size=(np.count_nonzero(hit), 1))
    found_in = partial(restore, n_generators=4, masks=known, effort="fast")
    plain = found_in(versions)
    found = found_in(spiked)
    assert psnr(found.image, clean) > psnr(plain.image, clean) - 5
    assert psnr(found_in(spiked, hidden="none").image, clean) < psnr(found.image, clean) - 5
    alone = np.sum(known, axis=0) == 1
    assert 0.005 < (found.left_out[alone] > 0).mean() < 0.05
    # Without additions there is no evidence, and nothing is left out.
    np.testing.assert_array_equal(plain.left_out, 0)


@pytest.mark.parametrize("sigma", [0, 0.1])
@pytest.mark.parametrize("space", ["rgb", "lab"])
def test_nothing_is_left_out_where_versions_differ_by_noise_alone(photograph: Array, sigma: float, space: str) -> None:
    rng = np.random.default_rng(0)
    part = photograph[:96, :96]
    levels = [np.clip(part + 255 * sigma * rng.standard_normal(part.shape), 0, 255) for _ in range(4)]
    versions = stack_versions([np.rint(one).astype(np.uint8) for one in levels], space=space)
    kept = without_outliers(versions, np.full(4, max(sigma, 1 / 256) * (255 if space == "rgb" else 100)))
    assert (~kept.known).mean() < (5e-4 if space == "rgb" else 5e-3)  # noise in Lab is larger where it is dark


def test_versions_of_other_exposure_or_place_are_not_left_out_as_a_whole(photograph: Array) -> None:
    rng = np.random.default_rng(0)
    images = [photograph * gain + rng.normal(0, 2, photograph.shape) for gain in (1, 0.9, 1.1)]
    kept = without_outliers(stack_versions(images), np.full(3, 2.0))
    assert (~kept.known).mean() < 0.05


def test_a_tie_leaves_nothing_out_and_two_versions_cannot_outvote_each_other() -> None:
    dark, bright = np.zeros((20, 20)), np.zeros((20, 20))
    bright[5:15, 5:15] = 1
    for images in ([dark, dark, bright, bright], [dark, bright]):
        versions = stack_versions(images)
        assert without_outliers(versions, np.full(len(images), 0.01)).known.all()


def test_bands_of_rows_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    clean, _ = card(64)
    versions, known = damage.damaged_versions(clean, 4, Damage(noise=0.1, holes=0.1, occlusions=2), seed=0)
    stack, noise = stack_versions(versions, known), np.full(4, 0.1)
    for leave_out in (without_outliers, without_background, without_motion):
        whole = leave_out(stack, noise).known
        with monkeypatch.context() as patch:
            patch.setattr(evidence, "_in_bands", partial(evidence._in_bands, most=64 * 4 * 7))
            np.testing.assert_array_equal(leave_out(stack, noise).known, whole)
        assert (whole != stack.known).any()


def test_with_background_hidden_parts_that_only_one_version_shows_come_back() -> None:
    truth = two_phases(80)
    down, right = np.mgrid[:80, :80] / 80
    rng = np.random.default_rng(0)
    versions = []
    for number in range(4):
        version = truth.copy()
        if number < 3:  # three patches that overlap
            version[np.hypot(down - 0.45 - 0.02 * number, right - 0.62 + 0.03 * number) < 0.13] = 0
        versions.append(version + 0.1 * rng.standard_normal(truth.shape))
    object_there = truth[:, :, 0] == 1
    result = restore(versions, 2, hidden="background", effort="fast")
    assert np.mean((result.labels == 2) == object_there) >= 0.998
    assert np.mean((restore(versions, 2, effort="fast").labels == 2) == object_there) < 0.98
    np.testing.assert_allclose(result.colors.ravel(), [0, 1], atol=0.03)


def test_the_background_is_the_commonest_color() -> None:
    clean, which = card(64)
    hidden = clean.copy()
    hidden[which == 2] = clean[which == 0][0]  # painted over by the background
    result = restore([hidden, hidden, clean], 4, hidden="background")
    np.testing.assert_allclose(result.image, clean, atol=0.01)
    np.testing.assert_array_equal(result.left_out, np.where(which == 2, 2, 0))


def test_with_motion_what_departs_from_the_first_is_left_out_whatever_most_show() -> None:
    rng, truth = np.random.default_rng(0), np.zeros((40, 50, 5))
    for number in range(5):
        truth[8:20, 9 * number : 9 * number + 9, number] = 40  # moves on
    noisy = [truth[..., number] + rng.normal(0, 5, (40, 50)) for number in range(5)]
    kept = without_motion(stack_versions(noisy), np.full(5, 5.0)).known
    moved = truth != truth[..., :1]
    assert kept[..., 0].all()
    assert kept[moved].mean() < 0.02
    assert kept[~moved].mean() > 0.9


def test_moved_versions_may_differ_where_pixels_vary_but_not_where_they_are_alike() -> None:
    images = np.full((3, 20, 24), 50.0)
    images[:, :, 12:] = 200
    images[1, :, 12] = 140  # the edge lies elsewhere within its pixel
    images[2, 5:7, 4] = 120  # a cosmic ray
    moved, still = (
        without_outliers(stack_versions(list(images)), np.full(3, 5.0), moved=moved) for moved in (True, False)
    )
    assert moved.known[:, 12, 1].all()
    assert not still.known[:, 12, 1].any()
    assert not moved.known[5:7, 4, 2].any()
