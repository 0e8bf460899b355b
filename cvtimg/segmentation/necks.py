"""Necks of touching objects told from ripples of one outline.

A cut between two parts of a piece is right at a neck, where the outline is concave at both ends and the piece is
narrower than the parts on either side. A straight or bent rod has cuts, too, where noise and the grid of pixels make it
narrower by a fraction of a pixel. How deep and narrow a cut is follows one distribution for ripples, another for necks,
and the share of necks in an image is found by expectation and maximization.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Floats, Floats32, Ints, Ints64
from cvtimg.labels.components import find_borders
from cvtimg.segmentation.touching import ROUNDS, largest_by_label


@dataclass(frozen=True, slots=True)
class Ripples:
    """Distributions of the depth of cuts plus `narrowing` times how much narrower than both parts they are.

    Measured on drawn rods of radius 3 to 11 with noise up to 40 % of the contrast, and on necks of the phantoms of
    ``benchmarks/objects.py``.
    """

    narrowing: float = 1.5  # weight of narrowing beside depth, whose spread is larger; more trusts radii more
    spread: float = 0.37  # standard deviation on the grid of pixels, in pixels; larger joins more
    spread_of_noise: float = 0.7  # what noise of the outline adds to it, per pixel of that noise; larger joins more
    mean: float = 2.9  # of ripples, in standard deviations; larger joins more
    neck: float = 0.7  # scale of the Rayleigh distribution of necks, in radii of the smaller part; larger joins more
    deepest: float = 1.5  # of necks, in the same; larger makes deep necks less likely


RIPPLES = Ripples()
#: Half the side of the window around a cut in which parts are to be concave, in radii of the smaller part.
_REACH = 2.0


def join_at_ripples(parts: Ints, distance: Floats32, noise: float, fine: int = 1) -> Ints:
    """Join (H, W) parts at cuts that are more likely ripples than necks.

    `distance` is that to the background, in pixels. `noise` is how far noise moves outlines (standard deviation), in
    pixels of the image, each of which is `fine` of those of the parts: ripples are of the image.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs, *figures = _cuts(parts, distance)
    depths, narrowings, radii = (figure / fine for figure in figures)
    ripples = _odds_of_necks(depths, narrowings, radii, noise) < 0.5
    first, second = pairs[ripples].T
    n = int(parts.max()) + 1
    links = coo_array((np.ones(len(first)), (first, second)), shape=(n, n))
    pieces = connected_components(links, directed=False)[1]
    _, firsts, of_piece = np.unique(pieces, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(firsts))[of_piece][parts], np.int32)


def _odds_of_necks(depths: Floats, narrowings: Floats, radii: Floats, noise: float) -> Floats:
    """Return the probability of each cut, by its depth, its narrowing and the smaller radius, that it is a neck."""
    sizes = np.minimum(depths, RIPPLES.deepest * radii) + RIPPLES.narrowing * narrowings
    sigma = float(np.hypot(RIPPLES.spread, RIPPLES.spread_of_noise * noise))
    above = np.maximum(sizes / sigma - RIPPLES.mean, 0)  # a smaller ripple is no less likely
    as_ripple = np.exp(-0.5 * above**2) / (np.sqrt(2 * np.pi) * sigma)
    scaled = np.minimum(sizes / radii, 2.0) / RIPPLES.neck
    as_neck = (scaled * np.exp(-0.5 * scaled**2) / RIPPLES.neck + 1 / RIPPLES.deepest) / (2 * radii)
    share, odds = 0.5, np.ones(len(sizes))
    for _ in range(ROUNDS):
        odds = share * as_neck / (share * as_neck + (1 - share) * as_ripple)
        share = (float(odds.sum()) + 1) / (len(odds) + 2)  # as if a cut of either kind had been seen
    return np.where(np.isfinite(depths), odds, 1.0)


def _cuts(parts: Ints, distance: Floats32) -> tuple[Ints, Floats, Floats, Floats]:
    """Return which parts meet, and of each cut how deep, how much narrower, and the radius of the smaller part."""
    borders = find_borders(parts)
    pairs = borders.pairs + 1
    n_cuts = len(pairs)
    thickest = largest_by_label(distance, parts)
    smaller = thickest[pairs].min(axis=1) if n_cuts else np.zeros(0)
    radii = np.maximum(smaller, 1.0)
    # Pixels on both sides of each cut, and those where the cut ends: next to pixels of neither part.
    here = np.repeat(np.arange(n_cuts), borders.lengths)
    after = borders.places + np.where(borders.is_flat[:, None], [1, 0], [0, 1])
    rows = np.concatenate([np.column_stack([here, borders.places]), np.column_stack([here, after])])
    rows = np.unique(rows, axis=0)
    cut, y, x = rows.T
    padded = np.pad(parts, 1, constant_values=-1)
    near = np.stack([padded[y + down, x + right] for down in range(3) for right in range(3)], axis=1)
    at_rim = (near == -1).any(axis=1)
    is_end = ((near[:, :, None] != pairs[cut][:, None, :]).all(axis=2)).any(axis=1) & ~at_rim
    saddles = np.zeros(n_cuts)
    np.maximum.at(saddles, cut, distance[y, x])
    # Parts near a cut, and the place of it that is farthest from its middle.
    centers, ways, hulls = np.zeros((n_cuts, 2)), np.zeros((n_cuts, 2)), []
    for index, (first, last) in enumerate(pairwise(np.searchsorted(cut, np.arange(n_cuts + 1)))):
        centers[index] = rows[first:last, 1:].mean(axis=0)
        away = rows[first:last, 1:] - centers[index]
        far = np.hypot(*away.T)
        ways[index] = away[far.argmax()]
        reach = max(_REACH * radii[index], far.max() + radii[index])
        hulls.append(_outline(parts, pairs[index], centers[index], reach))
    # How far the ends on either side lie within the convex hull of both parts: N. Kumar et al., Pattern Recognition 39
    # (2006), doi 10.1016/j.patcog.2005.11.014: concavity points.
    deepest = np.full((n_cuts, 2), -np.inf)
    if is_end.any():
        of_end, places = cut[is_end], rows[is_end, 1:]
        coordinates, of_place = np.concatenate(hulls), np.repeat(np.arange(n_cuts), [*map(len, hulls)])
        shapes = shapely.convex_hull(shapely.linestrings(coordinates, indices=of_place))
        rims = np.where(shapely.area(shapes) > 0, shapely.boundary(shapes), shapes)
        ahead = np.einsum("nd,nd->n", places - centers[of_end], ways[of_end]) > 0
        depths = shapely.distance(rims[of_end], shapely.points(places))
        np.maximum.at(deepest, (of_end, ahead.astype(np.intp)), depths)
    return pairs, np.where(deepest < 0, np.inf, deepest).min(axis=1), smaller - saddles, radii


def _outline(parts: Ints, pair: Ints, center: Floats, reach: float) -> Ints64:
    """Return the first and last pixels of both parts in each row near a place: they have the convex hull of all."""
    low = np.maximum(np.floor(center - reach).astype(int), 0)
    high = np.minimum(np.ceil(center + reach).astype(int) + 1, parts.shape)
    window = parts[low[0] : high[0], low[1] : high[1]]
    down, right = (np.arange(first, last) - middle for first, last, middle in zip(low, high, center, strict=True))
    both = ((window == pair[0]) | (window == pair[1])) & (np.hypot(down[:, None], right) <= reach)
    rows = np.flatnonzero(both.any(axis=1))
    ends = both[rows].argmax(axis=1), both.shape[1] - 1 - both[rows, ::-1].argmax(axis=1)
    return np.concatenate([np.stack([rows, columns], axis=1) for columns in ends]) + low
