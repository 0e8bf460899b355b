"""Hierarchies of photographs, built from superpixels upward.

Superpixels, a tessellation of the image, are the leaves. How much neighbors differ is told by the border between
them, by the slow patterns of the whole image, and by the colors and textures of the regions, textures being told
apart by a second tessellation. The pair that differs least merges, what is known of the two is added up, and so on.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_partial_image
from cvtimg.colors.spaces import SPACES
from cvtimg.segmentation.edge_weight import descend
from cvtimg.segmentation.grid_cells import grid_of_cells
from cvtimg.segmentation.hierarchy._borders import N_LEVELS, N_TEXTONS
from cvtimg.segmentation.hierarchy.borders import border_strengths, find_borders, smoothing_matrix
from cvtimg.segmentation.hierarchy.channels import Channels, find_channels
from cvtimg.segmentation.hierarchy.eigenvectors import global_strengths
from cvtimg.segmentation.hierarchy.merging import Merges, Weights, merge_regions
from cvtimg.segmentation.hierarchy.tree import RegionHierarchy
from cvtimg.segmentation.values import PictureValues, picture_values

_MOST_LEAVES = 1 << 16
#: What a pair of near pixels in different leaves costs, in squared values.
_COMPACTNESS = 5.0
#: What steps of eigenvectors across a border add to its strength.
_GLOBAL_WEIGHT = 0.6


def segment_hierarchy(
    image: Any,
    *,
    n_leaves: int = 1000,
    space: str = "lab",
    mask: ArrayLike | None = None,
) -> RegionHierarchy:
    """Divide a photograph into a tree of regions, from which any number of regions is cut.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Integers or floating point. Pixels that are NaN, infinite or masked are left out. Contrast is stretched and
        strong noise is averaged away, so neither the exposure nor the type of the image matters.
    n_leaves : int
        Approximate number of superpixels at the bottom of the tree, at most 65536.
    space : {"lab", "oklab", "rgb", "linear"}
        Color space in which regions are compared. Images with other than 1 or 3 bands are compared in their own
        units, and in the histograms by their three principal components.
    mask : (H, W) array, optional
        Pixels where it is not 0 are segmented; the others have label 0 and no influence.

    Returns
    -------
    RegionHierarchy
        The same bits for the same image, whatever the number of threads.

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here; the message names it.

    See Also
    --------
    segment : A given number of colors rather than regions.
    superpixels : The leaves.

    Notes
    -----
    Nothing is learned but about ten numbers, set by hand on 60 photographs of the Berkeley Segmentation Data Set.
    Discs around cracks have radii of 2 to 10 pixels and textons see about 6: an image much larger than a megapixel is
    best reduced first.

    References
    ----------
    P. Arbelaez, M. Maire, C. Fowlkes, J. Malik, IEEE Trans. Pattern Analysis and Machine Intelligence 33 (2011)
    898-916, doi 10.1109/TPAMI.2010.161: contours, and hierarchies from them.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import segment_hierarchy
    >>> image = np.zeros((40, 60), np.uint8)
    >>> image[:, 30:] = 200
    >>> hierarchy = segment_hierarchy(image, n_leaves=24)
    >>> hierarchy.n_leaves, hierarchy.cut(2)[20, ::10].tolist()
    (24, [1, 1, 1, 2, 2, 2])
    """
    check_choice("space", space, SPACES)
    check_count("n_leaves", n_leaves, _MOST_LEAVES, "the most leaves")
    array, inside = check_partial_image("image", image, mask)
    values = picture_values(array, space if array.shape[2] in (1, 3) else "rgb", inside)
    channels = find_channels(values)
    leaves = _find_leaves(channels, n_leaves)
    return _measured(leaves, _merge_leaves(leaves, channels), values)


def _find_leaves(channels: Channels, n_leaves: int) -> NDArray[np.int32]:
    """(H, W) superpixels, numbered from 1 without gaps; 0 outside the mask."""
    cells = grid_of_cells(channels.inside, min(n_leaves, int(channels.inside.sum())))
    labels = descend(channels.values, cells, int(cells.max()), edge_weight=_COMPACTNESS, connected=True).labels
    in_use = np.bincount(labels.ravel()) > 0
    in_use[0] = False
    numbers: NDArray[np.int32] = np.cumsum(in_use, dtype=np.int32)
    return numbers[labels]


def _merge_leaves(leaves: NDArray[np.int32], channels: Channels) -> Merges:
    own = leaves[channels.inside] - 1
    sizes = np.bincount(own).astype(np.float64)
    borders = find_borders(leaves)
    strengths = border_strengths(borders, channels)
    steps = global_strengths(borders.pairs, strengths, borders.lengths, sizes)
    # Patterns have slopes even where there is nothing to see: they confirm what is there, and no more.
    strengths = strengths + np.minimum(_GLOBAL_WEIGHT * steps, strengths)
    histograms = leaf_histograms(own, len(sizes), channels)
    return merge_regions(borders.pairs, borders.lengths, strengths, sizes, histograms, Weights())


def leaf_histograms(own: NDArray[np.int32], n_leaves: int, channels: Channels) -> list[NDArray[np.float64]]:
    """(N, bins) histogram of each channel, colors smoothed, in the leaves (n,) that pixels inside have."""
    n_colors = channels.bins.shape[2] - 1
    histograms = []
    for channel, n_bins in enumerate([N_LEVELS] * n_colors + [N_TEXTONS]):
        bins = channels.bins[..., channel][channels.inside]
        counts = np.bincount(own * np.int64(n_bins) + bins, minlength=n_leaves * n_bins).reshape(-1, n_bins)
        mixing = smoothing_matrix() if channel < n_colors else np.eye(n_bins)
        histograms.append(np.einsum("nb,bc->nc", counts, mixing))
    return histograms


def _measured(leaves: NDArray[np.int32], merges: Merges, values: PictureValues) -> RegionHierarchy:
    """Measure the nodes of the tree."""
    own = leaves[values.inside] - 1
    rows = values.field()[values.inside]
    squares = np.bincount(own, np.einsum("nd,nd->n", rows, rows, dtype=np.float64))
    moments = [np.bincount(own), *(np.bincount(own, column) for column in rows.T), squares]
    nodes = np.concatenate([np.stack(moments, axis=1), np.zeros((len(merges.pairs), len(moments)))])
    n_leaves = len(nodes) - len(merges.pairs)
    for node, (one, other) in enumerate(merges.pairs.tolist(), start=n_leaves):
        nodes[node] = nodes[one] + nodes[other]
    sizes, sums, squares = nodes[:, 0], nodes[:, 1:-1], nodes[:, -1]
    means = sums / sizes[:, None]
    return RegionHierarchy(
        leaves=leaves,
        merges=merges.pairs,
        altitudes=merges.altitudes,
        sizes=sizes.copy(),
        colors=values.to_picture(means + values.center),
        energies=np.maximum(squares - np.einsum("nd,nd->n", sums, means), 0),
    )
