from __future__ import annotations

import numpy as np
import pytest

from cvtimg import segment_hierarchy
from cvtimg.segmentation.hierarchy.building import default_threshold


@pytest.mark.parametrize("white", [255, 60])
def test_the_default_cut_shows_many_small_spots(white: int) -> None:
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[:240, :240]
    spots = (rows % 48 - 24) ** 2 + (columns % 48 - 24) ** 2 < 36
    image = rng.normal(0.06, 0.01, spots.shape) + 0.1 * spots
    image[:8, :16] = 0.8  # something bright beside them
    hierarchy = segment_hierarchy((image * white).round().clip(0, 255).astype(np.uint8))
    labels = hierarchy.cut()
    ground = np.bincount(labels.ravel()).argmax()
    assert 0.25 <= hierarchy.default_threshold < 0.5
    assert ((labels != ground) & spots).sum() > 0.8 * spots.sum()
    assert labels.max() < 60


@pytest.mark.parametrize("deviation", [3, 20, 60])
@pytest.mark.parametrize("bands", [(), (3,)])
def test_flat_noise_is_one_region(deviation: float, bands: tuple[int, ...]) -> None:
    noise = np.random.default_rng(0).normal(60, deviation, (80, 100, *bands))
    assert segment_hierarchy(noise.clip(0, 255).astype(np.uint8)).n_regions() == 1


def test_the_threshold_is_lowered_until_two_thirds_of_the_power_lie_above() -> None:
    lengths = np.array([10, 10, 10, 100], np.int32)
    faint = np.array([0.4, 0.3, 0.3, 0.01])
    threshold = default_threshold(lengths, faint, 0.9)
    assert (faint > threshold).tolist() == [True, True, True, False]
    assert default_threshold(lengths, faint, 0.5) == 0.5  # noise
    assert default_threshold(lengths, np.array([0.6, 0.3, 0.3, 0.01]), 0.9) == 0.5
    assert default_threshold(lengths, faint / 10, 0.9) == 0.25
    assert default_threshold(lengths[:0], faint[:0], 0.9) == 0.5
    assert default_threshold(lengths, faint * 0, 0.9) == 0.5
