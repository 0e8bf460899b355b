"""Claims about patches in cells of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
from damaging import psnr
from numpy.typing import NDArray

from cvtimg.restoration.patches import _filtered, _Filters, restore_detail


def restored(
    photograph: NDArray[Any], sigmas: tuple[float, float], share: bool = True
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Restore a photograph whose left half has less noise than the right; return it, what it was, and the truth."""
    clean = (photograph[:96, 64:192] / 255).astype(np.float32)
    sigma = np.repeat([*sigmas], 64)[None].repeat(96, axis=0).astype(np.float32)
    noisy = clean + sigma[..., None] * np.random.default_rng(0).standard_normal(clean.shape).astype(np.float32)
    shares = (sigma.min() / sigma) ** 2 if share else np.ones_like(sigma)
    found = restore_detail(noisy, shares, float(sigma.min()), 24, "fast", np.random.default_rng(0))
    return found.image, noisy, clean


def test_pixels_count_by_how_well_they_are_known(photograph: NDArray[Any]) -> None:
    image, noisy, clean = restored(photograph, (0.03, 0.2))
    for half in (slice(4, 60), slice(68, 124)):
        assert psnr(image[:, half], clean[:, half]) > psnr(noisy[:, half], clean[:, half])
    blind, _, _ = restored(photograph, (0.03, 0.2), share=False)
    assert psnr(image[:, 68:124], clean[:, 68:124]) > psnr(blind[:, 68:124], clean[:, 68:124]) + 3


def test_a_pixel_is_the_mean_of_its_patches_weighted_by_what_their_filters_leave() -> None:
    image = np.random.default_rng(0).random((9, 14, 1)).astype(np.float32)
    labels = np.repeat([0, 1], 7)[None].repeat(9, axis=0).astype(np.int32)
    # The first cell keeps nothing of a patch, the second all of it.
    axes = np.eye(25, dtype=np.float32)[None].repeat(2, axis=0)
    filters = _Filters(np.zeros((2, 25), np.float32), axes, np.array([[0.0], [1e12]]).repeat(25, axis=1))
    found = _filtered(image, labels, filters, 1.0)
    trust = 1 / (np.array([0.0, 1.0]) + 0.02)
    for y, x in ((4, 2), (4, 5), (4, 6), (4, 7), (2, 9)):
        near = labels[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3]
        expected = image[y, x, 0] * (trust[near] * (near == 1)).sum() / trust[near].sum()
        np.testing.assert_allclose(found[y, x, 0], expected, rtol=1e-5)
