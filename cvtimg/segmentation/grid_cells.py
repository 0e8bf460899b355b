"""Superpixels: many small connected segments that follow the edges of an image.

An edge-weighted tessellation that starts from the cells of a regular grid. Only boundary pixels move, and only where
their cell stays in one piece, so there are as many cells at the end as at the start.

J. Wang, X. Wang, IEEE Trans. Pattern Analysis and Machine Intelligence 34 (2012) 1241-1247, doi
10.1109/TPAMI.2012.47.
"""

from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice, check_count, check_edge_weight, check_partial_image
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.sums import contiguous
from cvtimg._shared.types import Floats32, ImageLike, Ints
from cvtimg.colors.spaces import SPACES
from cvtimg.labels.components import grid_of_cells
from cvtimg.segmentation.edge_weight import RADIUS, EdgeWeighted, compactness_of, descend, doubled, halved
from cvtimg.segmentation.frames import frame_of
from cvtimg.segmentation.noise import noise_covariance
from cvtimg.segmentation.prepared import auto_weight
from cvtimg.segmentation.result import Segmentation, from_labels
from cvtimg.segmentation.values import picture_values

#: Sides of cells at least, in pixels of half the size, to settle there first: of cells of 10, 1 % shrink to specks.
_LEAST_SIDE = 12


def superpixels(
    image: ImageLike,
    n_superpixels: int,
    *,
    compactness: float | str = "auto",
    space: SpaceName = "rgb",
    mask: ArrayLike | None = None,
) -> Segmentation:
    """Divide an image into many small connected segments of similar color.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        As in `segment`; pixels that are NaN, infinite or masked are left out.
    n_superpixels : int
        Approximate number of superpixels: the nearest that rows and columns of nearly square cells give in the mask.
    compactness : float or "auto"
        Penalty for each pair of near pixels in different segments, in squared 8-bit levels: with larger values, cells
        are rounder and follow the edges of the image less closely. "auto" follows the image: details of one pixel's
        radius are just worth their edge if they differ as two pixels of a cell of the grid do; noise may need more.
    space : {"rgb", "linear", "lab", "oklab"}
        Color space in which distances are measured. In photographs, cells in "lab" follow more of the edges that
        people see.
    mask : (H, W) array, optional
        Pixels to segment: those where the mask is not 0. The others have label 0.

    Returns
    -------
    Segmentation
        As `segment` returns it.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import superpixels
    >>> image = np.zeros((40, 60), np.uint8)
    >>> image[:, 33:] = 200
    >>> superpixels(image, 6).n_segments
    6
    """
    bands, known = check_partial_image("image", image, mask)
    frame = frame_of(bands, known)
    values = picture_values(contiguous(frame.of(bands)), check_choice("space", space, SPACES), frame.of(known))
    weight = check_edge_weight(compactness, "compactness")
    n_superpixels = check_count("n_superpixels", n_superpixels, int(values.inside.sum()), "the number of pixels")
    field = values.field()
    cells = grid_of_cells(values.inside, n_superpixels)
    if weight is None:  # the variance within cells, or the noise where that needs more
        weight = max(compactness_of(field, cells), auto_weight(noise_covariance(field, values.inside), RADIUS))
    descent = _settled(field, cells, weight, bool(values.inside.all()))
    result = from_labels(values, field, descent.labels, descent, weight)
    return replace(result, labels=frame.back(result.labels, known.shape))


def _settled(field: Floats32, cells: Ints, weight: float, whole: bool) -> EdgeWeighted:
    """Lower the energy of cells, of a whole image at half the size first: borders move twice as far there."""
    (height, width), n_cells = (side // 2 for side in cells.shape), int(cells.max())
    if whole and min(height, width, (height * width / n_cells) ** 0.5) >= _LEAST_SIDE:
        half = halved(field)
        # A pixel stands for four there, and a border has half the length.
        small: Any = half, cells[: 2 * height : 2, : 2 * width : 2], weight / 2, True
        cells = doubled(_settled(*small).labels, cells.shape)
    return descend(field, cells, n_cells, edge_weight=weight, connected=True)
