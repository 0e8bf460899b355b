"""Claims about edge points."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from skimage.segmentation import find_boundaries

from cvtimg import find_edges
from cvtimg.labels.edges import EDGE_MODES

LABELS = arrays(np.int32, st.tuples(st.integers(1, 7), st.integers(1, 7)), elements=st.integers(0, 3))


def by_hand(labels: NDArray[Any], mode: str, connectivity: int, ignore: int | None) -> NDArray[np.bool_]:
    """Look at every pixel and each of its neighbours."""
    edges = np.zeros(labels.shape, bool)
    for (row, column), label in np.ndenumerate(labels):
        for (i, j), other in np.ndenumerate(labels):
            distance = (row - i) ** 2 + (column - j) ** 2
            if distance in range(1, connectivity + 1) and ignore not in (label, other):
                wanted = {"inner": label > other, "outer": label < other, "thick": label != other}
                edges[row, column] |= wanted[mode]
    return edges


@given(LABELS, st.sampled_from(list(EDGE_MODES)), st.sampled_from([1, 2]), st.sampled_from([None, 0, 2]))
@settings(max_examples=60)
def test_an_edge_point_has_a_neighbour_in_another_segment(
    labels: NDArray[Any], mode: str, connectivity: int, ignore: int | None
) -> None:
    found = find_edges(labels, mode=mode, connectivity=connectivity, ignore=ignore)
    assert found.dtype == np.bool_
    np.testing.assert_array_equal(found, by_hand(labels, mode, connectivity, ignore))


@given(LABELS, st.sampled_from([1, 2]))
@settings(max_examples=40)
def test_thick_edges_are_those_of_scikit_image(labels: NDArray[Any], connectivity: int) -> None:
    thick = find_edges(labels, mode="thick", connectivity=connectivity)
    np.testing.assert_array_equal(thick, find_boundaries(labels, connectivity, mode="thick"))
    inner, outer = (find_edges(labels, mode=mode, connectivity=connectivity) for mode in ("inner", "outer"))
    np.testing.assert_array_equal(thick, inner | outer)


@pytest.mark.parametrize("mode", EDGE_MODES)
@pytest.mark.parametrize("connectivity", [1, 2])
def test_edges_of_objects_that_lie_apart_are_those_of_scikit_image(mode: str, connectivity: int) -> None:
    labels = np.zeros((30, 40), np.uint8)
    row, column = np.ogrid[:30, :40]
    labels[(row - 10) ** 2 + (column - 10) ** 2 < 40] = 1
    labels[18:27, 25:38] = 2
    expected = find_boundaries(labels, connectivity, mode=mode)
    np.testing.assert_array_equal(find_edges(labels, mode=mode, connectivity=connectivity), expected)


@pytest.mark.parametrize("mode", ["inner", "outer"])
def test_edges_between_segments_that_touch_are_one_pixel_wide(mode: str) -> None:
    labels = np.repeat([[1, 2, 3]], 5, axis=0).repeat(4, axis=1)
    edges = find_edges(labels, mode=mode)
    assert edges.sum(axis=1).tolist() == [2] * 5
    assert find_boundaries(labels, mode="inner").sum(axis=1).tolist() == [4] * 5


def test_one_segment_has_no_edges() -> None:
    assert not find_edges(np.ones((4, 5), int), mode="thick", connectivity=2).any()
    assert not find_edges([[7]]).any()


def test_labels_and_options_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match=r"mode='wide' must be one of inner, outer, thick"):
        find_edges([[1, 2]], mode="wide")
    with pytest.raises(ValueError, match=r"connectivity=4 must be in 1\.\.2"):
        find_edges([[1, 2]], connectivity=4)
    with pytest.raises(ValueError, match=r"labels of shape \(2,\)"):
        find_edges([1, 2])
    with pytest.raises(ValueError, match=r"labels in -1\.\.2 must be in 0\.\."):
        find_edges([[-1, 2]])
    with pytest.raises(TypeError, match="labels of type float64 must be integers"):
        find_edges([[0.5, 2]])
