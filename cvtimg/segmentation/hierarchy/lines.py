"""Edges as lines with the chance that people draw them: borders of leaves, joined where no third one meets them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Floats, ImageLike, Ints, Points
from cvtimg.halfedges import EdgeTable
from cvtimg.labels.components import find_borders
from cvtimg.labels.contours import find_contours, simplify, strings_of


class Lines(NamedTuple):
    """Lines, the most likely first.

    Attributes
    ----------
    lines : tuple of (N, 2) float64 arrays
        Points (x, y) in pixels, as in `Contours`. A closed line ends where it begins; lines meet at their ends.
    chances : (L,) float64 array
        Chance that a person draws each line, the mean along it, in 0..1.
    """

    lines: tuple[Points, ...]
    chances: Floats


def find_lines(
    leaves: Ints, chances: NDArray[np.floating], least: float, most: int | None, image: ImageLike | None, off: float
) -> Lines:
    """Join borders between leaves, (B,) chances each, from the least on; keep the `most` that people draw most of."""
    contours = find_contours(leaves, image)
    border = EdgeTable(find_borders(leaves).pairs, int(leaves.max()) + 1).find(contours.sides - 1)
    chance_of = np.where((contours.sides > 0).all(axis=1), np.append(chances, 0.0)[border], 0.0)
    kept = np.flatnonzero((chance_of >= least) & (chance_of > 0))
    if not len(kept):
        return Lines((), np.zeros(0))
    parts = strings_of([contours.lines[line] for line in kept])
    joined = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(parts)))
    middles = shapely.line_interpolate_point(parts, 0.5, normalized=True)
    of_part = shapely.STRtree(joined).query_nearest(middles, all_matches=False)[1]
    lengths = shapely.length(parts)
    drawn = np.bincount(of_part, chance_of[kept] * lengths)
    means = drawn / np.bincount(of_part, lengths)
    order = np.argsort(-drawn, kind="stable")[:most]
    order = order[np.argsort(-means[order], kind="stable")]
    lines = [shapely.get_coordinates(line) for line in joined]
    simple = simplify(lines, off) if off else lines
    return Lines(tuple(simple[line] for line in order), means[order])
