"""Ultrametric contour maps: at every crack, how much the regions differ that merge across it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.labels.borders import Borders


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
    between: NDArray[np.float64] = altitudes[low - n_leaves]
    return between


def on_pixels(borders: Borders, strengths: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float32]:
    """(H, W) strengths (B,) of borders at the pixels above and to the left of their cracks."""
    strongest = np.zeros(shape, np.float32)
    np.maximum.at(strongest, tuple(borders.places.T), np.repeat(strengths, borders.lengths).astype(np.float32))
    return strongest


def on_cracks(borders: Borders, strengths: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float32]:
    """(2 H + 1, 2 W + 1) strengths (B,) of borders at their cracks, and at the corners of these the strongest."""
    height, width = shape
    cracks = np.zeros((2 * height + 1, 2 * width + 1), np.float32)
    rows, columns = 2 * borders.places.T + 1
    cracks[rows + borders.is_flat, columns + ~borders.is_flat] = np.repeat(strengths, borders.lengths)
    corners = cracks[2:-1:2, 2:-1:2]
    for down, right in ((1, 2), (3, 2), (2, 1), (2, 3)):
        np.maximum(corners, cracks[down::2, right::2][: height - 1, : width - 1], out=corners)
    return cracks
