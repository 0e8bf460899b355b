"""Dots drawn as pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.artwork._dots import cover_rows

#: Parts of a pixel, each way, by which its coverage is measured.
_FINE = 8


def draw_dots(
    points: NDArray[np.float64], radii: NDArray[np.float64], shape: tuple[int, int], scale: float = 1.0
) -> NDArray[np.float32]:
    """Compute the share of each pixel that dots cover; where dots overlap they cover once.

    Parameters
    ----------
    points : (N, 2) array
        Centers (x, y) in pixels; the first pixel covers [0, 1] x [0, 1].
    radii : (N,) array
        In the same unit.
    shape : (int, int)
        Height and width of what the points lie in.
    scale : float
        Pixels of the drawing per pixel.

    Returns
    -------
    (round(H scale), round(W scale)) float32 array
        In 0..1, in steps of 1/64.

    Examples
    --------
    >>> import numpy as np
    >>> draw_dots(np.array([[1.0, 1.0]]), np.array([1.0]), (2, 2)).tolist()
    [[0.8125, 0.8125], [0.8125, 0.8125]]
    """
    height, width = (max(round(side * scale), 1) for side in shape)
    centers, sizes = (np.ascontiguousarray(array * scale, np.float64) for array in (points, radii))
    starts, disks = _disks_of_rows(centers[:, 1], sizes, height)
    coverage = np.empty((height, width), np.float32)

    def part(first: int, stop: int) -> None:
        raster = np.empty((_FINE, _FINE * width), np.uint8)
        cover_rows(centers, sizes, starts, disks, first, stop, raster, coverage)

    in_parts(part, height, float(height * width * _FINE))
    return coverage


def _disks_of_rows(
    y: NDArray[np.float64], radii: NDArray[np.float64], height: int
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """List the disks that meet each row of pixels: where each row begins, and their numbers."""
    first = np.clip(np.floor(y - radii), 0, height).astype(np.int64)
    stop = np.clip(np.ceil(y + radii), 0, height).astype(np.int64)
    n_rows = np.maximum(stop - first, 0)
    disks = np.repeat(np.arange(len(y), dtype=np.int32), n_rows)
    rows = np.arange(len(disks)) - np.repeat(np.cumsum(n_rows) - n_rows, n_rows) + np.repeat(first, n_rows)
    starts = np.append(0, np.cumsum(np.bincount(rows, minlength=height)))
    return starts, disks[np.argsort(rows, kind="stable")]
