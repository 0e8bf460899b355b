"""Numbers of regions: colors, tables and run lengths.

A region is all pixels of one label, in one piece or many; label 0 is what is masked, and no region.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._checks import check_labeled_image, check_labels


def region_means(labels: ArrayLike, image: Any) -> NDArray[np.float64]:
    """Compute the mean of each region in each band.

    Parameters
    ----------
    labels : (H, W) integer array
        Region of each pixel, 0 for what is masked.
    image : (H, W) or (H, W, C) array
        Anything finite; masked pixels may be NaN.

    Returns
    -------
    (max label + 1, C) float64 array
        A row for each label. Row 0 and rows of labels that do not occur are NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.regions import region_means
    >>> region_means(np.array([[1, 2, 2]]), np.array([[10, 20, 40]], np.uint8)).ravel().tolist()
    [nan, 10.0, 30.0]
    """
    segments = check_labels("labels", labels)
    values = check_labeled_image("image", image, segments)
    flat = segments.ravel()
    counts = np.bincount(flat).astype(np.float64)
    counts[0] = 0
    sums = [np.bincount(flat, values[:, :, band].ravel()) for band in range(values.shape[2])]
    with np.errstate(invalid="ignore", divide="ignore"):
        means: NDArray[np.float64] = np.stack(sums, axis=1) / counts[:, None]
    means[counts == 0] = np.nan
    return means
