"""Cells of points as convex polygons that fill a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Polygons = tuple[NDArray[np.float64], ...]

#: How far the frame of points is that closes all cells, in sides of the picture.
_FAR = 8.0


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
    (F. Aurenhammer, SIAM J. Computing 16 (1987) 78-96, doi 10.1137/0216006). Generators whose cells reach over a side
    are mirrored at it: the cells of a generator and its mirror image meet at that side, and nowhere else.

    Examples
    --------
    >>> import numpy as np
    >>> left, right = cell_polygons(np.array([[1.0, 1.0], [3.0, 1.0]]), None, (2, 4))
    >>> left.round(9).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
    """
    size = np.array(shape[::-1], np.float64)
    loads = np.zeros(len(points)) if weights is None else weights - weights.max()
    owners, corners = _corners(points, loads, size)
    mirrored = [np.empty((0, 2))]
    sources = [np.empty(0, np.intp)]
    for axis in (0, 1):
        for side, beyond in ((0.0, corners[:, axis] < 0), (size[axis], corners[:, axis] > size[axis])):
            crossing = np.unique(owners[beyond])
            images = points[crossing].copy()
            images[:, axis] = 2 * side - images[:, axis]
            mirrored.append(images)
            sources.append(crossing)
    images, origin = np.concatenate(mirrored), np.concatenate(sources)
    # One that lies on a side is its own mirror image, and would share its cell: it is moved in by a hair.
    inner = np.clip(points, 1e-9 * size, (1 - 1e-9) * size)
    images = np.where(images == points[origin], 2 * images - inner[origin], images)
    owners, corners = _corners(np.concatenate([inner, images]), np.append(loads, loads[origin]), size)
    kept = owners < len(points)
    return _in_order(owners[kept], np.clip(corners[kept], 0, size), len(points))


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
    middles = np.stack([np.bincount(owners, corners[:, axis], n_cells) for axis in (0, 1)], axis=1)
    middles /= np.maximum(counts, 1)[:, np.newaxis]
    steps = corners - middles[owners]
    order = np.lexsort([np.arctan2(steps[:, 1], steps[:, 0]), owners])
    owners, corners = owners[order], corners[order]
    last = np.append(owners[1:] != owners[:-1], True)
    starts = np.append(0, np.cumsum(counts))
    following = np.arange(1, len(owners) + 1)
    following[last] = starts[owners[last]]
    distinct = np.hypot(*(corners[following] - corners).T) > 1e-7
    ends = np.cumsum(np.bincount(owners[distinct], minlength=n_cells))[:-1]
    polygons = np.split(corners[distinct], ends)
    return tuple(polygon if len(polygon) > 2 else np.empty((0, 2)) for polygon in polygons)


def triangle_polygons(points: NDArray[np.float64], triangles: NDArray[np.int32]) -> Polygons:
    """Return the corners of triangles, all in the sense of `cell_polygons`."""
    corners = points[triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turned = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    return tuple(triangle[:: -1 if flip else 1] for triangle, flip in zip(corners, turned, strict=True))
