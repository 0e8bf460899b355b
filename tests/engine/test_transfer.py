from itertools import product

import numpy as np
import pytest

from cvtimg import tessellate
from cvtimg._shared.types import Array, Floats

POWERS = [0, 0.5, 1, 2, 3]


@pytest.fixture
def skewed() -> Floats:
    """Return 460 points, most of them in one heavy cluster, on which Lloyd's method with frozen weights fails."""
    rng = np.random.default_rng(4)
    sizes, centers = (400, 40, 15, 5), ((0, 0), (60, 0), (0, 90), (150, 150))
    return np.concatenate([rng.normal(center, 12, (n, 2)) for n, center in zip(sizes, centers, strict=True)])


def weighted_energy(rows: Array, labels: Array, n_cells: int, power: float) -> float:
    cells = [rows[labels == k] for k in range(n_cells)]
    return sum((len(c) / len(rows)) ** power * ((c - c.mean(axis=0)) ** 2).sum() for c in cells if len(c))


@pytest.mark.parametrize("power", POWERS)
def test_figures_are_those_of_the_labels(power: float, skewed: Array) -> None:
    result = tessellate(skewed, 5, volume_power=power)
    means = np.array([skewed[result.labels == k].mean(axis=0) for k in range(5)])
    np.testing.assert_allclose(result.generators, means, rtol=1e-5, atol=1e-4)
    np.testing.assert_allclose(result.weighted_energy, weighted_energy(skewed, result.labels, 5, power), rtol=1e-5)


@pytest.mark.parametrize("power", POWERS)
def test_no_single_transfer_lowers_the_energy_at_the_end(power: float, skewed: Array) -> None:
    rows = skewed[::4]
    result = tessellate(rows, 4, method="transfer", volume_power=power, effort="best", init=rows[:4])
    for point, cell in product(range(len(rows)), range(4)):
        labels = result.labels.copy()
        labels[point] = cell
        if np.bincount(labels, minlength=4).all():
            moved = weighted_energy(rows, labels, 4, power)
            assert moved >= result.weighted_energy * (1 - 1e-5)


@pytest.mark.parametrize("power", [0, 0.5, 1, 2])
def test_the_best_partition_is_found_where_all_can_be_tried(power: float) -> None:
    rows = np.random.default_rng(int(10 * power)).normal(size=(7, 2))
    partitions = (np.array(labels) for labels in product(range(3), repeat=7))
    least = min(
        weighted_energy(rows, labels, 3, power) for labels in partitions if np.bincount(labels, minlength=3).all()
    )
    result = tessellate(rows, 3, method="transfer", volume_power=power, effort="best")
    assert result.weighted_energy == pytest.approx(least, rel=1e-5)


@pytest.mark.parametrize("power", POWERS)
def test_locked_generators_stay_and_the_energy_still_falls(power: float, skewed: Array) -> None:
    result = tessellate(skewed, 5, volume_power=power, locked=[[70, 70]], method="transfer")
    np.testing.assert_allclose(result.generators[0], [70, 70], rtol=1e-6)
    assert (np.diff(result.energies) <= 1e-9 * result.energies[0]).all()
