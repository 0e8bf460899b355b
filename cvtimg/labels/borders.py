"""Borders between regions: which regions meet, and at which cracks between their pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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

    def on_cracks(self, strengths: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float32]:
        """(2 H + 1, 2 W + 1) strengths (B,) of borders at their cracks, and at the corners of these the strongest."""
        height, width = shape
        cracks = np.zeros((2 * height + 1, 2 * width + 1), np.float32)
        rows, columns = 2 * self.places.T + 1
        cracks[rows + self.is_flat, columns + ~self.is_flat] = np.repeat(strengths, self.lengths)
        corners = cracks[2:-1:2, 2:-1:2]
        for down, right in ((1, 2), (3, 2), (2, 1), (2, 3)):
            np.maximum(corners, cracks[down::2, right::2][: height - 1, : width - 1], out=corners)
        return cracks


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
