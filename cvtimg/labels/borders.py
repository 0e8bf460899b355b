"""Borders between regions: which regions meet, and at which cracks between their pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Borders between regions that are numbered from 0.

    Attributes
    ----------
    pairs : (B, 2) int32 array
        Regions at the two sides, the lower number first.
    starts : (B + 1,) int32 array
        Where the cracks of each border begin.
    places : (P, 2) int32 array
        Row and column of the pixel before each crack: above it or to its left.
    is_flat : (P,) bool array
        Whether the crack is below that pixel, else to its right.
    """

    pairs: NDArray[np.int32]
    starts: NDArray[np.int32]
    places: NDArray[np.int32]
    is_flat: NDArray[np.bool_]

    @property
    def lengths(self) -> NDArray[np.int32]:
        """(B,) cracks of each border."""
        return np.diff(self.starts)


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
