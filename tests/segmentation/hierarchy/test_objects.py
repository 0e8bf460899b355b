from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvtimg import segment_hierarchy
from cvtimg.segmentation import RegionHierarchy
from cvtimg.segmentation.hierarchy.objects import cheapest_cut, shares_that_part


@given(st.integers(1, 7), st.integers(0, 2**31), st.floats(0, 3))
def test_the_cheapest_cut_is_the_cheapest_of_all(n_leaves: int, seed: int, price: float) -> None:
    rng = np.random.default_rng(seed)
    free, merges = list(range(n_leaves)), []
    while len(free) > 1:
        one, other = sorted(rng.choice(free, 2, replace=False).tolist())
        free = [node for node in free if node not in (one, other)] + [n_leaves + len(merges)]
        merges.append((one, other))
    pairs = np.array(merges, np.int32).reshape(-1, 2)
    energies = rng.random(n_leaves + len(merges)) * 5
    below: list[set[int]] = [{leaf} for leaf in range(n_leaves)]
    below += [set()] * len(merges)

    def cuts(node: int) -> list[list[int]]:
        if node < n_leaves:
            return [[node]]
        one, other = merges[node - n_leaves]
        return [[node]] + [left + right for left in cuts(one) for right in cuts(other)]

    for number, (one, other) in enumerate(merges):
        below[n_leaves + number] = below[one] | below[other]
    best = min(sum(energies[node] + price for node in cut) for cut in cuts(n_leaves + len(merges) - 1))
    nodes, labels = cheapest_cut(pairs, energies, price)
    assert sum(energies[nodes] + price) == pytest.approx(best)
    assert [set(np.flatnonzero(labels == number + 1).tolist()) for number in range(len(nodes))] == [
        below[node] for node in nodes
    ]


def test_shares_of_the_border_are_told_by_their_contrast() -> None:
    labels = np.array([[1, 1, 2], [3, 3, 2]], np.int32)
    means = np.array([[0.0], [10], [100]])
    found = shares_that_part(labels, means, means[:, 0], 50)
    np.testing.assert_allclose(found, [[0, 2 / 3], [0, 1 / 2], [1, 0]])
    assert not shares_that_part(np.ones((2, 2), np.int32), means[:1], means[:1, 0], 1).any()


@pytest.fixture(scope="module")
def spots() -> tuple[NDArray[Any], RegionHierarchy]:
    """Discs of several contrasts on a ground that shades: bright ones, a faint one, a dark one."""
    rows, columns = np.mgrid[:120, :160]
    image = 60 + columns * 0.25
    truth = np.zeros(image.shape, np.int32)
    for number, (y, x, contrast) in enumerate([(30, 30, 120), (30, 90, 110), (90, 40, 40), (90, 120, -50)], start=1):
        disc = (rows - y) ** 2 + (columns - x) ** 2 < 14**2
        image, truth = image + contrast * disc, np.where(disc, number, truth)
    noisy = image + np.random.default_rng(0).normal(0, 4, image.shape)
    return truth, segment_hierarchy(noisy.clip(0, 255).astype(np.uint8), n_leaves=200)


def test_objects_of_different_contrast_are_found_at_once(spots: tuple[NDArray[Any], RegionHierarchy]) -> None:
    truth, hierarchy = spots
    found = hierarchy.find_objects(contrast=20)
    assert 4 <= found.max() <= 6  # ground between discs may stand out, too
    for number in range(1, 5):
        label = np.bincount(found[truth == number]).argmax()
        assert label > 0
        both = ((found == label) & (truth == number)).sum()
        assert both > 0.9 * ((found == label) | (truth == number)).sum()


def test_polarity_and_size_say_which_objects_are_kept(spots: tuple[NDArray[Any], RegionHierarchy]) -> None:
    truth, hierarchy = spots
    bright = hierarchy.find_objects(contrast=20, polarity="bright")
    dark = hierarchy.find_objects(contrast=20, polarity="dark")
    assert bright.max() == 3
    assert (bright > 0)[(truth > 0) & (truth < 4)].mean() > 0.9
    assert not (bright[truth == 4] > 0).any()
    assert (dark[truth == 4] > 0).mean() > 0.9
    assert not (dark[(truth > 0) & (truth < 4)] > 0).any()
    assert not hierarchy.find_objects(contrast=20, max_size=100).any()
    assert hierarchy.find_objects(contrast=90).max() == 2
    with pytest.raises(ValueError, match="polarity='grey' must be one of any, bright, dark"):
        hierarchy.find_objects(polarity="grey")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="min_size=0 must be"):
        hierarchy.find_objects(min_size=0)


def test_the_rim_of_an_object_is_none() -> None:
    rows, columns = np.mgrid[:120, :120]
    distances = np.hypot(rows - 60, columns - 60)
    image = np.where(distances < 20, 250, np.where(distances < 32, 150, 40)).astype(np.uint8)
    objects = segment_hierarchy(image, n_leaves=200).find_objects(contrast=30)
    assert objects.max() == 1
    assert (objects[distances < 18] == 1).all()
    assert not objects[(distances > 34) | ((distances > 22) & (distances < 30))].any()


def test_one_color_has_no_objects() -> None:
    assert not segment_hierarchy(np.zeros((30, 40), np.uint8)).find_objects().any()
