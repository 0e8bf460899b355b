"""Pixels that count: not those that ``--mask`` or ``--nodata`` leave out, nor those without a value."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.pictures.files import ImageInfo

__all__ = ["known_pixels"]


def known_pixels(image: NDArray[Any], header: ImageInfo, mask: Path | None, nodata: float | None) -> NDArray[np.bool_]:
    """Find the pixels that are finite, not nodata, and not black in a mask; alpha plays no part.

    `nodata` is the value in all bands of pixels without data; by default what the header of the file says.
    """
    import numpy as np

    bands = image.reshape(*image.shape[:2], -1)
    if header.has_alpha and bands.shape[2] == 4:
        bands = bands[:, :, :3]
    known = np.ones(bands.shape[:2], np.bool_)
    if bands.dtype.kind == "f":
        known &= np.isfinite(bands).all(axis=2)
    missing = header.nodata if nodata is None else nodata
    if missing is not None:
        known &= (bands != missing).any(axis=2)
    return known if mask is None else known & _read_mask(mask, known.shape)


def _read_mask(path: Path, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Read a mask: the pixels that are not black."""
    from cvtimg import read_image

    picture = read_image(path)
    if picture.shape[:2] != shape:
        height, width = picture.shape[:2]
        raise ValueError(f"has {shape[1]} x {shape[0]} pixels, but the mask {path} has {width} x {height}")
    kept: NDArray[np.bool_] = picture.reshape(*shape, -1)[:, :, :3].max(axis=2) > 0
    return kept
