from __future__ import annotations

import numpy as np
import pytest
from damaging import damage, psnr
from numpy.typing import NDArray
from scipy.ndimage import shift as moved_by

from cvtimg import restore
from cvtimg.restoration.alignment import align
from cvtimg.restoration.versions import stack_versions

Damage = damage.Damage


def scene(photograph: NDArray[np.uint8], shift: tuple[float, float]) -> NDArray[np.float64]:
    """Look at (80, 90, 3) pixels of a photograph that has moved."""
    moved = moved_by(photograph[:112, 60:182] / 255, (*shift, 0), order=3, mode="nearest")
    return np.clip(moved[16:-16, 16:-16], 0, 1)


@pytest.mark.parametrize("shift", [(3.0, -5.0), (-0.5, 7.25)])
@pytest.mark.parametrize(
    ("suffered", "most"),
    [(Damage(), 0.05), (Damage(noise=0.1), 0.1), (Damage(noise=0.1, holes=0.3, blocks=1, occlusions=1), 0.25)],
)
def test_a_known_shift_is_found(
    shift: tuple[float, float], suffered: object, most: float, photograph: NDArray[np.uint8]
) -> None:
    fixed, moving = scene(photograph, (0, 0)), scene(photograph, shift)
    versions, known = zip(
        *(damage.damaged_versions(one, 1, suffered, seed) for seed, one in enumerate((fixed, moving))), strict=True
    )
    _, shifts = align(stack_versions([one[0] for one in versions], [one[0] for one in known]))
    np.testing.assert_array_equal(shifts[0], 0)
    np.testing.assert_allclose(shifts[1], np.negative(shift), atol=most)


def test_what_a_shift_uncovers_is_not_known_and_the_rest_is_in_place(photograph: NDArray[np.uint8]) -> None:
    fixed, moving = scene(photograph, (0, 0)), scene(photograph, (4, -3))
    aligned, _ = align(stack_versions([fixed, moving]))
    known = aligned.known[:, :, 1]
    assert not known[-4:].any()
    assert not known[:, :3].any()
    assert known[:-5, 4:].all()
    inner = slice(8, -8)
    np.testing.assert_allclose(aligned.bands(1)[inner, inner], fixed[inner, inner], atol=0.02)


def test_restoration_with_alignment_is_as_good_as_without_shifts(photograph: NDArray[np.uint8]) -> None:
    clean = scene(photograph, (0, 0))
    rng = np.random.default_rng(0)

    def noisy(shift: tuple[float, float]) -> NDArray[np.float64]:
        return scene(photograph, shift) + 0.1 * rng.standard_normal(clean.shape)

    shifts = [(0, 0), (2.5, -3.2), (-1.3, 4.7)]
    versions = [noisy((0, 0))] + [noisy((down, right)) for down, right in shifts[1:]]
    inner = slice(6, -6)
    blind = restore(versions, 24, detail=True)
    result = restore(versions, 24, detail=True, align=True)
    np.testing.assert_allclose(result.shifts, np.negative(shifts), atol=0.15)
    assert (
        psnr(result.image[inner, inner], clean[inner, inner]) > psnr(blind.image[inner, inner], clean[inner, inner]) + 3
    )


def test_flat_versions_are_left_where_they_are() -> None:
    flat = np.full((20, 20), 0.5)
    _, shifts = align(stack_versions([flat, flat]))
    np.testing.assert_array_equal(shifts, 0)


def test_equal_exposures_out_of_place_have_equal_noise_and_weight(photograph: NDArray[np.uint8]) -> None:
    rng = np.random.default_rng(0)
    shifts = [(0, 0), (2.5, -3.5), (-1.5, 4.5), (0.5, 0.5)]
    versions = [scene(photograph, shift) + 0.08 * rng.standard_normal((80, 90, 3)) for shift in shifts]
    result = restore(versions, 16, align=True)
    np.testing.assert_allclose(result.noise, 0.08, rtol=0.1)
    np.testing.assert_allclose(result.weights, 1, rtol=0.1)
