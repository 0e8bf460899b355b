"""Edges of segments, as pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_labels

#: How the label of an edge point compares with that of its neighbour, by the name of the mode.
EDGE_MODES = {"inner": np.greater, "outer": np.less, "thick": np.not_equal}


def find_edges(
    labels: ArrayLike, *, mode: str = "inner", connectivity: int = 1, ignore: int | None = None
) -> NDArray[np.bool_]:
    """Find the pixels where one segment borders on another.

    Parameters
    ----------
    labels : (H, W) integer array
        Segment of each pixel, 0 or higher.
    mode : {"inner", "outer", "thick"}
        Of two neighbours with different labels, "inner" takes the one with the higher label, "outer" the one with
        the lower, "thick" both. Inner and outer edges are one pixel wide. Where labels go from dark to bright, as in
        a `Segmentation`, inner edges lie within the brighter segment; of an object on label 0 they are its rim.
    connectivity : {1, 2}
        1: the four pixels that share a side are neighbours. 2: so are the four across a corner.
    ignore : int, optional
        A label whose borders are no edges: 0 for the masked pixels of a `Segmentation`.

    Returns
    -------
    (H, W) bool array

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here.

    Notes
    -----
    For objects on label 0 that do not touch, the modes are those of ``skimage.segmentation.find_boundaries``. Where
    objects touch, that marks the rims of both in mode "inner"; here it stays one pixel wide.

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, X. Wang, Centroidal Voronoi tessellation algorithms for image compression,
    segmentation, and multichannel restoration, J. Math. Imaging Vision 24 (2006) 177-194,
    doi 10.1007/s10851-005-3620-4.

    Examples
    --------
    >>> import numpy as np
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
            edges[side] |= _is_edge(segments[side], segments[other], mode, ignore)
    return edges


def _shifted(step: int) -> slice:
    """Take of an axis what remains when its first `step` places, or its last if that is negative, have no partner."""
    return slice(max(step, 0), min(step, 0) or None)


def _is_edge(side: NDArray[np.int32], other: NDArray[np.int32], mode: str, ignore: int | None) -> NDArray[np.bool_]:
    """Tell the pixels of one side that are edge points for their neighbours on the other side."""
    edges: NDArray[np.bool_] = EDGE_MODES[mode](side, other)
    if ignore is not None:
        edges &= (side != ignore) & (other != ignore)
    return edges
