"""Cells of points as convex polygons that fill a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Polygons = tuple[NDArray[np.float64], ...]

#: How far the frame of points is that closes all cells, in sides of the picture.
_FAR = 8.0
#: Corners nearer to each other than this, in pixels, are one.
_APART = 1e-7


def cell_polygons(points: NDArray[np.float64], weights: NDArray[np.float64] | None, shape: tuple[int, int]) -> Polygons:
    """Compute Voronoi or power cells, cut off at the sides of a picture.

    Parameters
    ----------
    points : (N, 2) array
        Generators (x, y) in pixels, inside the picture.
    weights : (N,) array, optional
        In squared pixels: place p belongs to the generator with the least abs(p - z)**2 - w. None for Voronoi cells.
    shape : (int, int)
        Height and width of the picture.

    Returns
    -------
    tuple of (M, 2) float64 arrays
        The corners of each cell in order, clockwise as seen on a screen, with y down. A generator without a cell, as
        one of two in the same place, has an empty polygon.

    Notes
    -----
    A power diagram is the lower hull of its generators, lifted by their squared length less their weight
    (F. Aurenhammer, SIAM J. Computing 16 (1987) 78-96, doi 10.1137/0216006).

    Examples
    --------
    >>> import numpy as np
    >>> left, right = cell_polygons(np.array([[1.0, 1.0], [3.0, 1.0]]), None, (2, 4))
    >>> left.round(9).tolist()
    [[2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]]
    """
    size = np.array(shape[::-1], np.float64)
    loads = np.zeros(len(points)) if weights is None else weights - weights.max()
    owners, corners = _corners(points, loads, size)
    outside = np.unique(owners[((corners < 0) | (corners > size)).any(axis=1)])
    cells = list(_in_order(owners, corners, len(points)))
    for cell in outside:
        cells[cell] = _cut_off(cells[cell], size)
    return tuple(cells)


def _cut_off(polygon: NDArray[np.float64], size: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cut a convex polygon off at the sides of a picture, one after the other."""
    for axis in (0, 1):
        for sign, side in ((1, 0.0), (-1, size[axis])):
            if len(polygon) == 0:
                return polygon
            depth = sign * (polygon[:, axis] - side)
            after = np.roll(depth, -1)
            crossing = (depth < 0) != (after < 0)
            part = np.divide(depth, depth - after, out=np.zeros_like(depth), where=crossing)
            cuts = polygon + part[:, np.newaxis] * (np.roll(polygon, -1, axis=0) - polygon)
            cuts[:, axis] = side
            places = np.stack([polygon, cuts], axis=1)[np.stack([depth >= 0, crossing], axis=1)]
            polygon = _distinct(places)
    return polygon


def _distinct(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Leave out corners that coincide, and polygons without an area."""
    apart = np.hypot(*(np.roll(places, -1, axis=0) - places).T) > _APART
    return places[apart] if apart.sum() > 2 else np.empty((0, 2))


def _corners(
    points: NDArray[np.float64], weights: NDArray[np.float64], size: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """List the corners of all cells, in any order: whose they are, and where."""
    from scipy.spatial import ConvexHull

    middle, reach = size / 2, _FAR * size.max()
    frame = reach * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    places = np.concatenate([points - middle, frame])
    heights = (places**2).sum(axis=1) - np.append(weights, np.zeros(4))
    hull = ConvexHull(np.column_stack([places, heights]) / [reach, reach, reach**2])
    below = hull.equations[:, 2] < -1e-12
    normals = hull.equations[below, :3]
    corners = -0.5 * reach * normals[:, :2] / normals[:, 2:] + middle
    owners = hull.simplices[below]
    real = (owners < len(points)).ravel()
    return owners.ravel()[real], np.repeat(corners, 3, axis=0)[real]


def _in_order(owners: NDArray[np.int32], corners: NDArray[np.float64], n_cells: int) -> Polygons:
    """Put the corners of each cell in order around their middle, without those that coincide."""
    counts = np.bincount(owners, minlength=n_cells)
    sums = np.stack([np.bincount(owners, corners[:, axis], n_cells) for axis in (0, 1)], axis=1)
    middles = sums / np.maximum(counts, 1)[:, np.newaxis]
    steps = corners - middles[owners]
    order = np.lexsort([np.arctan2(steps[:, 1], steps[:, 0]), owners])
    owners, corners = owners[order], corners[order]
    last = np.append(owners[1:] != owners[:-1], True)
    starts = np.append(0, np.cumsum(counts))
    following = np.arange(1, len(owners) + 1)
    following[last] = starts[owners[last]]
    distinct = np.hypot(*(corners[following] - corners).T) > _APART
    ends = np.cumsum(np.bincount(owners[distinct], minlength=n_cells))[:-1]
    polygons = np.split(corners[distinct], ends)
    return tuple(polygon if len(polygon) > 2 else np.empty((0, 2)) for polygon in polygons)


def triangle_polygons(points: NDArray[np.float64], triangles: NDArray[np.int32]) -> Polygons:
    """Return the corners of triangles, all in the sense of `cell_polygons`."""
    corners = points[triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turned = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    return tuple(triangle[:: -1 if flip else 1] for triangle, flip in zip(corners, turned, strict=True))
