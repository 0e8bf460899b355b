"""Regions that move as a whole: cuts are least, energies those of the labels, and what stays is what describes best."""

from itertools import product

import numpy as np
import pytest
from reference import edge_weighted_energy

from cvtimg import segment
from cvtimg.segmentation.edge_weight import descend, neighbors
from cvtimg.segmentation.region_moves import Parts, _joined, parts_of, rearranged


def some_parts(seed: int, n_segments: int = 3) -> tuple[Parts, np.ndarray, np.ndarray]:
    """Squares of an image in parts, with their numbers, padded by 3, and labels."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(9, 12, 2)).astype(np.float32)
    blocks = (1 + np.arange(9)[:, None] // 3 * 4 + np.arange(12) // 3).astype(np.int32)
    numbers = np.pad(blocks, 3)
    steps = (neighbors(3)[:, 1:] @ (numbers.shape[1], 1)).astype(np.int32)
    rates = np.stack([rng.uniform(0.5, 2, n_segments), rng.normal(size=n_segments)], axis=1)
    return parts_of(values, numbers, 3, steps, 0.06, rates), values, blocks


@pytest.mark.parametrize("seed", range(4))
def test_a_cut_is_the_best_of_all_sets_of_parts(seed: int) -> None:
    parts, _, _ = some_parts(seed)
    labels = np.random.default_rng(seed).integers(0, 3, len(parts.masses))
    costs = parts.costs_at(np.random.default_rng(seed + 9).normal(size=(3, 2)))

    def energy(labels: np.ndarray) -> float:
        borders = parts.borders[labels[parts.tails] != labels[parts.heads]].sum() / 2
        return float(costs[labels, np.arange(len(labels))].sum() + borders)

    joined = _joined(parts, labels, 1, costs)
    best = min(energy(np.where(way, 1, labels)) for way in product([False, True], repeat=len(labels)))
    assert energy(labels if joined is None else joined) == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_energies_of_parts_are_those_of_pixels_and_fall(seed: int) -> None:
    parts, values, blocks = some_parts(seed)
    plain = Parts(*(getattr(parts, name) for name in Parts.__slots__[:-1]), np.tile([1.0, 0.0], (3, 1)))
    before = np.random.default_rng(seed).integers(0, 3, len(parts.masses))
    after = rearranged(plain, before)
    for labels in (before, after):
        expected = edge_weighted_energy(values, (labels[blocks - 1] + 1).astype(np.int32), 0.03, 3, None)
        assert plain.energy(labels) == pytest.approx(expected, rel=1e-6)
    assert parts.energy(rearranged(parts, before)) <= parts.energy(before)
    assert plain.energy(after) <= plain.energy(before)


def test_a_region_that_is_not_worth_its_edges_goes_though_no_pixel_would() -> None:
    down, right = np.indices((80, 80))
    values = np.where(np.hypot(down - 40, right - 40) < 9, 1.0, 0.0) + (right > 70)
    labels = (values > 0).astype(np.int32) + 1
    weight = 1 / 72 * 14  # a disc of this radius would be worth it
    alone, moved = (
        descend(values[..., None].astype(np.float32), labels, 2, edge_weight=weight, of_regions=of_regions)
        for of_regions in (None, weight)
    )
    assert alone.labels[40, 40] == 2
    assert moved.labels[40, 40] == 1
    assert moved.energies[-1] < alone.energies[-1]


@pytest.mark.parametrize("width", [1, 2])
@pytest.mark.parametrize("contrast", [80, 200])
@pytest.mark.parametrize("noise", [0, 5])
def test_thin_lines_and_dots_of_high_contrast_stay_by_default(width: int, contrast: int, noise: int) -> None:
    down, right = np.indices((120, 120))
    rest = np.random.default_rng(0).normal(0, noise, down.shape)
    for drawn in ((right % 20 < width) & (abs(down - 60) < 50), (right % 20 < width) & (down % 20 < width)):
        image = np.clip(30 + contrast * drawn + rest, 0, 255).astype(np.uint8)
        kept = segment(image, 2).labels == 2
        assert kept[drawn].mean() > 0.95
        assert kept[~drawn].mean() < 0.01


def test_a_dim_object_in_a_quiet_ground_stays_beside_a_bright_one() -> None:
    down, right = np.indices((120, 120))
    rng = np.random.default_rng(1)
    dim, bright = np.hypot(down - 40, right - 40) < 3, np.hypot(down - 80, right - 80) < 15
    image = 20 + rng.normal(0, 1, dim.shape) + 25 * dim + bright * (180 + rng.normal(0, 15, dim.shape))
    labels = segment(image.clip(0, 255).astype(np.uint8), 3).labels
    assert (labels[dim] > 1).mean() > 0.8
    assert (labels[~dim & ~bright] == 1).mean() > 0.99
