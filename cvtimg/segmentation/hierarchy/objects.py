"""Objects: the regions of a tree that stand out from what surrounds them, wherever in the tree they are.

One threshold for a whole image cuts through faint objects or joins strong ones. Here every branch of the tree is cut
where that pays: splitting a region lowers the energy, and every region has a price. The best of all such cuts is found
exactly, from the leaves upward.

L. Guigues, J. Cocquerez, H. Le Men, Int. J. Computer Vision 68 (2006) 289-317, doi 10.1007/s11263-005-6299-0:
scale sets.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg.labels.components import find_borders


def cheapest_cut(
    merges: NDArray[np.int32], energies: NDArray[np.float64], price: float
) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """Find the cut with the least sum of the energies (N + M,) of its nodes and of a price for each."""
    # Return the (K,) nodes, the regions of the cut, and for each of the N leaves the number, from 1, of its region.
    n_leaves = len(energies) - len(merges)
    least = (energies + price).tolist()
    is_whole = np.ones(len(energies), np.bool_)
    for node, (one, other) in enumerate(merges.tolist(), start=n_leaves):
        parts = least[one] + least[other]
        if parts < least[node]:
            least[node] = parts
            is_whole[node] = False
    region_of = np.where(is_whole, np.arange(len(energies)), -1)
    for node, pair in zip(range(len(energies) - 1, n_leaves - 1, -1), merges[::-1].tolist(), strict=True):
        # Ancestors of a whole node include it.
        region_of[pair] = np.where(region_of[node] >= 0, region_of[node], region_of[pair])
    nodes, leaf_labels = np.unique(region_of[:n_leaves], return_inverse=True)
    return nodes, leaf_labels.astype(np.int32) + np.int32(1)


def shares_that_part(
    labels: NDArray[np.int32], means: NDArray[np.float64], brightness: NDArray[np.float64], contrast: float
) -> NDArray[np.float64]:
    """Measure along how much of its border each region 1..K stands out from its neighbors; 0 has no border."""
    # Return (K, 2) shares of the border with neighbors whose means differ by the contrast or more and that are darker,
    # and with those that are not.
    borders = find_borders(labels)
    lengths = np.tile(borders.lengths, 2).astype(np.float64)
    own, others = np.concatenate([borders.pairs, borders.pairs[:, ::-1]]).T
    apart = lengths * (np.linalg.norm(means[own] - means[others], axis=1) >= contrast)
    is_brighter = brightness[own] > brightness[others]
    sums = sum_by_label(own, np.stack([apart * is_brighter, apart * ~is_brighter], axis=1), len(means))
    perimeters = np.bincount(own, lengths, len(means))
    return per_mass(sums, perimeters)
