"""Claims about what an image at half its size tells of the image itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from cvtimg import denoise
from cvtimg.restoration import detail
from cvtimg.restoration.detail import halved, with_low_frequencies
from cvtimg.restoration.filters import Noisy
from cvtimg.restoration.patches import with_border


def as_noisy(values: NDArray[Any], precision: NDArray[Any]) -> Noisy:
    bordered = with_border(values.astype(np.float32))
    return Noisy(bordered, bordered, with_border(precision.astype(np.float32)[:, :, None])[:, :, 0])


def test_half_the_size_holds_the_mean_of_four_pixels_by_their_precision() -> None:
    values = np.array([[1, 3, 5], [7, 100, 9], [2, 4, 6]])[:, :, None]
    precision = np.array([[1, 1, 2], [2, 0, 1], [0, 0, 3]])
    half = halved(as_noisy(values, precision))
    found, known = half.values[2:-2, 2:-2, 0], half.precision[2:-2, 2:-2]
    # An odd last row or column counts twice; what nothing is known of is the mean of the estimate.
    np.testing.assert_allclose(known, [[4, 6], [0, 12]])
    np.testing.assert_allclose(found, [[(1 + 3 + 14) / 4, (2 * 10 + 9 * 2) / 6], [3, 6]], rtol=1e-6)


def test_low_frequencies_are_corrected_and_detail_stays(photograph: NDArray[Any]) -> None:
    clean = photograph[40:137, 64:193].astype(np.float32)  # odd sides
    rng = np.random.default_rng(0)
    blotches = 25 * gaussian_filter(rng.standard_normal(clean.shape), (4, 4, 0)).astype(np.float32)
    even = np.pad(clean, ((0, 1), (0, 1), (0, 0)), mode="edge")
    truth = even.reshape(49, 2, 65, 2, 3).mean(axis=(1, 3))
    found = with_low_frequencies(clean + blotches, truth, 20.0**2)
    assert np.square(found - clean).mean() < 0.6 * np.square(blotches).mean()
    # A coarse image without texture differs from the fine one by more than noise does, and is not believed.
    flat = np.broadcast_to(truth.mean(axis=(0, 1)), truth.shape)
    np.testing.assert_allclose(with_low_frequencies(clean, flat, 1.0), clean, atol=0.5)


@pytest.mark.slow
def test_smooth_areas_have_fewer_blotches_than_without_smaller_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    ramp = np.broadcast_to(np.linspace(0.3, 0.7, 96)[:, None, None], (96, 96, 3))
    image = ramp + 0.2 * np.random.default_rng(0).standard_normal(ramp.shape)
    corrected = denoise([image], effort="balanced").image - ramp
    monkeypatch.setattr(detail, "EFFORT", replace(detail.EFFORT, halvings=0))
    assert corrected.std() < 0.95 * (denoise([image], effort="balanced").image - ramp).std()
