"""Images painted with the mean color of each tile, and what that leaves of the error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.artwork import _mosaics

Floats = NDArray[np.float64]

#: Bands of rows, each with sums of its own. They are fixed, so that no bit depends on threads.
_PARTS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Painted:
    """An image painted with the mean color of each tile.

    Attributes
    ----------
    labels : (H, W) int32 array
        The tile of each pixel.
    colors : (K, C) float64 array
        The mean of each tile; that of the whole image for one without pixels.
    areas : (K,) float64 array
        Pixels of each tile.
    errors : (K,) float64 array
        Squared error of each tile, summed over pixels and bands.
    """

    labels: NDArray[np.int32]
    colors: Floats
    areas: Floats
    errors: Floats

    @property
    def energy(self) -> float:
        """The squared error of the mosaic."""
        return float(self.errors.sum())


def paint(image: NDArray[np.float32], labels: NDArray[np.int32], n_tiles: int) -> Painted:
    """Measure the tiles of an (H, W, C) image."""
    n_bands = image.shape[2]

    def add(first: int, stop: int, sums: Floats) -> None:
        _mosaics.add_colors(image, labels, first, stop, sums)

    sums = by_rows(add, labels.shape, (n_tiles, n_bands + 2))
    areas, colors = sums[:, -1], sums[:, :n_bands]
    empty = areas == 0
    means = np.where(empty[:, np.newaxis], colors.sum(axis=0) / areas.sum(), colors / np.maximum(areas, 1)[:, None])
    errors = np.maximum(sums[:, n_bands] - (colors * means).sum(axis=1), 0)
    return Painted(labels, means, areas, np.where(empty, 0, errors))


def by_rows(add: Callable[[int, int, Floats], None], shape: tuple[int, ...], sums_shape: tuple[int, ...]) -> Floats:
    """Let parts of the rows add to sums of their own, and add these up in order."""
    height, width = shape
    sums = np.zeros((_PARTS, *sums_shape))
    bounds = [height * part // _PARTS for part in range(_PARTS + 1)]

    def add_parts(start: int, stop: int) -> None:
        for part in range(start, stop):
            add(bounds[part], bounds[part + 1], sums[part])

    in_parts(add_parts, _PARTS, 4.0 * height * width)
    total: Floats = sums.sum(axis=0)
    return total
