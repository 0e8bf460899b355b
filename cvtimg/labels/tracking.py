"""Labels that keep their number from frame to frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_that
from cvtimg._shared.types import Ints

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
    given = np.asarray(labels)
    check_that(f"labels of shape {given.shape}", given.ndim in (3, 4), "be (T, H, W) or (T, Z, H, W)")
    check_that(f"labels of type {given.dtype}", given.dtype.kind in "iu", "be integers")
    tracks = np.zeros(given.shape, np.int32)
    last = 0
    for number, frame in enumerate(given):
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
