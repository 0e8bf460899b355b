"""Claims about labels that keep their number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cvtimg.labels import track_labels

RNG = np.random.default_rng(2)


def test_numbers_follow_objects_however_they_are_numbered() -> None:
    y, x = np.mgrid[:40, :60]
    truth = np.stack(
        [
            np.where(np.hypot(y - 12 - t, x - 15) < 8, 1, 0) + np.where(np.hypot(y - 24, x - 45 + 2 * t) < 8, 2, 0)
            for t in range(5)
        ]
    )
    shuffled = np.stack([np.array([0, *RNG.permutation([3, 7])])[frame] for frame in truth])
    found = track_labels(shuffled)
    for label in (1, 2):
        assert len(np.unique(found[truth == label])) == 1
    np.testing.assert_array_equal(track_labels(shuffled[:, None])[:, 0], found)
    np.testing.assert_array_equal(found > 0, truth > 0)


def test_the_larger_part_of_what_divides_keeps_the_number() -> None:
    found = track_labels([[[1] * 9], [[2] * 6 + [0] + [1] * 2]])[:, 0]
    assert found.tolist() == [[1] * 9, [1] * 6 + [0] + [2] * 2]


def test_what_overlaps_too_little_is_another_and_numbers_are_not_used_again() -> None:
    frames = [[[1] * 8 + [0] * 7], [[0] * 7 + [1] * 8], [[0] * 15], [[1] * 8 + [0] * 7]]
    assert track_labels(frames).max(axis=2).ravel().tolist() == [1, 2, 0, 3]
    assert track_labels(frames[:2], min_overlap=0.01).max() == 1


@pytest.mark.parametrize(
    ("labels", "how", "message"),
    [
        (np.zeros((3, 4), int), {}, "be .T, H, W. or"),
        (np.zeros((3, 4, 4)), {}, "be integers"),
        (np.zeros((3, 4, 4), int), {"min_overlap": 2}, "in 0..1"),
    ],
)
def test_what_is_no_series_is_refused(labels: Any, how: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        track_labels(labels, **how)
