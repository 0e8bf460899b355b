"""Superpixels: a picture in many small connected segments that follow its edges.

An edge-weighted tessellation with one generator for each cell of a regular grid. Only pixels on boundaries move, and
only where their cell stays in one piece, so there are as many cells at the end as at the start.

J. Wang, X. Wang, IEEE Trans. Pattern Analysis and Machine Intelligence 34 (2012) 1241-1247, doi
10.1109/TPAMI.2012.47.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_non_negative
from cvtimg.colors.spaces import SPACES
from cvtimg.labels.components import absorb_small, connected_pieces
from cvtimg.segmentation.edge_weight import descend
from cvtimg.segmentation.segments import Segmentation, finished
from cvtimg.segmentation.values import picture_values


def superpixels(
    image: Any,
    n_superpixels: int,
    *,
    compactness: float = 10,
    space: str = "rgb",
    mask: ArrayLike | None = None,
) -> Segmentation:
    """Divide a picture into many small connected segments of similar color.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        As in `segment`; pixels with NaN or infinity are left out.
    n_superpixels : int
        About how many: there are as many as a grid of rows and columns of nearly square cells has inside of the mask.
    compactness : float
        What a pair of near pixels in different segments costs, in squared levels of 8 bits: with more, cells are
        rounder and follow the edges of the picture less.
    space : {"rgb", "linear", "lab", "oklab"}
        Where distances are measured. Of photographs cells in "lab" follow more of the edges that people see.
    mask : (H, W) array, optional
        Pixels where it is not 0 are segmented; the others have label 0.

    Returns
    -------
    Segmentation
        Labels and all else as `segment` gives them.

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here; the message names it.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import superpixels
    >>> picture = np.zeros((40, 60), np.uint8)
    >>> picture[:, 33:] = 200
    >>> superpixels(picture, 6).n_segments
    6
    """
    values = picture_values(image, check_choice("space", space, SPACES), mask)
    weight = check_non_negative("compactness", compactness)
    check_count("n_superpixels", n_superpixels, int(values.inside.sum()), "the number of pixels")
    field = values.field()
    cells = _grid(values.inside, n_superpixels)
    descent = descend(field, cells, int(cells.max()), edge_weight=weight, connected=True)
    return finished(values, descent.labels, field, descent, weight)


def _grid(inside: NDArray[np.bool_], n_cells: int) -> NDArray[np.int32]:
    height, width = inside.shape
    # As many cells as asked for lie inside if those of the whole picture are as many times more.
    n_all = n_cells * inside.size / inside.sum()
    n_columns = max(1, min(width, round(np.sqrt(n_all * width / height))))
    n_rows = max(1, min(height, round(n_all / n_columns)))
    rows, columns = np.arange(height) * n_rows // height, np.arange(width) * n_columns // width
    cells = (rows[:, None] * n_columns + columns + 1).astype(np.int32)
    pieces = connected_pieces(np.where(inside, cells, 0))
    return absorb_small(pieces, np.zeros((*inside.shape, 1), np.float32), inside.sum() // n_cells // 4)
