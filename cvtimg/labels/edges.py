"""Edges of segments, as pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice, check_labels
from cvtimg._shared.types import Bools

#: How the label of an edge point compares with that of its neighbor, by mode.
EDGE_MODES = {"inner": np.greater, "outer": np.less, "thick": np.not_equal}


def find_edges(labels: ArrayLike, *, mode: str = "inner", ignore: int | None = None) -> Bools:
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
    edges = np.zeros(segments.shape, np.bool_)
    for before, after in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        for side, other in ((before, after), (after, before)):
            met = EDGE_MODES[mode](segments[side], segments[other])
            counts = True if ignore is None else (segments[side] != ignore) & (segments[other] != ignore)
            edges[side] |= met & counts
    return edges
