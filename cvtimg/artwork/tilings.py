"""Tilings of a picture by its points: Voronoi cells and Delaunay triangles, and the descent of their error.

The error of a mosaic is the integral over each tile of the squared distance between the image and the mean color of
the tile. Its gradient lives on the borders: moving a border gives the pixels that it passes over to the other tile.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.sums import sum_by_label
from cvtimg.artwork import _mosaics
from cvtimg.artwork.painting import Painted, by_rows, paint
from cvtimg.artwork.relocation import relocate
from cvtimg.placement import pixel_labels

Floats = NDArray[np.float64]

#: Of the last steps, how much counts in the direction and in the length of the next; and the length of a first step,
#: in sides of a tile.
_MOMENTUM, _SCALE_MEMORY, _STEP = 0.8, 0.95, 0.25
#: Steps between relocations, at least and as a part of all, for cells that are moved need steps to settle; and the part
#: of the descent in which they happen.
_RELOCATE_EVERY, _RELOCATE_SHARE, _RELOCATE_UNTIL = 8, 0.05, 0.7


class Tiling(Protocol):
    """Tiles that follow from points."""

    def n_tiles(self) -> int:
        """Count the tiles."""

    def labels(self, points: Floats) -> NDArray[np.int32]:
        """Label pixels by their tile."""

    def gradient(self, image: NDArray[np.float32], points: Floats, painted: Painted) -> Floats:
        """Differentiate the error by the places of the points."""

    def spacing(self, painted: Painted, n_points: int) -> Floats:
        """Tell the size of tiles at each point, in pixels."""

    def keep_inside(self, points: Floats) -> Floats:
        """Bring points back to where they may be."""

    def relocate(self, image: NDArray[np.float32], points: Floats, painted: Painted) -> tuple[Floats, NDArray[np.intp]]:
        """Move points from where they are missed least to where they are wanted most; tell which moved."""


class VoronoiTiling:
    """Voronoi cells: a tile for each point."""

    def __init__(self, shape: tuple[int, int], n_points: int) -> None:
        self._shape, self._n_points = shape, n_points

    def n_tiles(self) -> int:
        """Count the cells."""
        return self._n_points

    def labels(self, points: Floats) -> NDArray[np.int32]:
        """Label pixels by the point that is nearest to their center."""
        return pixel_labels(self._shape, points)

    def gradient(self, image: NDArray[np.float32], points: Floats, painted: Painted) -> Floats:
        """Differentiate along the borders of cells."""

        def add(first: int, stop: int, sums: Floats) -> None:
            _mosaics.add_border_gradient(image, painted.labels, points, painted.colors, first, stop, sums)

        return by_rows(add, self._shape, points.shape)

    def spacing(self, painted: Painted, n_points: int) -> Floats:
        """Tell the side of each cell if it were a square."""
        return np.sqrt(painted.areas)

    def keep_inside(self, points: Floats) -> Floats:
        """Keep points in the picture."""
        return np.clip(points, 0, self._shape[::-1])

    def relocate(self, image: NDArray[np.float32], points: Floats, painted: Painted) -> tuple[Floats, NDArray[np.intp]]:
        """Divide cells that gain by it with points whose cells are hardly missed."""
        return relocate(image, points, painted)


class DelaunayTiling:
    """Delaunay triangles of points that have the corners of the picture among them.

    Points that begin on a side of the picture stay on it, so that triangles always fill the picture.
    """

    def __init__(self, shape: tuple[int, int], points: Floats) -> None:
        self._shape = shape
        size = np.array(shape[::-1], np.float64)
        self._low, self._high = points == 0, points == size
        self._size = size
        self.triangles: NDArray[np.int32] = np.empty((0, 3), np.int32)

    def n_tiles(self) -> int:
        """Count the triangles of the last labels."""
        return len(self.triangles)

    def labels(self, points: Floats) -> NDArray[np.int32]:
        """Triangulate the points anew, and label pixels by the triangle that their center is in."""
        from scipy.spatial import Delaunay

        self._mesh = Delaunay(points)
        self.triangles = np.ascontiguousarray(self._mesh.simplices, np.int32)
        labels = np.zeros(self._shape, np.int32)
        _mosaics.label_triangles(points, self.triangles, labels)
        return labels

    def gradient(self, image: NDArray[np.float32], points: Floats, painted: Painted) -> Floats:
        """Differentiate along the edges of triangles."""
        gradient = np.zeros_like(points)
        _mosaics.add_edge_gradient(image, points, self._edges(points), painted.colors, gradient)
        return gradient

    def _edges(self, points: Floats) -> NDArray[np.int32]:
        """List each inner edge once: its ends, and the triangles to its right and left, with y down."""
        beside = self._mesh.neighbors
        triangle, corner = np.nonzero(beside > np.arange(len(beside))[:, np.newaxis])
        a, b = (self.triangles[triangle, (corner + turn) % 3] for turn in (1, 2))
        inner = points[self.triangles[triangle, corner]] - points[a]
        run = points[b] - points[a]
        to_the_right = run[:, 0] * inner[:, 1] > run[:, 1] * inner[:, 0]
        other = beside[triangle, corner]
        right, left = np.where(to_the_right, [triangle, other], [other, triangle])
        return np.ascontiguousarray(np.stack([a, b, right, left], axis=1), np.int32)

    def spacing(self, painted: Painted, n_points: int) -> Floats:
        """Tell the side of a square of the mean area of the triangles around each point."""
        corners = self.triangles.ravel()
        areas = sum_by_label(corners, np.repeat(painted.areas, 3), n_points)
        return np.sqrt(areas / np.maximum(np.bincount(corners, minlength=n_points), 1))

    def keep_inside(self, points: Floats) -> Floats:
        """Keep points of the sides on them, and others in the picture."""
        inside = np.clip(points, 1e-3, self._size - 1e-3)
        return np.where(self._low, 0, np.where(self._high, self._size, inside))

    def relocate(self, image: NDArray[np.float32], points: Floats, painted: Painted) -> tuple[Floats, NDArray[np.intp]]:
        """Leave all points: several triangles share each corner, so none can move by itself."""
        return points, np.empty(0, np.intp)


def descend_error(
    tiling: Tiling, image: NDArray[np.float32], points: Floats, n_steps: int, on_step: Callable[[int, float], None]
) -> tuple[Floats, list[float]]:
    """Move points so that the error of the mosaic falls; return the best places and the error before each step.

    Each point steps by a share of the size of its tiles, in the direction of its smoothed gradient; steps shrink to
    nothing (Adam, of one scale for both coordinates). A step may raise the error: the places with the least are kept.

    References
    ----------
    D. P. Kingma, J. Ba, Adam: A method for stochastic optimization, ICLR 2015, arXiv:1412.6980.
    """
    direction, scale = np.zeros_like(points), np.zeros((len(points), 1))
    best, least, energies = points, np.inf, []
    between = max(_RELOCATE_EVERY, round(_RELOCATE_SHARE * n_steps))
    for step in range(n_steps + 1):
        painted = paint(image, tiling.labels(points), tiling.n_tiles())
        energies.append(painted.energy)
        on_step(step, painted.energy)
        if painted.energy < least:
            best, least = points, painted.energy
        if step == n_steps or painted.energy == 0:
            break
        if step and step % between == 0 and step < _RELOCATE_UNTIL * n_steps:
            points, moved = tiling.relocate(image, points, painted)
            direction[moved] = scale[moved] = 0
            if len(moved):
                points = tiling.keep_inside(points)
                continue
        gradient = tiling.gradient(image, points, painted)
        direction = _MOMENTUM * direction + (1 - _MOMENTUM) * gradient
        scale = _SCALE_MEMORY * scale + (1 - _SCALE_MEMORY) * (gradient**2).sum(axis=1, keepdims=True)
        mean = direction / (1 - _MOMENTUM ** (step + 1))
        spread = np.sqrt(scale / (1 - _SCALE_MEMORY ** (step + 1)))
        length = _STEP * (1 - step / n_steps) * tiling.spacing(painted, len(points))[:, np.newaxis]
        steps = length * np.divide(mean, spread, out=np.zeros_like(mean), where=spread > 0)
        points = tiling.keep_inside(points - steps)
    return best, energies
