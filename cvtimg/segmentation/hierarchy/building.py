"""Hierarchies of photographs, built from superpixels upward.

Superpixels, a tessellation of the image, are the leaves. How much neighbors differ is told by the border between
them, by the slow patterns of the whole image, and by the colors and textures of the regions, textures being told
apart by a second tessellation. The pair that differs least is merged, its statistics are added up, and so on.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from cvtimg._shared.checks import check_choice, check_count, check_partial_image
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import narrowed, peak, white_of
from cvtimg._shared.progress import part
from cvtimg._shared.types import Floats, ImageLike, Ints
from cvtimg.colors.spaces import SPACES
from cvtimg.pictures.showing import limits_of_measurements
from cvtimg.segmentation.hierarchy.channels import find_channels
from cvtimg.segmentation.hierarchy.leaves import Leaves, enlarged, find_leaves, reduced, reduction
from cvtimg.segmentation.hierarchy.settings import SETTINGS
from cvtimg.segmentation.hierarchy.strengths import evidence_of
from cvtimg.segmentation.hierarchy.tree import RegionHierarchy, altitudes_between
from cvtimg.segmentation.values import PictureValues, in_whole_numbers, picture_values, pixels_of


def segment_hierarchy(
    image: ImageLike, *, n_leaves: int = 1000, space: SpaceName = "lab", mask: ArrayLike | None = None
) -> RegionHierarchy:
    """Divide a photograph into a tree of regions, from which any number of regions is cut.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Integers or floating point. Pixels that are NaN, infinite, masked or transparent are left out; a last band of 2
        or 4 that is white everywhere is alpha. Contrast is stretched and strong noise is averaged away, so neither the
        exposure nor the type of the image matters.
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

    Notes
    -----
    Nothing is learned but some numbers, set by hand on 60 photographs of the Berkeley Segmentation Data Set.
    Borders are measured in discs of 2 to 10 pixels. Images of more than 1.3 megapixels are therefore reduced by a whole
    number first; leaves are found, and their colors and energies measured, on the reduced image, and then their borders
    follow the edges of the whole one.

    References
    ----------
    P. Arbelaez, M. Maire, C. Fowlkes, J. Malik, IEEE Trans. Pattern Analysis and Machine Intelligence 33 (2011)
    898-916, doi 10.1109/TPAMI.2010.161: contours, and hierarchies from them.

    Examples
    --------
    >>> from cvtimg import segment_hierarchy
    >>> image = np.zeros((40, 60), np.uint8)
    >>> image[:, 30:] = 200
    >>> hierarchy = segment_hierarchy(image, n_leaves=24)
    >>> hierarchy.n_leaves, hierarchy.cut(2)[20, ::10].tolist()
    (24, [1, 1, 1, 2, 2, 2])
    """
    check_choice("space", space, SPACES)
    n_leaves = check_count("n_leaves", n_leaves, 1 << 16, "the most leaves")
    array, inside = check_partial_image("image", image, mask)
    if array.shape[2] in (2, 4) and (array[..., -1][inside] == white_of(array.dtype)).all():
        array = np.ascontiguousarray(array[..., :-1])  # as an alpha that is opaque, though none is declared
    if array.shape[2] not in (1, 3):
        space = "rgb"
    array = narrowed(array)
    black, white = 0.0, peak(array.dtype)
    if space != "rgb" and (limits := limits_of_measurements(pixels_of(array, inside))) is not None:
        black, white = limits  # measurements are stretched to the range that they fill, to have a place in the space
        array = ((array - np.float64(black)) / (white - black or 1)).clip(0, 1).astype(np.float32)
    array = in_whole_numbers(array, inside)  # means of rounded values would depend on the type
    factor = reduction(inside.size)
    seen, seen_inside = reduced(array, inside, factor) if factor > 1 else (array, inside)
    values = picture_values(seen, space, seen_inside)
    with part(0.2, 0.7):  # of the time
        leaves = find_leaves(values, find_channels(values), n_leaves)
    if inside.size >= SETTINGS.enough_pixels:
        smaller, smaller_inside = reduced(seen, seen_inside, 2)
        half = picture_values(smaller, space, smaller_inside)
        with part(0.7, 1):
            leaves = aligned(leaves, find_leaves(half, find_channels(half), max(n_leaves // 2, 1)))
    if factor > 1:
        leaves = enlarged(leaves, array, inside, factor)
    return _measured(leaves, values, black, (white - black) / peak(values.dtype))


def aligned(leaves: Leaves, coarse: Leaves) -> Leaves:
    """Strengthen the borders between leaves where the leaves of an image of half the size merge late, too."""
    # J. Pont-Tuset, P. Arbelaez, J. Barron, F. Marques, J. Malik, IEEE Trans. Pattern Analysis and Machine Intelligence
    # 39 (2017) 128-140, doi 10.1109/TPAMI.2016.2537320: hierarchies at several scales, aligned.
    if not len(coarse.borders.pairs):
        return leaves
    between = altitudes_between(coarse.borders.pairs, *coarse.merged(), len(coarse.sizes))
    near = ndimage.maximum_filter(coarse.borders.on_pixels(between, coarse.labels.shape), 3)
    borders = leaves.borders
    seen = near[tuple(borders.places.T // 2)].astype(np.float64)
    if not len(seen):
        return leaves
    means = borders.means(seen)
    weight = SETTINGS.other_view
    strengths = (leaves.strengths + weight * means) / (1 + weight**2)
    near_altitudes = altitudes_between(borders.pairs, *leaves.merged(), len(leaves.sizes))
    return replace(leaves, strengths=strengths, near_and_far=(near_altitudes, means))


def _measured(leaves: Leaves, values: PictureValues, black: float, unit: float) -> RegionHierarchy:
    """Merge the leaves, and measure the nodes of the tree; colors are `black` and those of the values times `unit`."""
    merges, altitudes = leaves.merged()
    moments = np.column_stack([leaves.sizes, leaves.moments])
    n_leaves = len(moments)
    nodes = np.concatenate([moments, np.zeros((len(merges), moments.shape[1]))])
    for node, (first, second) in enumerate(merges.tolist(), start=n_leaves):
        nodes[node] = nodes[first] + nodes[second]
    sizes, sums, squares = nodes[:, 0], nodes[:, 1:-1], nodes[:, -1]
    means = sums / sizes[:, None]
    energies = np.maximum(squares - np.einsum("nd,nd->n", sums, means), 0)
    roots = np.setdiff1d(np.arange(len(nodes)), merges)
    total = float(energies[roots].sum())
    borders = leaves.borders
    between = altitudes_between(borders.pairs, merges, altitudes, n_leaves)
    explained = 1 - float(energies[:n_leaves].sum()) / total if total > 0 else 0.0
    near, far = leaves.near_and_far or (between, between)
    return RegionHierarchy(
        leaves=leaves.labels,
        merges=merges,
        altitudes=altitudes,
        sizes=sizes.copy(),
        colors=values.to_picture(means + values.center) * unit + black,
        means=means,
        energies=energies,
        evidence=evidence_of(borders, (near, leaves.strengths, far), leaves.labels > 0),
        default_threshold=default_threshold(borders.lengths, between, explained),
    )


def default_threshold(lengths: Ints, altitudes: Floats, explained: float) -> float:
    """Choose where to cut a tree."""
    # Many small or faint objects, such as nuclei in a micrograph, differ by less than regions of photographs do.
    # Lengths and altitudes, (B,), are those of the borders between leaves; power is length times squared altitude.
    # `explained` is the part of the variance of the image that the means of the leaves have.
    order = np.argsort(-altitudes, kind="stable")
    power = np.cumsum(lengths[order] * altitudes[order] ** 2)
    if explained < SETTINGS.most or not len(power) or power[-1] <= 0:
        return SETTINGS.threshold
    n_above = np.count_nonzero(altitudes > SETTINGS.threshold)
    if n_above and power[n_above - 1] >= SETTINGS.hardly_any * power[-1]:
        return SETTINGS.threshold
    last = altitudes[order[np.searchsorted(power, SETTINGS.most * power[-1])]]
    return min(max(float(np.nextafter(last, 0)), SETTINGS.least_threshold), SETTINGS.threshold)
