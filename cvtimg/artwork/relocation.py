"""Relocation of cells: one that its neighbors can replace goes where a cell is worth dividing.

A descent moves points only a little at a time. A cell in a flat part of the image is hardly missed there, yet it never
reaches a part with detail on its way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.artwork.painting import Painted

Floats = NDArray[np.float64]

#: At most one cell in so many is relocated at a time: the estimates hold only while few neighbors change.
_AT_MOST = 20
#: A relocation must cost less than this part of what it gains, as both are estimates.
_WORTH = 0.7
#: The part of the error that a slope explains which a step explains, too, in a cell of uniform width.
_STEP_OF_SLOPE = 0.75


def relocate(image: NDArray[np.float32], points: Floats, painted: Painted) -> tuple[Floats, NDArray[np.intp]]:
    """Divide the cells that gain most by it, with points whose cells are missed least.

    Parameters
    ----------
    image : (H, W, C) float32 array
    points : (K, 2) array
        Generators of the Voronoi cells, (x, y) in pixels.
    painted : Painted
        The cells, as they are.

    Returns
    -------
    points : (K, 2) float64 array
        The points after relocation.
    moved : (M,) array
        Indices of the points that changed.
    """
    costs, (gains, middles, offsets) = removal_costs(painted), division_gains(image, painted)
    n_most = max(1, len(points) // _AT_MOST)
    removed, divided = np.argsort(costs, kind="stable")[:n_most], np.argsort(-gains, kind="stable")[:n_most]
    worth = (costs[removed] < _WORTH * gains[divided]) & ~np.isin(removed, divided)
    removed, divided = removed[worth], divided[worth]
    points = points.copy()
    points[removed] = middles[divided] + offsets[divided]
    points[divided] = middles[divided] - offsets[divided]
    return points, np.concatenate([removed, divided])


def removal_costs(painted: Painted) -> Floats:
    """(K,) estimate of how much the error grows if a cell is shared among its neighbors by the lengths of borders."""
    n_cells = len(painted.areas)
    squares, lengths = np.zeros(n_cells), np.zeros(n_cells)
    labels = painted.labels
    for one, other in ((labels[:, :-1], labels[:, 1:]), (labels[:-1], labels[1:])):
        border = one != other
        sides = one[border], other[border]
        apart = np.square(painted.colors[sides[0]] - painted.colors[sides[1]]).sum(axis=1)
        for side in sides:
            squares += np.bincount(side, apart, n_cells)
            lengths += np.bincount(side, minlength=n_cells)
    costs: Floats = painted.areas * squares / np.maximum(lengths, 1)
    return costs


def division_gains(image: NDArray[np.float32], painted: Painted) -> tuple[Floats, Floats, Floats]:
    """Estimate what the error falls by if a cell is divided across the direction in which colors change most.

    Returns
    -------
    gains : (K,) array
    middles, offsets : (K, 2) arrays
        The center of each cell, and from there to the centers of its halves, one way and the other.
    """
    n_cells, areas = len(painted.areas), np.maximum(painted.areas, 1)
    labels = painted.labels.ravel()
    height, width = painted.labels.shape

    def sums(values: NDArray[np.floating]) -> Floats:
        return np.bincount(labels, values, n_cells).astype(np.float64, copy=False)

    places = np.stack([np.tile(np.arange(width) + 0.5, height), np.repeat(np.arange(height) + 0.5, width)])
    middles = np.stack([sums(axis) for axis in places], axis=1) / areas[:, np.newaxis]
    x, y = places - middles.T[:, labels]
    slopes = np.stack([[sums(axis * band) for band in image.reshape(len(labels), -1).T] for axis in (x, y)])
    # A pixel is a square: about its center it has 1/12 of its area, and no cell is flat.
    across, down, mixed = sums(x * x) + areas / 12, sums(y * y) + areas / 12, sums(x * y)
    moments = np.stack([[across, mixed], [mixed, down]]).transpose(2, 0, 1)
    # Of all directions d, the slope along d explains most where |slopes d|^2 / (d moments d) is greatest.
    roots = np.linalg.cholesky(moments)
    whitened = np.linalg.solve(roots, slopes.transpose(2, 0, 1))
    values, vectors = np.linalg.eigh(whitened @ whitened.transpose(0, 2, 1))
    directions = np.linalg.solve(roots.transpose(0, 2, 1), vectors[:, :, -1:])[:, :, 0]
    # The halves of a uniform cell have their centers at half the root of three times its standard deviation.
    lengths = np.sqrt(3) / 2 / (np.sqrt(areas) * np.square(directions).sum(axis=1))
    return _STEP_OF_SLOPE * values[:, -1], middles, directions * lengths[:, np.newaxis]
