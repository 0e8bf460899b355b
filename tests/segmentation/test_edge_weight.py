from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import at_threads, edge_weighted_energy

from cvtimg._shared.types import Array
from cvtimg.segmentation.edge_weight import descend


def drawn(seed: int, n_segments: int, weighted: bool) -> tuple[Array, Array, Array | None]:
    """Values, labels with a masked part, and weights with unknown pixels."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 14, 2))
    values = rng.normal(size=(*shape, rng.integers(1, 4))).astype(np.float32)
    labels = rng.integers(1, n_segments + 1, shape).astype(np.int32)
    labels[rng.random(shape) < 0.1] = 0
    if not weighted:
        return values, labels, None
    return values, labels, (rng.random(values.shape) * (rng.random((*shape, 1)) < 0.6)).astype(np.float32)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 1 << 20),
    n_segments=st.integers(1, 5),
    edge_weight=st.sampled_from([0, 0.01, 0.3]),
    radius=st.integers(1, 4),
    power=st.sampled_from([0, 1, 0.5]),
    weighted=st.booleans(),
)
def test_energies_fall_and_are_those_of_numpy(
    seed: int, n_segments: int, edge_weight: float, radius: int, power: float, weighted: bool
) -> None:
    values, labels, weights = drawn(seed, n_segments, weighted)
    end = descend(
        values, labels, n_segments, edge_weight=edge_weight, radius=radius, weights=weights, volume_power=power
    )
    expected = edge_weighted_energy(values, end.labels, edge_weight, radius, weights, power)
    assert end.energies[-1] == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert (np.diff(end.energies) <= 1e-9 * (1 + end.energies[0])).all()
    np.testing.assert_array_equal(end.labels == 0, labels == 0)
    assert end.converged


@pytest.mark.parametrize("way", [{}, {"connected": True}, {"volume_power": 1}], ids=str)
def test_stripes_side_by_side_give_the_energy_of_the_labels_for_any_threads(way: dict[str, Any]) -> None:
    rng = np.random.default_rng(5)
    shapes = np.indices((300, 40)).sum(axis=0) // 30 % 3
    values = (shapes[..., None] + rng.normal(0, 0.5, (300, 40, 2))).astype(np.float32)
    labels = np.where(rng.random(shapes.shape) < 0.3, 1, shapes + 1).astype(np.int32)
    one, three = at_threads(lambda: descend(values, labels, 3, edge_weight=0.1, **way))
    np.testing.assert_array_equal(one.labels, three.labels)
    assert one.energies == three.energies
    expected = edge_weighted_energy(values, one.labels, 0.1, 3, None, way.get("volume_power", 0))
    assert one.energies[-1] == pytest.approx(expected, rel=1e-6)
    assert one.energies[-1] < one.energies[0]


@settings(max_examples=12)
@given(seed=st.integers(0, 1 << 20), edge_weight=st.sampled_from([0, 0.02, 0.2]), weighted=st.booleans())
def test_at_the_end_no_single_transfer_to_a_near_segment_lowers_the_energy(
    seed: int, edge_weight: float, weighted: bool
) -> None:
    values, labels, weights = drawn(seed, 3, weighted)
    end = descend(values, labels, 3, edge_weight=edge_weight, radius=2, weights=weights)
    least = edge_weighted_energy(values, end.labels, edge_weight, 2, weights)
    for y, x in np.argwhere(end.labels > 0):
        down, right = np.ogrid[: end.labels.shape[0], : end.labels.shape[1]]
        near = end.labels[(down - y) ** 2 + (right - x) ** 2 <= 4]
        for label in np.unique(near[near > 0]):
            moved = end.labels.copy()
            moved[y, x] = label
            assert edge_weighted_energy(values, moved, edge_weight, 2, weights) >= least - 1e-5


def test_unknown_pixels_take_the_label_of_their_surroundings() -> None:
    truth = np.repeat([1, 2], 12)[None].repeat(20, axis=0).astype(np.int32)
    weights = np.ones((20, 24, 1), np.float32)
    weights[5:15, 3:9] = weights[5:15, 14:20] = 0
    rng = np.random.default_rng(0)
    values = np.where(weights > 0, truth[..., None], rng.normal(0, 9, weights.shape)).astype(np.float32)
    start = np.where(weights[..., 0] > 0, truth, rng.integers(1, 3, truth.shape)).astype(np.int32)
    end = descend(values, start, 2, edge_weight=0.01, weights=weights)
    np.testing.assert_array_equal(end.labels, truth)
    np.testing.assert_allclose(end.generators, [[1], [2]])


def test_arguments_stay_as_they_were_and_results_cannot_be_changed() -> None:
    values, labels, weights = drawn(5, 3, weighted=True)
    before = [array.copy() for array in (values, labels, weights) if array is not None]
    end = descend(values, labels, 3, edge_weight=0.1, weights=weights)
    for array, copy in zip((values, labels, weights), before, strict=True):
        np.testing.assert_array_equal(array, copy)
    with pytest.raises(ValueError, match="read-only"):
        end.labels[0, 0] = 1
