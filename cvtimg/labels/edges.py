"""Edges of segments, as pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_labels

#: How the label of an edge point compares with that of its neighbor, by mode.
EDGE_MODES = {"inner": np.greater, "outer": np.less, "thick": np.not_equal}


def find_edges(
    labels: ArrayLike, *, mode: str = "inner", connectivity: int = 1, ignore: int | None = None
) -> NDArray[np.bool_]:
    """Find the pixels where one segment borders another.

    Parameters
    ----------
    labels : (H, W) integer array
        Segment of each pixel, >= 0.
    mode : {"inner", "outer", "thick"}
        Which of two neighbors with different labels is an edge point: "inner" takes the one with the higher label,
        "outer" the one with the lower label, "thick" both. Inner and outer edges are one pixel wide. Where labels
        run from dark to bright, as in a `Segmentation`, inner edges lie within the brighter segment. The inner edges
        of an object on label 0 are its rim.
    connectivity : {1, 2}
        1: pixels that share a side are neighbors. 2: so are pixels that share a corner.
    ignore : int, optional
        Label whose borders are not edges: 0 for the masked pixels of a `Segmentation`.

    Returns
    -------
    (H, W) bool array

    Notes
    -----
    For objects on label 0 that do not touch, the modes are those of ``skimage.segmentation.find_boundaries``. Where
    objects touch, scikit-image marks the rims of both in mode "inner"; here the edge stays one pixel wide.

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, X. Wang, Centroidal Voronoi tessellation algorithms for image compression,
    segmentation, and multichannel restoration, J. Math. Imaging Vision 24 (2006) 177-194,
    doi 10.1007/s10851-005-3620-4.

    Examples
    --------
    >>> from cvtimg import find_edges
    >>> labels = np.array([[1, 1, 2, 2, 3]])
    >>> find_edges(labels).astype(int).tolist(), find_edges(labels, mode="outer").astype(int).tolist()
    ([[0, 0, 1, 0, 1]], [[0, 1, 0, 1, 0]])
    """
    segments = check_labels("labels", labels)
    check_choice("mode", mode, EDGE_MODES)
    check_count("connectivity", connectivity, 2, "1 for sides, 2 for sides and corners")
    edges = np.zeros(segments.shape, np.bool_)
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1))[: 2 * connectivity]:
        here, there = (_shifted(-down), _shifted(-right)), (_shifted(down), _shifted(right))
        for side, other in ((here, there), (there, here)):
            met = EDGE_MODES[mode](segments[side], segments[other])
            counts = True if ignore is None else (segments[side] != ignore) & (segments[other] != ignore)
            edges[side] |= met & counts
    return edges


def _shifted(step: int) -> slice:
    """Leave out the first `step` places of an axis, or its last if `step` is negative."""
    return slice(max(step, 0), min(step, 0) or None)
