from typing import Any

import numpy as np
import pytest
from damaging import as_bytes, damage, psnr
from scipy.ndimage import shift as moved_by
from skimage.transform import ProjectiveTransform, warp

from cvtimg import denoise, restore
from cvtimg._shared.types import Array, Bytes, Floats
from cvtimg.restoration.alignment import MODELS, align, moved
from cvtimg.restoration.evidence import exposures
from cvtimg.restoration.versions import stack_versions

Damage = damage.Damage


def scene(photograph: Bytes, shift: tuple[float, float]) -> Floats:
    """Look at (80, 90, 3) pixels of a photograph that has moved."""
    moved = moved_by(photograph[:112, 60:182] / 255, (*shift, 0), order=3, mode="nearest")
    return np.clip(moved[16:-16, 16:-16], 0, 1)


@pytest.mark.parametrize("shift", [(3.0, -5.0), (-0.5, 7.25)])
@pytest.mark.parametrize(
    ("suffered", "most"),
    [(Damage(), 0.05), (Damage(noise=0.1), 0.1), (Damage(noise=0.1, holes=0.3, blocks=1, occlusions=1), 0.25)],
)
def test_a_known_shift_is_found(shift: tuple[float, float], suffered: object, most: float, photograph: Bytes) -> None:
    fixed, moving = scene(photograph, (0, 0)), scene(photograph, shift)
    versions, known = zip(
        *(damage.damaged_versions(one, 1, suffered, seed) for seed, one in enumerate((fixed, moving))), strict=True
    )
    stack = stack_versions([one[0] for one in versions], [one[0] for one in known])
    shifts = align(stack)[1].shifts(fixed.shape)
    np.testing.assert_array_equal(shifts[0], 0)
    np.testing.assert_allclose(shifts[1], np.negative(shift), atol=most)


def test_what_a_shift_uncovers_is_not_known_and_the_rest_is_in_place(photograph: Bytes) -> None:
    fixed, moving = scene(photograph, (0, 0)), scene(photograph, (4, -3))
    aligned, _ = align(stack_versions([fixed, moving]))
    known = aligned.known[:, :, 1]
    assert not known[-4:].any()
    assert not known[:, :3].any()
    assert known[:-5, 4:].all()
    inner = slice(8, -8)
    np.testing.assert_allclose(aligned.bands(1)[inner, inner], fixed[inner, inner], atol=0.02)


TEXTURE = np.random.default_rng(0).random((64, 80))
UPPER = np.broadcast_to(np.arange(64)[:, None] < 32, TEXTURE.shape)


@pytest.mark.parametrize(
    ("version", "known"),
    [(np.full((20, 20), 0.5), None), (TEXTURE[:4, :50], None), (np.eye(1, 99), None), (TEXTURE, [UPPER, ~UPPER])],
    ids=["flat", "small", "a row", "no pixel in common"],
)
def test_versions_of_which_nothing_tells_where_they_lie_stay_in_place(version: Array, known: Any) -> None:
    with pytest.warns(UserWarning, match=r"images\[1\] cannot be aligned with images\[0\]"):
        _, found = align(stack_versions([version, version], known))
    np.testing.assert_array_equal(found.transforms, np.tile(np.eye(3), (2, 1, 1)))


@pytest.mark.slow
def test_equal_exposures_out_of_place_have_equal_noise_and_weight(photograph: Bytes) -> None:
    rng = np.random.default_rng(0)
    shifts = [(0, 0), (2.5, -3.5), (-1.5, 4.5), (0.5, 0.5)]
    versions = [scene(photograph, shift) + 0.08 * rng.standard_normal((80, 90, 3)) for shift in shifts]
    result = restore(versions, 4, align=True, effort="fast")
    np.testing.assert_allclose(result.noise, 0.08, rtol=0.15)
    np.testing.assert_allclose(result.weights, 1, rtol=0.1)


#: Motions of about five pixels, from pixels (x, y) of the first of two frames to those of the other.
MOTIONS = {
    "translation": [[1, 0, 3.4], [0, 1, -5.2], [0, 0, 1]],
    "euclidean": [[np.cos(0.02), -np.sin(0.02), 4.3], [np.sin(0.02), np.cos(0.02), -5.6], [0, 0, 1]],
    "affine": [[1.015, -0.02, 2.5], [0.008, 0.99, -3.4], [0, 0, 1]],
    "homography": [[1.0, -0.012, 3.5], [0.012, 1.0, -4.4], [1e-4, -8e-5, 1]],
}


def two_frames(photograph: Bytes, model: str, sigma: float) -> list[Bytes]:
    """Look at a photograph twice, at (144, 216, 3) pixels; the second has 0.8 of the exposure and another white."""
    inner = np.array([[1, 0, 20], [0, 1, 20], [0, 0, 1.0]])
    to_first = inner @ np.linalg.inv(MOTIONS[model]) @ np.linalg.inv(inner)
    other = warp(photograph, ProjectiveTransform(to_first), order=3, preserve_range=True, mode="edge")
    looks, rng = (photograph, other * [0.7, 0.8, 0.85]), np.random.default_rng(0)
    return [as_bytes(look[20:164, 20:236] + rng.normal(0, sigma, (144, 216, 3))) for look in looks]


def error(found: Floats, true: Any, shape: tuple[int, ...]) -> float:
    """Root mean square distance of places that two transforms lead to."""
    corners = np.stack(np.meshgrid(np.linspace(0, shape[1] - 1, 9), np.linspace(0, shape[0] - 1, 9)), -1).reshape(-1, 2)
    apart = ProjectiveTransform(found)(corners) - ProjectiveTransform(np.array(true))(corners)
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_the_simplest_motion_that_fits_is_found_under_noise_and_other_exposure(model: str, photograph: Bytes) -> None:
    frames = two_frames(photograph, model, 5)
    _, found = align(stack_versions(frames))
    assert found.models == ("translation", model)
    assert error(found.transforms[1], MOTIONS[model], frames[0].shape) < 0.03


@pytest.mark.parametrize(
    ("model", "holes", "most"), [("euclidean", 0, 0.03), ("euclidean", 0.3, 0.05), ("homography", 0, 0.1)]
)
def test_motions_are_found_to_parts_of_a_pixel_under_strong_noise_and_holes(
    model: str, holes: float, most: float, photograph: Bytes
) -> None:
    frames = two_frames(photograph, model, 18)
    known = [np.random.default_rng(seed).random(frames[0].shape[:2]) >= holes for seed in (1, 2)]
    _, found = align(stack_versions(frames, known), model)
    assert error(found.transforms[1], MOTIONS[model], frames[0].shape) < most


def test_a_model_that_is_named_is_the_one_found(photograph: Bytes) -> None:
    frames = two_frames(photograph, "translation", 5)
    result = restore(frames, 4, align="affine", hidden="none", effort="fast")
    assert result.models == ("translation", "affine")
    assert result.misfits.max() < 0.1


def test_own_pixels_keep_their_noise_and_lie_at_the_place_of_the_first_version() -> None:
    rng = np.random.default_rng(0)
    transform = np.array([[1, 0.01, 2.3], [-0.01, 1, -1.6], [0, 0, 1]])
    y, x = np.indices((24, 32)).astype(float)
    ramp = np.float32(3 * x + 5 * y)[:, :, None]  # what the first version shows
    back = np.linalg.inv(transform)
    there = [row[0] * x + row[1] * y + row[2] for row in back[:2]]
    noise = rng.standard_normal((24, 32, 1)).astype(np.float32)
    other = np.float32(3 * there[0] + 5 * there[1])[:, :, None] + noise
    found, known = moved(other, np.ones((24, 32), np.bool_), transform, ramp)
    at = np.rint([transform[0] @ (10, 12, 1), transform[1] @ (10, 12, 1)]).astype(int)
    assert abs((found - ramp)[12, 10, 0] - noise[at[1], at[0], 0]) < 1e-3
    assert 0.8 < np.std((found - ramp)[4:-4, 4:-4]) < 1.2
    assert not known[:, -1].any()
    assert known[4:-4, 4:-4].all()


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [4, 18])
def test_a_series_is_no_worse_than_one_frame_where_detail_is_finer_than_pixels(sigma: float, photograph: Array) -> None:
    rng = np.random.default_rng(0)

    def frame(down: int, right: int) -> Floats:
        fine = photograph[down : down + 192, right : right + 224].astype(np.float64)
        return np.asarray(fine.reshape(96, 2, 112, 2, 3).mean(axis=(1, 3)))

    looks = [frame(*shift) for shift in ((8, 8), (2, 13), (15, 1), (9, 10))]
    frames = [as_bytes(look + sigma * rng.standard_normal(look.shape)) for look in looks]
    alone, together = (denoise(some, align=some is frames).image for some in (frames[:1], frames))
    inner = slice(6, -6)
    scores = [psnr(image[inner, inner] / 255, looks[0][inner, inner] / 255) for image in (alone, together)]
    assert scores[1] > scores[0] + (-0.3 if sigma < 10 else 0.8)


def test_aligned_versions_may_have_different_sizes(photograph: Array) -> None:
    first, smaller, larger = photograph[20:84, 20:100], photograph[24:80, 18:90], photograph[17:90, 21:120]
    masks = [None, np.ones(smaller.shape[:2], np.bool_), None]
    found = restore([first, smaller, larger], 4, masks=masks, align=True, effort="fast")
    assert found.image.shape == first.shape
    np.testing.assert_allclose(found.shifts, [[0, 0], [4, -2], [-3, 1]], atol=0.1)


@pytest.mark.slow
def test_clean_frames_after_a_noisy_one_count_in_full(photograph: Array) -> None:
    clean = photograph[20:116, 20:132]
    noisy = np.clip(clean + np.random.default_rng(0).normal(0, 12, clean.shape), 0, 255).astype(np.uint8)
    image = denoise([noisy, clean, clean // 2 * 2], align=True, effort="fast").image
    assert psnr(image / 255, clean / 255) > 37


def test_exposure_and_white_balance_are_found_beside_what_is_painted_over(photograph: Array) -> None:
    gains, noise = np.array([0.7, 0.8, 0.6]), np.random.default_rng(0).normal(0, 9, (3, *photograph.shape))
    other = photograph * gains + 4 + noise[1]
    other[:60, :90] = 200
    images = [photograph + noise[0], other, photograph[::-1] + noise[2]]
    found = exposures(stack_versions([as_bytes(image) for image in images]))
    np.testing.assert_allclose(found[1, :, 0], 1 / gains, rtol=0.02)
    np.testing.assert_allclose(found[1, :, 1], -4 / gains, atol=2)
    np.testing.assert_array_equal(found[[0, 2]], np.tile([1, 0], (2, 3, 1)))


@pytest.mark.slow
def test_frames_of_other_exposure_are_as_good_as_others(photograph: Array) -> None:
    looks = [photograph[down : down + 160, right : right + 192] for down, right in ((8, 8), (2, 13), (15, 1))]
    noise = np.random.default_rng(0).normal(0, 12, (3, 160, 192, 3))
    scores = []
    for gains in ([1, 1, 1], [1, 0.7, 1.4]):
        frames = [as_bytes(gain * look + one) for gain, look, one in zip(gains, looks, noise, strict=True)]
        result = denoise(frames, align=True, effort="fast")
        assert result.exposures is not None
        np.testing.assert_allclose(result.exposures[:, :, 0], np.tile(1 / np.array(gains), (3, 1)).T, rtol=0.03)
        scores.append(psnr(result.image[16:-16, 16:-16] / 255, looks[0][16:-16, 16:-16] / 255))
    assert scores[1] > scores[0] - 1.5  # of the longer exposure, a third is white; the shorter is noisier
