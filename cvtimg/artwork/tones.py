"""From the samples of an image to the share of the paper that ink must cover.

Eyes average light, so coverage is computed in linear light: ink that covers a share t of white paper leaves 1 - t of
its light. Paper is whatever is white, transparent or masked.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_channels, check_image, check_within
from cvtimg._shared.pixels import array_of, peak
from cvtimg.colors.spaces import to_space

Floats32 = NDArray[np.float32]

#: Luminance of linear sRGB, Rec. ITU-R BT.709.
_LUMINANCE = (0.2126, 0.7152, 0.0722)
#: Coverage of a hexagonal lattice of disks that touch: beyond it they overlap.
TOUCHING = np.pi / np.sqrt(12)
#: Summed area of the disks of a hexagonal lattice, per area, that leaves no paper between them.
COVERING = 2 * np.pi / np.sqrt(27)
_TABLE_SIZE = 4096


def linear_light(image: Any) -> tuple[Floats32, Floats32 | None]:
    """Decode an image to linear light.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Gray or sRGB, with alpha or without: C in 1..4. Integers have white at 255, or at 65535 if they are 16-bit or
        do not fit into 8 bits; floating point is in 0..1. Masked values are paper.

    Returns
    -------
    light : (H, W, 1) or (H, W, 3) float32 array
        In 0..1.
    opacity : (H, W) float32 array or None
        In 0..1; None if nothing is transparent or masked.
    """
    mask = np.ma.getmask(image)
    samples = _as_samples(image)
    n_channels = samples.shape[2]
    check_channels("image", n_channels, (1, 2, 3, 4), "gray or RGB, perhaps with alpha")
    n_colors = n_channels - (n_channels in (2, 4))
    light = np.empty((*samples.shape[:2], n_colors), np.float32)
    if samples.dtype.kind == "u":
        levels = np.arange(int(peak(samples.dtype)) + 1, dtype=samples.dtype)
        table = to_space(levels[:, np.newaxis], "linear")[:, 0].astype(np.float32)
        for channel in range(n_colors):
            np.take(table, samples[:, :, channel], out=light[:, :, channel])
    else:
        for row, decoded in zip(samples, light, strict=True):  # by rows, for the sake of memory
            decoded[:, :] = to_space(np.ascontiguousarray(row[:, :n_colors]).reshape(-1, 1), "linear").reshape(
                decoded.shape
            )
    opacity: Floats32 | None = None
    if n_colors < n_channels:
        opacity = (samples[:, :, -1] / peak(samples.dtype)).astype(np.float32)
    if mask is not np.ma.nomask:
        known = (~(mask if mask.ndim == 2 else mask.any(axis=2))).astype(np.float32)
        opacity = known if opacity is None else opacity * known
    return light, opacity


def _as_samples(image: Any) -> NDArray[Any]:
    """Return (H, W, C) samples of uint8, uint16, or floating point in 0..1."""
    plain = np.ma.filled(image, 0) if np.ma.isMaskedArray(image) else image
    samples = check_image("image", plain if hasattr(plain, "mode") else _narrowed(array_of(plain)))
    if samples.dtype.kind == "f":
        check_within("image", samples, 0, 1, ", as floating point samples")
    return samples.reshape(*samples.shape[:2], -1)


def _narrowed(array: NDArray[Any]) -> NDArray[Any]:
    """Bring booleans and integers to 8 or 16 bits, in the byte order of the machine."""
    kind, n_bytes = array.dtype.kind, array.dtype.itemsize
    if kind == "b":
        return array * np.uint8(255)
    if kind in "iu" and array.size and (kind == "i" or n_bytes > 2):
        check_within("image", array, 0, 65535)
        return array.astype(np.uint8 if array.max() <= 255 else np.uint16)
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def luminance(light: Floats32) -> Floats32:
    """Add linear light up to luminance, (H, W)."""
    if light.shape[2] == 1:
        return np.ascontiguousarray(light[:, :, 0])
    total: Floats32 = light[:, :, 0] * np.float32(_LUMINANCE[0])
    for channel in (1, 2):
        total += light[:, :, channel] * np.float32(_LUMINANCE[channel])
    return np.minimum(total, 1, out=total)


def ink_coverage(image: Any, *, white_cutoff: float = 0.0, invert: bool = False) -> Floats32:
    """Compute the share of each pixel that black ink must cover.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Gray or sRGB, with alpha or without, as for `stipple`.
    white_cutoff : float
        Coverage, in 0..1, below which paper stays white.
    invert : bool
        Light ink on dark paper.

    Returns
    -------
    (H, W) float32 array
        In 0..1.

    Examples
    --------
    Middle gray, 188 of 255, has half the light of white.

    >>> import numpy as np
    >>> ink_coverage(np.array([[255, 188, 0]], np.uint8)).round(2).tolist()
    [[0.0, 0.5, 1.0]]
    """
    light, opacity = linear_light(image)
    ink = luminance(light)
    if not invert:
        np.subtract(1, ink, out=ink)
    return as_coverage(ink, opacity, white_cutoff)


def as_coverage(ink: Floats32, opacity: Floats32 | None, white_cutoff: float) -> Floats32:
    """Leave paper free where the image is transparent, and where there is next to no ink; overwrites `ink`."""
    if opacity is not None:
        ink *= opacity
    # Rounding leaves a little of the white of three channels.
    ink[ink <= max(white_cutoff, 1e-6)] = 0
    return ink


def _lattice_coverage(disk_area: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute what disks of this summed area, per area of a hexagonal lattice, cover."""
    radius = np.sqrt(disk_area * np.sqrt(3) / (2 * np.pi))  # in distances of the lattice
    wide = np.maximum(radius, 0.5)
    lens = 2 * wide**2 * np.arccos(0.5 / wide) - 0.5 * np.sqrt(4 * wide**2 - 1)
    covered: NDArray[np.float64] = disk_area - lens * (3 * 2 / np.sqrt(3))  # three lenses a disk
    return np.minimum(covered, 1)


def disk_area(coverage: Floats32) -> Floats32:
    """Compute the summed area of disks, per area, that covers this share of the paper where they overlap.

    Dots of a centroidal Voronoi tessellation lie nearly on a hexagonal lattice, whose disks overlap beyond a coverage
    of 0.907; at 1 their areas add up to 1.209.

    Parameters
    ----------
    coverage : float32 array
        In 0..1.

    Returns
    -------
    float32 array
        In 0..1.21, of the same shape.
    """
    areas = coverage.copy()
    dense = coverage > TOUCHING
    if dense.any():
        table = np.linspace(TOUCHING, COVERING, _TABLE_SIZE)
        areas[dense] = np.interp(coverage[dense], _lattice_coverage(table), table)
    return areas
