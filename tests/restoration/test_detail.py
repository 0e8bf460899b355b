"""Claims about photographs restored by their patches."""

from typing import Any

import numpy as np
import pytest
from conftest import SAMPLES
from damaging import as_bytes, damage, psnr
from scipy import ndimage

from cvtimg import denoise, read_image
from cvtimg._shared.progress import watched
from cvtimg._shared.types import Array, Floats
from cvtimg.restoration.detail import clipped_ends, passes_of
from cvtimg.restoration.versions import Clipped, fuse, stack_versions

Damage = damage.Damage


@pytest.fixture(scope="module")
def clean(photograph: Array) -> Floats:
    return np.asarray(photograph[40:136, 64:192] / 255)


def noisy(clean: Floats, sigma: float | Floats, seed: int = 0) -> Floats:
    return clean + sigma * np.random.default_rng(seed).standard_normal(clean.shape)


def restored(images: list[Any], **options: Any) -> Floats:
    image = denoise(images, **{"effort": "fast"} | options).image
    return image / (255 if image.dtype == np.uint8 else 1)


@pytest.mark.parametrize("n_bands", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_several_versions_of_any_number_of_bands_are_better_than_their_mean_denoised(
    clean: Floats, n_bands: int
) -> None:
    bands = np.concatenate([clean, clean[:, :, ::-1] ** 2], axis=2)[:, :, :n_bands]
    versions, known = damage.damaged_versions(bands, 3, Damage(noise=0.1, holes=0.3), seed=0)
    weight = np.sum(known, axis=0)[:, :, None]
    mean = np.divide(np.sum(versions, axis=0), weight, out=np.full_like(bands, bands.mean()), where=weight > 0)
    alone = psnr(restored([mean]), bands)
    assert alone > psnr(mean, bands) + 3
    assert psnr(restored(versions, masks=known), bands) > alone + 1


@pytest.mark.slow
def test_bands_of_unequal_noise_are_each_denoised(clean: Floats) -> None:
    image = noisy(clean, np.array([0.02, 0.05, 0.15]))
    found = restored([image])
    for band in range(3):
        assert psnr(found[:, :, band], clean[:, :, band]) > psnr(image[:, :, band], clean[:, :, band]) + 1.5


def test_small_lights_keep_their_peaks_where_frames_are_moved_by_half_pixels() -> None:
    rng, (y, x) = np.random.default_rng(0), np.mgrid[:96, :96]
    places, height = np.argwhere(np.ones((5, 5))) * 17.0 + 13 + rng.uniform(-1, 1, (25, 2)), 400.0

    def sky(down: float, right: float) -> Floats:
        lights = (np.exp(-((y - a - down) ** 2 + (x - b - right) ** 2) / (2 * 0.8**2)) for a, b in places)
        return 20 + height * np.sum([*lights], axis=0)

    frames = [sky(*way) + rng.normal(0, 4, y.shape) for way in ((0, 0), (0.5, 0.5), (-0.5, 2.5), (1.5, -0.5))]
    image, true = denoise(frames, align=True, effort="fast").image, sky(0, 0)
    spots = [tuple(place) for place in np.rint(places).astype(int)]
    assert np.median([(image[at] - 20) / (true[at] - 20) for at in spots]) == pytest.approx(1, abs=0.03)


@pytest.mark.slow
def test_floating_values_are_not_clipped_and_their_unit_makes_no_difference(clean: Floats) -> None:
    image = noisy(clean, 0.1)
    assert image.min() < 0
    found = restored([image])
    dark = noisy(np.zeros((48, 64)), 0.1)
    assert abs(restored([dark]).mean()) < 0.01  # noise below 0 counts: nothing is clipped
    for scale, offset in ((1000.0, -500.0), (1e-3, 2e-3)):
        other = restored([scale * image + offset])
        assert psnr((other - offset) / scale, found) > 48  # groups differ by rounding


@pytest.mark.slow
def test_clipping_is_undone_in_versions_that_are_aligned(photograph: Array) -> None:
    from scipy.ndimage import shift as moved_by

    shifts = [(0.0, 0.0), (2.4, -3.3), (-1.6, 1.5)]
    wide = photograph[24:168, 48:208] / 255 * 0.3
    looks = [moved_by(wide, (*shift, 0), order=3, mode="nearest")[16:-16, 16:-16] for shift in shifts]
    images = [as_bytes(255 * noisy(look, 0.1, seed)) for seed, look in enumerate(looks)]
    found = denoise(images, align=True)
    np.testing.assert_allclose(found.shifts, np.negative(shifts), atol=0.4)
    as_if_not_clipped = restored([image / 255 for image in images], align=True)
    inner = (slice(6, -6), slice(6, -6))
    shade = looks[0][inner] < 0.1
    error = ((found.image / 255)[inner] - looks[0][inner])[shade].mean()
    assert abs(error) < 0.5 * abs((as_if_not_clipped[inner] - looks[0][inner])[shade].mean())


def test_what_clipping_does_to_noise_is_what_it_does_to_many_draws() -> None:
    true = np.array([0.0, 3, 10, 128, 250, 255], np.float32)
    noise = 8 * np.random.default_rng(0).standard_normal((200_000, 6))
    draws = np.clip(true + noise, 0, 255)
    clipped = Clipped.of(true, np.float32(8), 255)
    np.testing.assert_allclose(clipped.added, draws.mean(axis=0) - true, atol=0.05)
    np.testing.assert_allclose(clipped.variance, draws.var(axis=0) / 64, atol=0.01)
    slope = (np.clip(true + 0.5 + noise, 0, 255) - np.clip(true - 0.5 + noise, 0, 255)).mean(axis=0)
    np.testing.assert_allclose(clipped.slope, slope, atol=0.01)


def test_only_ends_at_which_values_pile_up_are_taken_to_clip() -> None:
    noise, sigma = (
        np.float32(8 * np.random.default_rng(0).standard_normal((400, 500))),
        np.full((400, 500), np.float32(8)),
    )
    values, zeros, level, known = np.clip(noise, 0, 255), np.zeros_like(noise), np.full_like(noise, 2), sigma > 0
    assert clipped_ends(values, known, zeros, sigma, 255)[0]
    assert not clipped_ends(values, ~known, zeros, sigma, 255)[0]
    assert not clipped_ends(level, known, level, sigma, 255)[0]


def test_the_automatic_effort_is_less_for_larger_images() -> None:
    assert [len(passes_of("auto", pixels)) for pixels in (200_000, 300_000, 4_000_000, 5_000_000)] == [5, 4, 4, 2]


@pytest.mark.slow
def test_blocks_and_scratches_are_filled(clean: Floats) -> None:
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.05, blocks=1, scratches=2), seed=0)
    found = restored(versions, masks=known)
    best = restored([noisy(clean, 0.05, seed) for seed in range(3)])
    assert psnr(found, clean) > psnr(best, clean) - 2


def test_a_restoration_tells_its_share_at_each_part_and_ends_there_if_asked(clean: Floats) -> None:
    shares: list[float] = []

    def told(share: float) -> None:
        shares.append(share)
        if share > 0.5:
            raise InterruptedError

    with pytest.raises(InterruptedError), watched(told):
        restored([noisy(clean[:48, :48], 0.1)])
    assert len(shares) > 15
    assert max(np.diff([0, *shares])) < 0.4
    assert shares[-1] < 0.9


@pytest.mark.parametrize("sigma", [0, pytest.param(3 / 255, marks=pytest.mark.slow)])
def test_holes_are_filled_and_what_is_known_does_not_suffer(clean: Floats, sigma: float) -> None:
    known = np.random.default_rng(1).random(clean.shape[:2]) >= 0.1
    image = as_bytes(255 * noisy(clean, sigma))
    found, complete = restored([image], masks=[known]), restored([image])
    blurred, _ = fuse(stack_versions([image], [known]), np.ones(1))
    assert psnr(found[~known], clean[~known]) > psnr(blurred[~known] / 255, clean[~known]) + 1
    assert psnr(found[known], clean[known]) > psnr(complete[known], clean[known]) - 0.3


#: Pictures of noise, and how near to the truth they come, in dB.
FIGURES = {"white": 29.89, "shared": 30.02, "holes": 30.53, "moved": 35.45}


@pytest.mark.parametrize("kind", FIGURES)
def test_what_is_restored_is_as_near_to_the_truth_as_numbers_were_chosen_for(kind: str) -> None:
    true = read_image(SAMPLES / "coffee.png")[60:124, 80:144] / 255
    smooth = ndimage.gaussian_filter(np.random.default_rng(3).standard_normal(true.shape), (0.7, 0.7, 0))
    known = np.random.default_rng(1).random(true.shape[:2]) < 0.5
    moved = [ndimage.shift(true, (0.4 * way, 0.3 * way, 0), mode="nearest") for way in range(3)]
    options: dict[str, dict[str, Any]] = {
        "white": {"images": [noisy(true, 0.08)]},
        "shared": {"images": [true + 0.12 * smooth]},
        "holes": {"images": [noisy(true, 0.05)], "masks": [known]},
        "moved": {
            "images": [noisy(image, 0.05, seed) for seed, image in enumerate(moved)],
            "align": "translation",
            "effort": "balanced",
        },
    }
    assert psnr(restored(**options[kind]), true) == pytest.approx(FIGURES[kind], abs=0.02)
