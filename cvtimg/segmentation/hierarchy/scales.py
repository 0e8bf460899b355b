"""Two scales: what an image shows from twice as far away strengthens the borders that lie there.

J. Pont-Tuset, P. Arbelaez, J. Barron, F. Marques, J. Malik, IEEE Trans. Pattern Analysis and Machine Intelligence 39
(2017) 128-140, doi 10.1109/TPAMI.2016.2537320: hierarchies at several scales, aligned.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cvtimg.segmentation.hierarchy.contour_maps import altitudes_between, on_cracks
from cvtimg.segmentation.hierarchy.leaves import Leaves

#: Weight of the hierarchy of the reduced image, and its factor on the scale of strengths.
_WEIGHT, _WORTH = 0.6, 0.6
#: Borders at the two scales belong to each other within this many half pixels of the reduced image.
_NEAR = 2


def aligned(leaves: Leaves, coarse: Leaves) -> Leaves:
    """Strengthen the borders between leaves where the leaves of an image of half the size merge late, too."""
    from scipy.ndimage import maximum_filter

    if not len(coarse.borders.pairs):
        return leaves
    merges = coarse.merged()
    between = altitudes_between(coarse.borders.pairs, merges.pairs, merges.altitudes, len(coarse.sizes))
    height, width = coarse.labels.shape
    near = maximum_filter(on_cracks(coarse.borders, between, (height, width)), 2 * _NEAR + 1)
    borders = leaves.borders
    # A pixel of the whole image is half a pixel of the other: as large as a step in its map of cracks.
    rows, columns = borders.places.T + 1
    seen = near[np.minimum(rows, 2 * height), np.minimum(columns, 2 * width)].astype(np.float64)
    if not len(seen):
        return leaves
    means = np.add.reduceat(seen, borders.starts[:-1]) / borders.lengths
    return replace(leaves, strengths=(leaves.strengths + _WEIGHT * means) / (1 + _WEIGHT * _WORTH))
