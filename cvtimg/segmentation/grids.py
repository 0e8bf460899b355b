"""The cells of a regular grid, from which superpixels start."""

from __future__ import annotations

import numpy as np

from cvtimg._shared.types import Bools, Ints
from cvtimg.labels.components import absorb_small, connected_pieces


def grid_of_cells(inside: Bools, n_cells: int) -> Ints:
    """Divide what is inside (H, W) into about a number of connected cells of like size, numbered from 1."""
    height, width = inside.shape
    # The whole image gets proportionally more cells, so that the number requested lies inside the mask.
    n_all = n_cells * inside.size / inside.sum()
    n_columns = max(1, min(width, round(np.sqrt(n_all * width / height)), round(n_all)))
    n_rows = max(1, min(height, round(n_all / n_columns)))
    rows, columns = np.arange(height) * n_rows // height, np.arange(width) * n_columns // width
    cells = np.add.outer((rows * n_columns).astype(np.int32), (columns + 1).astype(np.int32))
    if inside.all():
        return cells
    pieces = connected_pieces(np.where(inside, cells, 0))
    return absorb_small(pieces, np.zeros((*inside.shape, 1), np.float32), inside.sum() // n_cells // 4)
