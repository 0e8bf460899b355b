"""Rows of different lengths in one array, with the start of each, as in a CSR matrix."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_Ints = NDArray[np.int32]


class Rows(NamedTuple):
    """Row i holds ``items[starts[i] : starts[i + 1]]``."""

    starts: _Ints
    items: _Ints

    def lengths(self) -> _Ints:
        """(n,) how many items each row has."""
        lengths: _Ints = np.diff(self.starts)
        return lengths

    def spread(self, own: NDArray[np.intp]) -> tuple[NDArray[np.intp], _Ints]:
        """Repeat indices of rows for each item that the row has: positions in `own`, and the items."""
        counts = self.lengths()[own]
        at = np.repeat(np.arange(len(own)), counts)
        within = np.arange(len(at)) - np.repeat(np.cumsum(counts) - counts, counts)
        return at, self.items[self.starts[own][at] + within]


def as_rows(own: NDArray[np.integer], items: NDArray[np.integer], n_rows: int) -> Rows:
    """Collect items by their rows, which rise."""
    starts = np.concatenate([[0], np.cumsum(np.bincount(own, minlength=n_rows))])
    return Rows(starts.astype(np.int32), np.ascontiguousarray(items, np.int32))


def empty_rows(n_rows: int) -> Rows:
    """Rows without items."""
    return Rows(np.zeros(n_rows + 1, np.int32), np.zeros(0, np.int32))


def overlaps(points: NDArray[np.float64], radii: NDArray[np.float64]) -> Rows:
    """Balls that each ball meets, itself among them."""
    from scipy.spatial import cKDTree

    # Of two balls that meet, the center of one lies within twice the radius of the larger one.
    found = cKDTree(points).query_ball_point(points, 2 * radii)
    own = np.repeat(np.arange(len(points)), [len(row) for row in found])
    other = np.concatenate([np.asarray(row, np.intp) for row in found])
    meet = np.linalg.norm(points[own] - points[other], axis=1) < radii[own] + radii[other]
    meet |= own == other
    both = np.unique(
        np.concatenate([np.stack([own, other], axis=1)[meet], np.stack([other, own], axis=1)[meet]]), axis=0
    )
    return as_rows(both[:, 0], both[:, 1], len(points))
