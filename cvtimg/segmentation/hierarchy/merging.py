"""Merging of regions, the pair that differs least first, until one is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.labels import _labels
from cvtimg.segmentation.hierarchy.settings import Settings


@dataclass(frozen=True, slots=True, eq=False)
class Merges:
    """Merges of N regions in their order."""

    pairs: NDArray[np.int32]  # (M, 2): numbers of the regions that merge, the lower first. Merge m makes region N + m.
    altitudes: NDArray[np.float64]  # (M,): how much they differ; the running maximum, so that it never falls


def merge_regions(
    pairs: NDArray[np.int32],
    lengths: NDArray[np.int32],
    strengths: NDArray[np.float64],
    sizes: NDArray[np.float64],
    histograms: list[NDArray[np.float64]],
    weights: Settings,
) -> Merges:
    """Merge regions until no neighbors are left."""
    # Borders have (B, 2) pairs of regions at their sides, lengths and strengths; regions have sizes in pixels, and (N,
    # H) histograms for each channel, textons last.
    found, altitudes = _labels.merge(
        pairs.copy(),
        lengths.astype(np.float64),
        (strengths * lengths)[:, None],
        sizes.copy(),
        np.concatenate(histograms, axis=1),
        np.inf,
        np.cumsum([0, *(histogram.shape[1] for histogram in histograms)], dtype=np.int32),
        weights.color,
        weights.texture,
        weights.shared,
        weights.size_power,
    )
    return Merges(found, np.maximum.accumulate(altitudes))


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
