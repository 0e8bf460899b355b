"""Claims about pieces of labels, and labels that keep their number."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from cvtimg._shared.types import Array, Floats32, Ints
from cvtimg.labels import track_labels
from cvtimg.labels.components import absorb_small, connected_pieces


def drawn(seed: int) -> tuple[Ints, Floats32]:
    """Pieces of random labels with a hole in the mask, and values."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 16, 2))
    labels = rng.integers(1, 4, shape).astype(np.int32)
    labels[rng.random(shape) < 0.1] = 0
    return connected_pieces(labels), rng.normal(size=(*shape, 2)).astype(np.float32)


def neighbors(regions: Array) -> set[tuple[int, int]]:
    found = set()
    for one, two in ((regions[1:], regions[:-1]), (regions[:, 1:], regions[:, :-1])):
        apart = (one != two) & (one > 0) & (two > 0)
        found |= {(min(a, b), max(a, b)) for a, b in zip(one[apart].tolist(), two[apart].tolist(), strict=True)}
    return found


@settings(max_examples=40)
@given(seed=st.integers(0, 1 << 20), min_size=st.integers(2, 60), price=st.sampled_from([0.0, 0.5]))
def test_only_pieces_without_a_neighbor_stay_small(seed: int, min_size: int, price: float) -> None:
    pieces, values = drawn(seed)
    if not pieces.any():
        return
    kept = absorb_small(pieces, values, min_size, price)
    np.testing.assert_array_equal(kept > 0, pieces > 0)
    sizes = np.bincount(kept.ravel())
    beside = set(itertools.chain.from_iterable(neighbors(kept)))
    assert all(sizes[region] >= min_size or region not in beside for region in np.unique(kept[kept > 0]))
    for region in np.unique(kept[kept > 0]):
        assert ndimage.label(kept == region)[1] == 1


def test_a_small_piece_goes_to_the_neighbor_that_costs_least() -> None:
    levels = np.array([[0, 0, 0, 6, 10, 10, 10]])
    kept = absorb_small(np.array([[1, 1, 1, 2, 3, 3, 3]], np.int32), levels[..., None].astype(np.float32), 2)
    np.testing.assert_array_equal(kept, [[1, 1, 1, 3, 3, 3, 3]])


def test_the_smallest_goes_first() -> None:
    # 2 (one pixel) goes to 3, nearest to it; with it 3 is large enough to stay.
    levels = np.array([[0, 0, 0, 0, 5, 7, 7, 20, 20, 20, 20]])
    pieces = np.array([[1, 1, 1, 1, 2, 3, 3, 4, 4, 4, 4]], np.int32)
    kept = absorb_small(pieces, levels[..., None].astype(np.float32), 3)
    np.testing.assert_array_equal(kept, [[1, 1, 1, 1, 3, 3, 3, 4, 4, 4, 4]])


@pytest.mark.parametrize("labels", [[[1, 1, 2, 3]], [[1, 1, 1], [1, 1, 1]]])
def test_any_size_may_be_asked_for(labels: Any) -> None:
    levels = np.array(labels, np.int32)
    for size in (10, 2**40):
        assert len(np.unique(absorb_small(levels, levels[..., None].astype(np.float32), size))) == 1


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


@pytest.mark.parametrize(
    ("labels", "message"), [(np.zeros((3, 4), int), "be .T, H, W. or"), (np.zeros((3, 4, 4)), "be integers")]
)
def test_what_is_no_series_is_refused(labels: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        track_labels(labels)
