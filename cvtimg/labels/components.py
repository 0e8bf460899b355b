"""Connected pieces of segments as regions, and the merging of small or needless regions into their neighbors.

The energy of regions is that of segments: squared distances to the mean of each region, plus a price for the length of
the borders. Merging regions of n_a and n_b pixels whose means are d apart raises the first term by
n_a n_b / (n_a + n_b) d^2 and saves the border between them. In a shaded image, regions can differ although no edge
separates them; `join_regions` therefore takes the step across their border for d if that is smaller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.sums import sum_by_label
from cvtimg.labels import _labels

# --- borders between regions: which regions meet, and at which cracks between their pixels


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Borders between regions that are numbered from 0."""

    pairs: NDArray[np.int32]  # (B, 2): regions at the two sides, the lower number first
    starts: NDArray[np.int32]  # (B + 1,): where the cracks of each border begin
    places: NDArray[np.int32]  # (P, 2): row and column of the pixel before each crack: above it or to its left
    is_flat: NDArray[np.bool_]  # (P,): whether the crack is below that pixel, else to its right

    @property
    def lengths(self) -> NDArray[np.int32]:
        """(B,) cracks of each border."""
        return np.diff(self.starts)

    def on_pixels(self, strengths: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float32]:
        """(H, W) strengths (B,) of borders at the pixels above and to the left of their cracks."""
        strongest = np.zeros(shape, np.float32)
        np.maximum.at(strongest, tuple(self.places.T), np.repeat(strengths, self.lengths).astype(np.float32))
        return strongest


def find_borders(labels: NDArray[np.int32]) -> Borders:
    """Find the borders between regions (H, W) numbered from 1; 0 is no region."""
    n_regions = int(labels.max())
    parts = []
    for axis in (1, 0):
        before, after = (labels[:, :-1], labels[:, 1:]) if axis else (labels[:-1], labels[1:])
        rows, columns = np.nonzero((before != after) & (before > 0) & (after > 0))
        low, high = np.sort([before[rows, columns] - 1, after[rows, columns] - 1], axis=0).astype(np.int64)
        parts.append((low * n_regions + high, rows, columns, np.full(len(rows), axis == 0)))
    keys, rows, columns, is_flat = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(keys, kind="stable")
    found, starts = np.unique(keys[order], return_index=True)
    return Borders(
        np.stack(np.divmod(found, n_regions), axis=1).astype(np.int32),
        np.append(starts, len(keys)).astype(np.int32),
        np.stack([rows, columns], axis=1).astype(np.int32)[order],
        is_flat[order],
    )


# --- pieces of segments

#: The step across a border is measured this many pixels away from the two pixels at the border.
_BEYOND_BORDER = 2


def connected_pieces(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Find the connected pieces of (H, W) labels, numbered from 1 in reading order; label 0 stays 0.

    Pixels that share a side are connected.
    """
    from skimage.measure import label

    return np.asarray(label(labels, background=0, connectivity=1), dtype=np.int32)  # type: ignore[no-untyped-call]


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
    borders = find_borders(pieces)
    sizes, sums = _measured(pieces, values)
    if not len(borders.pairs) or sizes.min() >= min_size:
        return pieces
    means = sums / np.maximum(sizes, 1)[:, None]  # unused numbers are regions without pixels and borders
    lengths, most = borders.lengths.astype(np.float64), min(min_size, pieces.size + 1)
    parents = _labels.absorb(borders.pairs, lengths, sizes, means, most, length_price)
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
    borders = find_borders(regions)
    sizes, sums = _measured(regions, values)
    steps = sum_by_label(np.repeat(np.arange(len(borders.pairs)), borders.lengths), _steps(borders, regions, values))
    lengths = borders.lengths.astype(np.float64)
    merges, _ = _labels.merge(borders.pairs, lengths, steps, sizes.astype(np.float64), sums, length_price)
    # Every region gets the number of its first part: that of the lowest node in the tree of merges.
    first = np.arange(len(sizes) + len(merges), dtype=np.int32)
    for node, pair in enumerate(merges.tolist(), start=len(sizes)):
        first[node] = min(first[pair[0]], first[pair[1]])
    for node, pair in zip(range(len(first) - 1, len(sizes) - 1, -1), merges[::-1], strict=True):
        first[pair] = first[node]
    return np.append(np.int32(0), first[: len(sizes)] + np.int32(1))[regions]


def _measured(regions: NDArray[np.int32], values: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(N,) pixels of each region, and (N, D) sums of their values."""
    own = regions[regions > 0] - 1
    n_regions = int(regions.max())
    return np.bincount(own, minlength=n_regions).astype(np.int64), sum_by_label(own, values[regions > 0], n_regions)


def _steps(borders: Borders, regions: NDArray[np.int32], values: NDArray[np.float32]) -> NDArray[np.float64]:
    """(P, D) step in value across each crack, from the first region of its border to the second."""
    down, right = borders.is_flat, ~borders.is_flat
    before = borders.places
    after = before + np.stack([down, right], axis=1)
    reach = _BEYOND_BORDER * np.stack([down, right], axis=1)
    # Borders are blurred: look beyond them, but not beyond the mask.
    near, far = np.maximum(before - reach, 0), np.minimum(after + reach, np.array(regions.shape) - 1)
    near = np.where(regions[tuple(near.T)][:, None] > 0, near, before)
    far = np.where(regions[tuple(far.T)][:, None] > 0, far, after)
    steps = (values[tuple(far.T)] - values[tuple(near.T)]).astype(np.float64)
    steps[regions[tuple(before.T)] > regions[tuple(after.T)]] *= -1
    return steps
