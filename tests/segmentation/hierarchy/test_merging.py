from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cvtimg._shared.types import Array
from cvtimg.labels.components import Borders
from cvtimg.segmentation.hierarchy.leaves import Leaves
from cvtimg.segmentation.hierarchy.settings import SETTINGS


def chi_square(one: Array, other: Array) -> float:
    p, q = one / one.sum(), other / other.sum()
    return float(((p - q) ** 2 / np.where(p + q > 0, p + q, 1)).sum() / 2)


def merged_naively(
    pairs: Array, lengths: Array, strengths: Array, sizes: Array, histograms: list[Array]
) -> tuple[list[tuple[int, int]], list[float]]:
    """Compare all pairs of neighbors anew for each merge, from sets of leaves."""
    regions = {number: {number} for number in range(len(sizes))}
    between = {
        (a, b): (length, mean * length) for (a, b), length, mean in zip(pairs.tolist(), lengths, strengths, strict=True)
    }
    merges, altitudes = [], []

    def border(one: set[int], other: set[int]) -> tuple[float, float]:
        parts = [between.get((min(p), max(p)), (0, 0)) for p in product(one, other)]
        return sum(part[0] for part in parts), sum(part[1] for part in parts)

    def cost(a: int, b: int) -> float:
        length, strength = border(regions[a], regions[b])
        if not length:
            return np.inf
        one, other = sorted(regions[a]), sorted(regions[b])
        result = strength / length
        for number, histogram in enumerate(histograms):
            share = SETTINGS.texture if number == len(histograms) - 1 else SETTINGS.color
            result += share * chi_square(histogram[one].sum(axis=0), histogram[other].sum(axis=0))
        everything = set(range(len(sizes)))
        perimeter = min(border(regions[r], everything - regions[r])[0] for r in (a, b))
        result *= 1 - SETTINGS.shared * length / perimeter
        na, nb = sizes[one].sum(), sizes[other].sum()
        return float(result * (na * nb / ((na + nb) * sizes.sum())) ** SETTINGS.size_power)

    while len(regions) > 1:
        costs = {(a, b): cost(a, b) for a in regions for b in regions if a < b}
        (a, b), least = min(costs.items(), key=lambda item: item[1])
        if least == np.inf:
            break
        regions[len(sizes) + len(merges)] = regions.pop(a) | regions.pop(b)
        merges.append((a, b))
        altitudes.append(least)
    return merges, altitudes


@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 2**31), st.booleans())
def test_merges_are_those_of_comparing_all_pairs(height: int, width: int, seed: int, parted: bool) -> None:
    rng = np.random.default_rng(seed)
    cells = np.arange(height * width).reshape(height, width)
    sides = [(cells[:, :-1], cells[:, 1:]), (cells[:-1], cells[1:])]
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in sides]).astype(np.int32)
    if parted:  # the first row from the others
        pairs = pairs[(pairs[:, 0] < width) == (pairs[:, 1] < width)]
    lengths = rng.integers(1, 9, len(pairs)).astype(np.int32)
    sizes = rng.integers(1, 50, cells.size).astype(float)
    histograms = [rng.dirichlet(np.ones(bins), cells.size) * sizes[:, None] for bins in (4, 5)]
    strengths = rng.random(len(pairs))
    nowhere = np.zeros((0, 2), np.int32)
    borders = Borders(pairs, np.append(0, np.cumsum(lengths)).astype(np.int32), nowhere, np.zeros(0, bool))
    found, found_at = Leaves(nowhere, sizes, np.zeros((cells.size, 2)), histograms, borders, strengths).merged()
    merges, altitudes = merged_naively(pairs, lengths, strengths, sizes, histograms)
    assert [tuple(pair) for pair in found.tolist()] == merges
    np.testing.assert_allclose(found_at, np.maximum.accumulate(altitudes) if altitudes else [], rtol=1e-12)
