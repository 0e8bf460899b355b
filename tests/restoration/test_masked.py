from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvtimg import tessellate
from cvtimg.restoration.masked import masked_cells


def energy(
    values: NDArray[np.float32],
    weights: NDArray[np.float32],
    labels: NDArray[np.int32],
    generators: NDArray[np.float64],
) -> float:
    """Sum of weight times squared distance to the own generator, by the definition."""
    return float((weights * (values - generators[labels - 1]) ** 2).sum())


def drawn(seed: int, n_dims: int, n_cells: int) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
    rng = np.random.default_rng(seed)
    values = (rng.integers(0, n_cells, (12, 15, 1)) * 3 + rng.normal(size=(12, 15, n_dims))).astype(np.float32)
    weights = (rng.random((12, 15, n_dims)) * (rng.random((12, 15, n_dims)) < 0.7)).astype(np.float32)
    return values, weights, rng.integers(1, n_cells + 1, (12, 15), np.int32)


@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(1, 5))
def test_it_rests_where_each_pixel_is_nearest_and_each_generator_a_masked_mean(seed: int, n_dims: int, k: int) -> None:
    values, weights, start = drawn(seed, n_dims, k)
    end = masked_cells(values, weights, start, k)
    assert (np.diff(end.energies) <= 1e-6 * end.energies[0]).all()
    assert end.energies[-1] == pytest.approx(energy(values, weights, end.labels, end.generators), rel=1e-5, abs=1e-5)
    for cell in range(k):
        inside = weights * (end.labels == cell + 1)[:, :, None]
        masses = inside.sum(axis=(0, 1), dtype=np.float64)
        np.testing.assert_allclose(end.masses[cell], masses, rtol=1e-5)
        some = masses > 0
        means = (inside * values).sum(axis=(0, 1), dtype=np.float64)[some] / masses[some]
        np.testing.assert_allclose(end.generators[cell, some], means, atol=1e-5)
    apart = np.einsum("hwd,hwkd->hwk", weights, (values[:, :, None] - end.generators) ** 2)
    own = np.take_along_axis(apart, end.labels[:, :, None] - 1, axis=2)[:, :, 0]
    assert (own <= apart.min(axis=2) + 1e-3).all()


def test_without_gaps_it_is_the_tessellation_of_the_engine() -> None:
    values, _, start = drawn(3, 3, 4)
    end = masked_cells(values, np.ones_like(values), start, 4)
    means = np.stack([values[start == cell].mean(axis=0) for cell in range(1, 5)])
    engine = tessellate(values.reshape(-1, 3), 4, init=means)
    assert np.mean(end.labels.ravel() == engine.labels + 1) > 0.95
    assert end.energies[-1] == pytest.approx(engine.energy, rel=1e-3)


def test_what_is_missing_does_not_matter() -> None:
    values, weights, start = drawn(5, 4, 3)
    one = masked_cells(values, weights, start, 3)
    other = masked_cells(np.where(weights > 0, values, 1e3).astype(np.float32), weights, start, 3)
    np.testing.assert_array_equal(one.labels, other.labels)
    np.testing.assert_allclose(one.generators, other.generators)


def test_a_pixel_of_which_nothing_is_known_keeps_its_label() -> None:
    values, weights, start = drawn(7, 3, 3)
    weights[2:5, 3:9] = 0
    end = masked_cells(values, weights, start, 3)
    np.testing.assert_array_equal(end.labels[2:5, 3:9], start[2:5, 3:9])
