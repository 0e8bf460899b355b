"""Claims about edge points."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from cvtimg import find_edges
from cvtimg.labels.edges import EDGE_MODES

LABELS = arrays(np.int32, st.tuples(st.integers(1, 7), st.integers(1, 7)), elements=st.integers(0, 3))


def by_hand(labels: NDArray[Any], mode: str, ignore: int | None) -> NDArray[np.bool_]:
    """Look at every pixel and each of its neighbours."""
    edges = np.zeros(labels.shape, bool)
    for (row, column), label in np.ndenumerate(labels):
        for (i, j), other in np.ndenumerate(labels):
            if abs(row - i) + abs(column - j) == 1 and ignore not in (label, other):
                wanted = {"inner": label > other, "outer": label < other, "thick": label != other}
                edges[row, column] |= wanted[mode]
    return edges


@given(LABELS, st.sampled_from(list(EDGE_MODES)), st.sampled_from([None, 0, 2]))
@settings(max_examples=60)
def test_an_edge_point_has_a_neighbour_in_another_segment(labels: NDArray[Any], mode: str, ignore: int | None) -> None:
    found = find_edges(labels, mode=mode, ignore=ignore)
    assert found.dtype == np.bool_
    np.testing.assert_array_equal(found, by_hand(labels, mode, ignore))


def test_labels_and_options_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match=r"mode='wide' must be one of inner, outer, thick"):
        find_edges([[1, 2]], mode="wide")
    with pytest.raises(ValueError, match=r"labels of shape \(2,\)"):
        find_edges([1, 2])
    with pytest.raises(ValueError, match=r"labels in -1\.\.2 must be in 0\.\."):
        find_edges([[-1, 2]])
    with pytest.raises(TypeError, match="labels of type float64 must be integers"):
        find_edges([[0.5, 2]])
