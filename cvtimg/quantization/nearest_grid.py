"""A grid over the space of colors whose cells list the entries of a palette that can be nearest in them.

Dithering looks up nearest entries at arbitrary places, one after the other. With the grid each look-up compares one to
three entries on average, and is exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg.quantization import _dithering

#: Number of coordinates of a place in the kernels.
MAX_DIMS = _dithering.DIMS
#: Cells per entry of the palette: fewer would have more candidates, more would take longer to list.
_CELLS_PER_ENTRY = 64
_MOST_CELLS = 1 << 18
#: Cells on a side of a block, whose candidates are found together.
_BLOCK = 4


class Grid(NamedTuple):
    """A box cut into cells that know their candidates, in the order in which the kernels take these fields."""

    palette: NDArray[np.float32]  # (K, 4) places of the entries
    low: NDArray[np.float32]  # (4,) lowest corner of the box
    cells_per_unit: NDArray[np.float32]  # (4,)
    strides: NDArray[np.int32]  # (4,) steps from a cell to the next in each direction
    last: NDArray[np.int32]  # (4,) index of the last cell in each direction
    bounds: NDArray[np.int32]  # (n_kinds, n_cells, 2) first and last + 1 of the candidates of each cell
    candidates: NDArray[np.uint16]  # (n,)


def nearest_grid(
    places: NDArray[np.float32], palette: NDArray[np.float32], allowed: NDArray[np.bool_], near: float, far: float
) -> Grid:
    """Cover the (M, 4) places of colors and their surroundings with cells; `allowed` are the entries of each kind."""
    # Look-ups are usually within `near` of a color, and always within `far`. The outermost cells reach that far.
    low, high = places.min(axis=0), places.max(axis=0)
    varies = np.minimum(low, palette.min(axis=0)) < np.maximum(high, palette.max(axis=0))
    margin = np.where(varies, np.float32(1.01 * near) + np.float32(1e-5) * high.max(), np.float32(0))
    outside = np.where(varies, np.float32(1.01 * (far - near)), np.float32(0))
    low, size = low - margin, high - low + 2 * margin
    n_blocks = np.where(varies, _blocks_per_side(len(palette), int(varies.sum())), 1).astype(np.int32)
    n_in_block = np.where(varies, _BLOCK, 1).astype(np.int32)
    n_cells = n_blocks * n_in_block
    sides = (size / n_cells).astype(np.float32)
    cells_per_unit = np.divide(n_cells.astype(np.float32), size, out=np.zeros_like(size), where=size > 0)
    strides = np.append(np.cumprod(n_cells[:0:-1])[::-1], 1).astype(np.int32)
    bounds = np.empty((len(allowed), int(n_cells.prod()), 2), np.int32)
    in_block, in_cell = np.empty((2, len(palette)), np.uint16)
    entries = [np.flatnonzero(may_take).astype(np.uint16) for may_take in allowed]
    room = 4 * bounds.size
    while True:  # once, and again if there was too little room
        candidates, end = np.empty(room, np.uint16), 0
        for names, of_kind in zip(entries, bounds, strict=True):
            end = _dithering.list_candidates(
                palette, names, low, sides, outside, n_blocks, n_in_block, in_block, in_cell, of_kind, candidates, end
            )  # fmt: skip
        if end <= room:
            return Grid(palette, low, cells_per_unit, strides, n_cells - np.int32(1), bounds, candidates)
        room = end


def _blocks_per_side(n_entries: int, n_dims: int) -> int:
    n_cells = min(_CELLS_PER_ENTRY * n_entries, _MOST_CELLS)
    return max(int(n_cells ** (1 / max(n_dims, 1))) // _BLOCK, 1)
