"""Merging of regions, the pair that differs least first, until one is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Merges:
    """Merges of N regions in their order."""

    pairs: NDArray[np.int32]  # (M, 2): numbers of the regions that merge, the lower first. Merge m makes region N + m.
    altitudes: NDArray[np.float64]  # (M,): how much they differ; the running maximum, so that it never falls


def altitudes_between(
    pairs: NDArray[np.int32], merges: NDArray[np.int32], altitudes: NDArray[np.float64], n_leaves: int
) -> NDArray[np.float64]:
    """(B,) altitudes at which pairs of leaves come to be in one region."""
    parents = np.arange(n_leaves + len(merges))
    parents[merges.ravel()] = np.repeat(np.arange(n_leaves, len(parents)), 2)
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    while (apart := low != high).any():
        # The lower of two nodes is not above the other.
        above = np.where(apart, parents[low], low)
        low, high = np.minimum(above, high), np.maximum(above, high)
    return altitudes[low - n_leaves]
