"""Connected pieces of segments as regions, and the merging of small ones into their neighbors.

The energy of regions is that of segments: squared distances to the mean of each region, plus a price for the length of
the borders. Merging regions of n_a and n_b pixels whose means are d apart raises the first term by
n_a n_b / (n_a + n_b) d^2 and saves the border between them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

import cvtimg.labels._labels as _labels
from cvtimg._shared.checks import check_that
from cvtimg._shared.sums import sum_by_label, take_rows
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Ints

# --- borders between regions: which regions meet, and at which cracks between their pixels


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Borders between regions that are numbered from 0."""

    pairs: Ints  # (B, 2): regions at the two sides, the lower number first
    starts: Ints  # (B + 1,): where the cracks of each border begin
    places: Ints  # (P, 2): row and column of the pixel before each crack: above it or to its left
    is_flat: Bools  # (P,): whether the crack is below that pixel, else to its right

    @property
    def lengths(self) -> Ints:
        """(B,) cracks of each border."""
        return np.diff(self.starts)

    def means(self, values: Floats) -> Floats:
        """(B,) means of what cracks, (P,), have."""
        return np.add.reduceat(values, self.starts[:-1]) / self.lengths

    def on_pixels(self, strengths: Floats, shape: tuple[int, int]) -> Floats32:
        """(H, W) strengths (B,) of borders at the pixels above and to the left of their cracks."""
        strongest = np.zeros(shape, np.float32)
        np.maximum.at(strongest, tuple(self.places.T), np.repeat(strengths, self.lengths).astype(np.float32))
        return strongest


def find_borders(labels: Ints) -> Borders:
    """Find the borders between regions (H, W) numbered from 1; 0 is no region."""
    dtype = np.min_scalar_type(int(labels.max()))  # of up to 16 bits, which are sorted by their digits
    parts = []
    for axis in (1, 0):
        before, after = (labels[:, :-1], labels[:, 1:]) if axis else (labels[:-1], labels[1:])

        def meet(stripe: slice, axis: int = axis, before: Ints = before, after: Ints = after) -> tuple[Array, ...]:
            here, there = before[stripe], after[stripe]
            rows, columns = np.nonzero((here != there) & (here > 0) & (there > 0))
            first, second = here[rows, columns] - 1, there[rows, columns] - 1
            places = np.stack([rows + stripe.start, columns], axis=1, dtype=np.int32, casting="same_kind")
            low, high = (least(first, second).astype(dtype) for least in (np.minimum, np.maximum))
            return low, high, places, np.full(len(rows), axis == 0)

        parts += in_stripes(meet, len(before), 8.0 * labels.size)
    low, high, places, is_flat = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.lexsort((high, low))
    pairs = np.stack([low, high])[:, order].astype(np.int32)
    starts = np.flatnonzero((np.diff(pairs, prepend=-1) != 0).any(axis=0))
    ends = np.append(starts, len(order)).astype(np.int32)
    return Borders(np.ascontiguousarray(pairs[:, starts].T), ends, take_rows(places, order), is_flat[order])


# --- pieces of segments


def connected_pieces(labels: Ints) -> Ints:
    """Find the connected pieces of (H, W) labels, numbered from 1 in reading order; label 0 stays 0.

    Pixels that share a side are connected.
    """
    from skimage.measure import label

    return np.asarray(label(labels, background=0, connectivity=1), dtype=np.int32)  # type: ignore[no-untyped-call]


def absorb_small(pieces: Ints, values: Floats32, min_size: int, length_price: float = 0) -> Ints:
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
    sizes = np.bincount(pieces.ravel())[1:].astype(np.int64)
    if not len(borders.pairs) or sizes.min() >= min_size:
        return pieces
    sums = sum_by_label(pieces.ravel(), values.reshape(pieces.size, -1))[1:]
    means = sums / np.maximum(sizes, 1)[:, None]  # unused numbers are regions without pixels and borders
    lengths, most = borders.lengths.astype(np.float64), min(min_size, pieces.size + 1)
    parents = _labels.absorb(borders.pairs, lengths, sizes, means, most, length_price)
    return np.append(np.int32(0), parents + np.int32(1))[pieces]


def grid_of_cells(inside: Bools, n_cells: int) -> Ints:
    """Divide what is inside (H, W) into about a number of connected cells of like size, numbered from 1."""
    height, width = inside.shape
    # The whole image gets proportionally more cells, so that the number requested lies inside the mask.
    n_all = n_cells * inside.size / inside.sum()
    n_columns = max(1, min(width, round(np.sqrt(n_all * width / height)), round(n_all)))
    n_rows = max(1, min(height, round(n_all / n_columns)))
    rows, columns = np.arange(height) * n_rows // height, np.arange(width) * n_columns // width
    cells = np.empty((height, width), np.int32)
    in_stripes(lambda own: np.add.outer(rows[own] * n_columns, columns + 1, out=cells[own]), height, 4.0 * cells.size)
    if inside.all():
        return cells
    pieces = connected_pieces(np.where(inside, cells, 0))
    return absorb_small(pieces, np.zeros((*inside.shape, 1), np.float32), inside.sum() // n_cells // 4)


#: Objects that overlap by less, as a share of their union, are not the same.
_LEAST_OVERLAP = 0.1


def track_labels(labels: ArrayLike) -> Ints:
    """Return labels of a time series in which each object keeps its number from frame to frame.

    An object takes the number of that of the frame before which it overlaps most. Of two that overlap the same one, as
    after a division, the one that overlaps more takes it; the other gets a number of its own, as all do that appear.
    Numbers are not used again. Objects that move by more than their own size between frames are not followed.

    Parameters
    ----------
    labels : (T, H, W) or (T, Z, H, W) integer array
        Labels of each frame, 0 for the background.

    Returns
    -------
    int32 array of the same shape
        Numbers from 1, in the order in which objects appear; 0 stays 0.

    Examples
    --------
    >>> from cvtimg.labels import track_labels
    >>> track_labels([[[1, 1, 0, 2, 2]], [[0, 0, 0, 1, 1]], [[5, 5, 0, 0, 1]]])[:, 0].tolist()
    [[1, 1, 0, 2, 2], [0, 0, 0, 2, 2], [3, 3, 0, 0, 2]]
    """
    frames = np.asarray(labels)
    check_that(f"labels of shape {frames.shape}", frames.ndim in (3, 4), "be (T, H, W) or (T, Z, H, W)")
    check_that(f"labels of type {frames.dtype}", frames.dtype.kind in "iu", "be integers")
    tracks = np.zeros(frames.shape, np.int32)
    last = 0
    for number, frame in enumerate(frames):
        present, indices = np.unique(frame, return_inverse=True)
        new = np.zeros(len(present), np.int32)
        if number:
            for at, kept in _pairs(indices.ravel(), tracks[number - 1].ravel()):
                if present[at] and not new[at] and kept not in new:
                    new[at] = kept
        fresh = (new == 0) & (present != 0)
        new[fresh] = np.arange(last + 1, last + 1 + fresh.sum())
        last = max(last, int(new.max(initial=0)))
        tracks[number] = new[indices].reshape(frame.shape)
    return tracks


def _pairs(now: NDArray[np.integer], before: Ints) -> list[tuple[int, int]]:
    """Return pairs of overlapping objects of two frames by their share of the union, the largest first."""
    n = int(before.max()) + 1
    here = before > 0
    keys, common = np.unique(now[here] * np.int64(n) + before[here], return_counts=True)
    first, second = keys // n, keys % n
    shares = common / (np.bincount(now)[first] + np.bincount(before)[second] - common)
    order = np.argsort(-shares, kind="stable")
    order = order[shares[order] >= _LEAST_OVERLAP]
    return list(zip(first[order].tolist(), second[order].tolist(), strict=True))
