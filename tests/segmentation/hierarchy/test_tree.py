from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from cvtimg import find_edges, segment_hierarchy
from cvtimg._shared.types import Array
from cvtimg.labels import region_means
from cvtimg.labels.components import find_borders
from cvtimg.segmentation import RegionHierarchy
from cvtimg.segmentation.hierarchy.settings import SETTINGS
from cvtimg.segmentation.hierarchy.strengths import chances_of, evidence_of


@pytest.fixture(scope="module")
def hierarchy(photograph: Array) -> RegionHierarchy:
    return segment_hierarchy(photograph, n_leaves=300)


def test_labels_go_from_dark_to_bright(hierarchy: RegionHierarchy, photograph: Array) -> None:
    means = region_means(hierarchy.cut(12), photograph)[1:].sum(axis=1)
    assert (np.diff(means) > -3).all()  # means are taken in Lab


def test_colors_sizes_and_energies_are_those_of_the_nodes(photograph: Array) -> None:
    hierarchy = segment_hierarchy(photograph, n_leaves=40, space="rgb")
    labels = hierarchy.cut(hierarchy.n_parts)
    root = len(hierarchy.sizes) - 1
    assert hierarchy.sizes[root] == labels.size
    np.testing.assert_allclose(hierarchy.colors[root], photograph.reshape(-1, 3).mean(axis=0))
    np.testing.assert_allclose(hierarchy.energies[root], photograph.reshape(-1, 3).var(axis=0).sum() * labels.size)
    leaf = hierarchy.leaves == 5
    np.testing.assert_allclose(hierarchy.colors[4], photograph[leaf].mean(axis=0))
    np.testing.assert_allclose(hierarchy.energies[4], photograph[leaf].var(axis=0).sum() * leaf.sum(), rtol=1e-4)


def test_a_threshold_keeps_apart_what_differs_by_more(hierarchy: RegionHierarchy) -> None:
    altitudes = np.unique(hierarchy.altitudes)
    for threshold in (0.0, altitudes[5], altitudes[-3], altitudes[-1]):
        n = 1 + np.count_nonzero(hierarchy.altitudes > threshold)
        assert hierarchy.n_regions(threshold) == n == hierarchy.cut(threshold=threshold).max()
    assert hierarchy.cut(threshold=99, min_regions=4).max() == 4
    np.testing.assert_array_equal(hierarchy.cut(), hierarchy.cut(threshold=hierarchy.default_threshold))


def test_contours_above_a_threshold_are_the_borders_of_its_cut(hierarchy: RegionHierarchy) -> None:
    pixels = hierarchy.contour_map()
    for threshold in np.unique(hierarchy.altitudes)[[0, 40, -5, -2]]:
        labels = hierarchy.cut(threshold=threshold)
        upright, flat = labels[:, 1:] != labels[:, :-1], labels[1:] != labels[:-1]
        expected = np.zeros(labels.shape, bool)
        expected[:, :-1] |= upright
        expected[:-1] |= flat
        np.testing.assert_array_equal(pixels > np.float32(threshold), expected)
        assert (expected <= find_edges(labels, mode="thick")).all()


def test_edges_are_thin_and_lie_on_the_borders_of_a_cut(hierarchy: RegionHierarchy) -> None:
    edges, borders = hierarchy.find_edges(0.3), hierarchy.contour_map() > 0.3
    assert (edges <= borders).all()
    assert edges.sum() > 0.5 * borders.sum()
    blocks = edges[1:, 1:] & edges[1:, :-1] & edges[:-1, 1:] & edges[:-1, :-1]
    assert blocks.sum() < 0.02 * edges.sum()  # where four lines meet
    # Few pixels of a border have no edge beside them: those of slivers.
    assert (borders & ~ndimage.binary_dilation(edges, np.ones((3, 3)))).sum() < 0.03 * borders.sum()


def test_chances_follow_the_evidence_of_edges(hierarchy: RegionHierarchy) -> None:
    chances = hierarchy.find_edges(strength=True)
    evidence = find_borders(hierarchy.leaves).on_pixels(hierarchy.evidence, chances.shape)
    thinned = np.where(chances > 0, 0, evidence)
    greatest = np.maximum(evidence, ndimage.maximum_filter(thinned, 3))[chances > 0]
    assert 0 < chances.max() < 1
    assert (np.diff(chances[chances > 0][np.argsort(greatest)]) >= 0).all()
    np.testing.assert_array_equal(chances[chances > 0] > 0.5, greatest > SETTINGS.half_drawn)
    np.testing.assert_array_equal(hierarchy.find_edges(0.5, strength=True) > 0, hierarchy.find_edges(0.5))


def chances_of_lines(image: Array, columns: list[int], mask: Any = None) -> list[float]:
    """Greatest chance of an edge within 3 pixels of each of some columns, in the middle row."""
    chances = segment_hierarchy(image, n_leaves=200, mask=mask).find_edges(strength=True)
    rows = slice(len(image) // 2 - 5, len(image) // 2 + 5)
    return [float(chances[rows, column - 3 : column + 3].max()) for column in columns]


def test_edges_at_the_margin_are_taken_for_a_frame() -> None:
    image = np.full((180, 300), 150, np.uint8)
    image[:, :2] = image[:, 100:] = 40
    at_margin, inside = chances_of_lines(image, [3, 100])
    assert at_margin < inside - 0.2
    masked = np.zeros(image.shape, bool)
    masked[:, 98:] = True
    assert chances_of_lines(image, [100], masked)[0] < inside - 0.1
    holes = np.ones(image.shape, bool)
    holes[20:170:15, 95:105:4] = False  # pixels without data are no margin
    assert chances_of_lines(image, [100], holes)[0] > inside - 0.1


def test_edges_amid_others_are_taken_for_texture() -> None:
    alone, amid = np.full((2, 120, 200), 90, np.uint8)
    alone[:, 100:] = amid[:, 100:] = 170
    amid[:, 40:160] = np.where(np.arange(120) // 10 % 2, 170, 90)
    assert chances_of_lines(amid, [100])[0] < chances_of_lines(alone, [100])[0] - 0.05


def test_little_around_a_faint_edge_does_not_make_it_stronger() -> None:
    labels = np.repeat(np.int32([[1, 2]]), 20, axis=0).repeat(30, axis=1)
    evidence = [evidence_of(find_borders(labels), [np.array([view])] * 3, labels > 0)[0] for view in (0.02, 0.04)]
    assert evidence[1] == pytest.approx(2 * evidence[0])


@pytest.mark.parametrize("chance", [0.0, 0.2, 0.5])
def test_lines_are_the_borders_that_are_likely_enough_each_once(hierarchy: RegionHierarchy, chance: float) -> None:
    found, borders = hierarchy.find_lines(chance), find_borders(hierarchy.leaves)
    kept = chances_of(hierarchy.evidence) >= chance
    lengths = [np.abs(np.diff(line, axis=0)).sum() for line in found.lines]
    assert sum(lengths) == borders.lengths[kept].sum()
    assert (found.chances >= chance).all()
    assert (np.diff(found.chances) <= 0).all()
    means = np.average(chances_of(hierarchy.evidence)[kept], weights=borders.lengths[kept])
    assert np.average(found.chances, weights=lengths) == pytest.approx(means, rel=1e-5)
    ends = [tuple(line[end]) for line in found.lines if (line[0] != line[-1]).any() for end in (0, -1)]
    assert 2 not in Counter(ends).values()  # they would be one line
    few, worth = hierarchy.find_lines(chance, n_lines=5, tolerance=1), np.sort(lengths * found.chances)
    assert len(few.lines) == 5
    assert min(few.chances) * max(lengths) >= worth[-5]


def test_a_saved_hierarchy_is_loaded_as_it_was(hierarchy: RegionHierarchy, tmp_path: Path) -> None:
    path = tmp_path / "tree.npz"
    hierarchy.save(path)
    loaded = RegionHierarchy.load(path)
    np.testing.assert_array_equal(loaded.cut(17), hierarchy.cut(17))
    np.testing.assert_array_equal(loaded.altitudes, hierarchy.altitudes)
    np.testing.assert_array_equal(loaded.colors, hierarchy.colors)
    assert loaded.default_threshold == hierarchy.default_threshold
    np.testing.assert_array_equal(loaded.evidence, hierarchy.evidence)
    with pytest.raises(FileExistsError):
        hierarchy.save(path)
    with pytest.raises(ValueError, match="suffix"):
        hierarchy.save(tmp_path / "tree.txt")


def test_cuts_that_cannot_be_are_refused(hierarchy: RegionHierarchy) -> None:
    with pytest.raises(ValueError, match=rf"n_regions=0 must be in 1\.\.{hierarchy.n_leaves}, the number of leaves"):
        hierarchy.cut(0)
    with pytest.raises(ValueError, match="n_regions=1000 must be in"):
        hierarchy.cut(1000)
    with pytest.raises(ValueError, match="n_regions must not be given with threshold"):
        hierarchy.cut(3, threshold=0.4)
    with pytest.raises(ValueError, match=r"threshold=-1.* must be"):
        hierarchy.cut(threshold=-1)
