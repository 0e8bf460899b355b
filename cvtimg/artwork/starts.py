"""Where the points of mosaics begin: near each other where the image changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.placement import place_in_picture

Floats = NDArray[np.float64]

#: Side of an equilateral triangle of area 1.
_TRIANGLE_SIDE = 2 / 3**0.25


def detail_density(bands: NDArray[np.float32], n_tiles: int, uniform: float) -> NDArray[np.float32]:
    """Compute the squared gradient of an image, in units of its mean, with a share that is uniform.

    Parameters
    ----------
    bands : (H, W, C) float32 array
        The image.
    n_tiles : int
        How many tiles it shall have: the density is smoothed over a quarter of their size.
    uniform : float
        What is added everywhere.

    Returns
    -------
    (H, W) float32 array
        Above 0.
    """
    from scipy.ndimage import gaussian_filter

    density = np.zeros(bands.shape[:2], np.float32)
    for band in range(bands.shape[2]):
        smooth = gaussian_filter(bands[:, :, band], 1.0, mode="nearest")
        for axis in (0, 1):
            if smooth.shape[axis] > 1:
                density += np.gradient(smooth, axis=axis) ** 2
    mean = float(density.mean(dtype=np.float64))
    if mean > 0:
        density /= np.float32(mean)
    width = 0.25 * np.sqrt(density.size / n_tiles)
    smooth = gaussian_filter(density, width, mode="nearest")
    detail: NDArray[np.float32] = np.maximum(smooth, 0) + np.float32(uniform)
    return detail


def place_corners(density: NDArray[np.float32], n_triangles: int) -> Floats:
    """Place points whose Delaunay triangulation has `n_triangles` triangles, which fill the picture.

    The corners of the picture and some points of its sides are among them: of V points, B of them on the sides,
    2 V - 2 - B triangles come.
    """
    height, width = density.shape
    side = _TRIANGLE_SIDE * np.sqrt(height * width / n_triangles)
    n_border = int(np.clip(round(2 * (height + width) / side), 4, n_triangles + 2))
    n_border += (n_border - n_triangles) % 2
    n_inner = (n_triangles + 2 - n_border) // 2
    border = _border_points(density, n_border - 4)
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float64)
    inner = place_in_picture(density, n_inner, effort="fast").points if n_inner else np.empty((0, 2))
    return np.concatenate([corners, border, inner])


def _border_points(density: NDArray[np.float32], n_points: int) -> Floats:
    """Place points around the picture, between its corners, by the root of the density there."""
    height, width = density.shape
    rim = np.concatenate([density[0], density[:, -1], density[-1, ::-1], density[::-1, 0]])
    sums = np.append(0, np.cumsum(np.sqrt(rim, dtype=np.float64)))
    at = np.interp((np.arange(n_points) + 0.5) / max(n_points, 1) * sums[-1], sums, np.arange(len(rim) + 1))
    ends = np.cumsum([0, width, height, width, height])
    which = np.minimum(np.searchsorted(ends, at, side="right") - 1, 3)
    # One that falls on a corner goes half a pixel along.
    along = np.clip(at - ends[which], 0.25, np.diff(ends)[which] - 0.25)
    x = np.choose(which, [along, np.full_like(along, width), width - along, np.zeros_like(along)])
    y = np.choose(which, [np.zeros_like(along), along, np.full_like(along, height), height - along])
    return np.stack([x, y], axis=1)
