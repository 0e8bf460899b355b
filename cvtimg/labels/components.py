"""Connected pieces of segments as regions, and the merging of small or needless regions into their neighbors.

The energy of regions is that of segments: squared distances to the mean of each region, plus a price for the length of
the borders. Merging regions of n_a and n_b pixels whose means are d apart raises the first term by
n_a n_b / (n_a + n_b) d^2 and saves the border between them. In a shaded image, regions can differ although no edge
separates them; `join_regions` therefore takes the step across their border for d if that is smaller.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg.labels import _components

#: The step across a border is measured this many pixels away from the two pixels at the border.
_BEYOND_BORDER = 2


def connected_pieces(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Find the connected pieces of (H, W) labels, numbered from 1 in reading order; label 0 stays 0.

    Pixels that share a side are connected.
    """
    from skimage.measure import label

    return np.asarray(label(labels, background=0, connectivity=1), dtype=np.int32)  # type: ignore[no-untyped-call]


@dataclass(slots=True, eq=False)
class _Regions:
    """Regions, numbered from 0, and their borders.

    Borders are (B, 2) pairs of regions, the smaller number first, (B,) lengths, and (B, D) sums over that length of
    the steps in value from the first region to the second.
    """

    sizes: NDArray[np.int64]
    means: NDArray[np.float64]
    pairs: NDArray[np.int64]
    lengths: NDArray[np.float64]
    steps: NDArray[np.float64]


def absorb_small(
    pieces: NDArray[np.int32], values: NDArray[np.float32], min_size: int, length_price: float = 0
) -> NDArray[np.int32]:
    """Merge pieces smaller than `min_size` into their neighbors until there are none.

    The smallest piece comes first and goes to the neighbor that raises the energy least. Only pieces without neighbors
    remain: those that the mask separates from all others, or the whole image.

    Parameters
    ----------
    pieces : (H, W) int32 array
        Connected pieces, numbered from 1; 0 outside the mask.
    values : (H, W, D) float32 array
        Values in which the energy is measured.
    min_size : int
        In pixels.
    length_price : float
        Price per pixel of border, in squared units of the values.

    Returns
    -------
    (H, W) int32 array
        Number in `pieces` of the piece that absorbed the piece of each pixel, or of that piece itself.
    """
    regions = _measured(pieces, values)
    n_regions = len(regions.sizes)
    small = np.flatnonzero(regions.sizes < min_size)[::-1].astype(np.int32)
    if not len(small) or not len(regions.pairs):
        return pieces
    # Queues by size, of regions in reading order.
    queues = np.full(min_size, -1, np.int32)
    entries, queued = np.full(2 * n_regions, -1, np.int32), np.zeros(2 * n_regions, np.int32)
    queued[: len(small)] = small
    by_size = np.argsort(regions.sizes[small], kind="stable").astype(np.int32)
    ordered = regions.sizes[small[by_size]]
    same = ordered[1:] == ordered[:-1]
    entries[by_size[1:][same]] = by_size[:-1][same]
    queues[ordered] = by_size  # the last of each size
    parents = np.arange(n_regions, dtype=np.int32)
    _components.absorb(
        regions.sizes,
        regions.means,
        *_border_lists(regions),
        parents,
        queues,
        entries,
        queued,
        len(small),
        length_price,
        np.zeros(n_regions),
        np.zeros(n_regions, np.int32),
    )
    return np.append(np.int32(0), parents + np.int32(1))[pieces]


def join_regions(regions: NDArray[np.int32], values: NDArray[np.float32], length_price: float) -> NDArray[np.int32]:
    """Merge neighbors as long as the price of the border between them exceeds the rise in energy.

    The pairs that save the most length for their rise in energy come first. Parameters and result are those of
    `absorb_small`. Steps across borders are measured between pixels a little apart, so the values are best smoothed a
    little.

    References
    ----------
    G. Koepfler, C. Lopez, J. Morel, SIAM J. Numerical Analysis 31 (1994) 282-299, doi 10.1137/0731015.
    """
    measured = _measured(regions, values)
    graph = _Graph(measured)
    for region, neighbors in enumerate(graph.borders):
        for other in neighbors:
            if region < other:
                graph.offer(region, other)
    while graph.offers:
        rate, region, other, age, other_age = heapq.heappop(graph.offers)
        if rate >= length_price:
            break
        if graph.ages[region] == age and graph.ages[other] == other_age:
            graph.join(region, other)
    return np.append(0, graph.roots() + 1).astype(np.int32)[regions]


class _Graph:
    """Regions with their borders, and offers to join two; an offer lapses when either region changes."""

    def __init__(self, regions: _Regions) -> None:
        self.sizes: list[float] = regions.sizes.tolist()
        self.means: list[list[float]] = regions.means.tolist()
        #: The neighbors of each region, with the length of the border and the sums of the steps to the neighbor.
        self.borders: list[dict[int, tuple[float, list[float]]]] = [{} for _ in self.sizes]
        self.parents = list(range(len(self.sizes)))
        self.ages = [0] * len(self.sizes)
        self.offers: list[tuple[float, int, int, int, int]] = []
        borders = zip(regions.pairs.tolist(), regions.lengths.tolist(), regions.steps.tolist(), strict=True)
        for (region, other), length, steps in borders:
            self._border(region, other, length, steps)

    def offer(self, region: int, other: int) -> None:
        """Offer to join two regions at their rise in energy per pixel of border."""
        length, steps = self.borders[region][other]
        apart = sum((a - b) ** 2 for a, b in zip(self.means[region], self.means[other], strict=True))
        step = sum((total / length) ** 2 for total in steps)
        size, other_size = self.sizes[region], self.sizes[other]
        rate = size * other_size / (size + other_size) * min(apart, step) / length
        heapq.heappush(self.offers, (rate, region, other, self.ages[region], self.ages[other]))

    def join(self, region: int, other: int) -> None:
        """Join two neighbors: the one with fewer borders becomes part of the other."""
        if len(self.borders[region]) > len(self.borders[other]):
            region, other = other, region
        size = self.sizes[region] + self.sizes[other]
        share = self.sizes[region] / size
        self.means[other] = [b + share * (a - b) for a, b in zip(self.means[region], self.means[other], strict=True)]
        self.sizes[other] = size
        self.parents[region] = other
        for neighbor, (length, steps) in self.borders[region].items():
            del self.borders[neighbor][region]
            if neighbor != other:
                more, more_steps = self.borders[other].get(neighbor, (0.0, [0.0] * len(steps)))
                total = [a + b for a, b in zip(steps, more_steps, strict=True)]
                self._border(other, neighbor, length + more, total)
        self.borders[region] = {}
        self.ages[region] = -1
        self.ages[other] += 1
        for neighbor in self.borders[other]:
            self.offer(other, neighbor)

    def _border(self, region: int, other: int, length: float, steps: list[float]) -> None:
        self.borders[region][other] = length, steps
        self.borders[other][region] = length, [-step for step in steps]

    def roots(self) -> NDArray[np.int64]:
        """Return the region that each region is now part of."""
        roots = np.array(self.parents)
        while (roots != roots[roots]).any():
            roots = roots[roots]
        return roots


def _measured(regions: NDArray[np.int32], values: NDArray[np.float32]) -> _Regions:
    n_regions = int(regions.max())
    own = regions[regions > 0] - 1
    sizes = np.bincount(own, minlength=n_regions)
    sums = [np.bincount(own, values[..., dim][regions > 0], n_regions) for dim in range(values.shape[2])]
    # Unused numbers are regions without pixels and borders.
    means = np.stack(sums, axis=1) / np.maximum(sizes, 1)[:, None]
    keys, steps = zip(*(_steps(regions, values, axis) for axis in (0, 1)), strict=True)
    found, border, lengths = np.unique(np.concatenate(keys), return_inverse=True, return_counts=True)
    pairs = np.stack([found // n_regions, found % n_regions], axis=1)
    totals = [np.bincount(border, column, len(found)) for column in np.concatenate(steps).T]
    return _Regions(sizes.astype(np.int64), means, pairs, lengths.astype(np.float64), np.stack(totals, axis=1))


def _steps(
    regions: NDArray[np.int32], values: NDArray[np.float32], axis: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the pair of regions at each border pixel along an axis, as one number, and the step across it."""
    region, value = np.moveaxis(regions, axis, 0), np.moveaxis(values, axis, 0)
    before, across = np.nonzero((region[1:] != region[:-1]) & (region[1:] > 0) & (region[:-1] > 0))
    after, last = before + 1, len(region) - 1
    first, second = region[before, across].astype(np.int64) - 1, region[after, across].astype(np.int64) - 1
    # Borders are blurred: look beyond them, but not beyond the mask.
    near, far = np.maximum(before - _BEYOND_BORDER, 0), np.minimum(after + _BEYOND_BORDER, last)
    near = np.where(region[near, across] > 0, near, before)
    far = np.where(region[far, across] > 0, far, after)
    step = (value[far, across] - value[near, across]).astype(np.float64)
    step[first > second] *= -1
    return np.minimum(first, second) * int(regions.max()) + np.maximum(first, second), step


class _Borders(NamedTuple):
    """Linked lists of the borders of each region."""

    heads: NDArray[np.int32]
    tails: NDArray[np.int32]
    following: NDArray[np.int32]
    others: NDArray[np.int32]
    lengths: NDArray[np.float64]


def _border_lists(regions: _Regions) -> _Borders:
    own = np.concatenate([regions.pairs[:, 0], regions.pairs[:, 1]])
    other = np.concatenate([regions.pairs[:, 1], regions.pairs[:, 0]])
    order = np.argsort(own, kind="stable")
    own = own[order]
    heads, tails = np.full((2, len(regions.sizes)), -1, np.int32)
    places = np.arange(len(own), dtype=np.int32)
    heads[own[::-1]] = places[::-1]
    tails[own] = places
    following = np.append(np.where(own[1:] == own[:-1], places[1:], -1), -1).astype(np.int32)
    lengths = np.concatenate([regions.lengths, regions.lengths])[order]
    return _Borders(heads, tails, following, other[order].astype(np.int32), lengths)
