"""Pixels of images on disk that count: those in a mask, with a finite value that does not mean missing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import read_image
from cvtimg.pictures.tiles import TILED_SUFFIXES, Band, Bands, open_bands

__all__ = ["check_mask_size", "mask_bands", "not_black", "not_missing", "with_known"]

Known = NDArray[np.bool_]


def not_missing(band: Band, nodata: float | None, *, has_alpha: bool = False) -> Known:
    """(H, W) pixels of a band of rows that are finite, and not `nodata` in all bands but alpha."""
    colors = band.reshape(*band.shape[:2], -1)
    colors = colors[:, :, :-1] if has_alpha else colors
    known = np.ones(colors.shape[:2], np.bool_)
    if colors.dtype.kind == "f":
        known &= np.isfinite(colors).all(axis=2)
    if nodata is not None:
        known &= (colors != nodata).any(axis=2)
    return known


def with_known(
    bands: Bands, mask: StrPath | None, nodata: float | None, *, has_alpha: bool = False
) -> Iterator[tuple[Band, Known]]:
    """Yield each band of an image with its (H, W) pixels that count: see `not_missing` and `mask_bands`."""
    rows = None if mask is None else mask_bands(mask, bands.form.shape[:2])
    left = np.empty((0, bands.form.shape[1]), np.bool_)
    for band in bands:
        known = not_missing(band, nodata, has_alpha=has_alpha)
        if rows is not None:
            own, left = _taken(rows, left, len(band))
            known &= own
        yield band, known


def mask_bands(path: StrPath, shape: tuple[int, ...]) -> Iterator[Known]:
    """Yield the pixels of a mask that are not black, some rows at a time; it must have the size of the image.

    TIFF files and Zarr arrays are read in bands. A mask of another format, or a TIFF that cannot be read in bands, is
    read whole, and takes a byte per pixel.
    """
    bands: Iterable[Band]
    size: tuple[int, ...]
    try:
        opened = open_bands(path) if Path(path).suffix.lower() in TILED_SUFFIXES else None
    except OSError:
        opened = None
    if opened is None:
        whole = read_image(path)
        bands, size = [whole], whole.shape[:2]
    else:
        bands, size = opened, opened.form.shape[:2]
    check_mask_size(path, size, shape)
    return map(not_black, bands)


def not_black(band: Band) -> Known:
    """(H, W) pixels of a mask, or of a band of its rows, that are not black; alpha plays no part."""
    return np.asarray(band.reshape(*band.shape[:2], -1)[:, :, :3].max(axis=2) > 0)


def check_mask_size(path: StrPath, size: tuple[int, ...], shape: tuple[int, ...]) -> None:
    """Raise ValueError if a mask, of (H, W) `size`, does not have the (H, W) `shape` of its image."""
    given, wanted = (f"{width} x {height} pixels" for height, width in (size, shape))
    check_that(f"the mask {path}", size == shape, f"have {wanted}, as the image, and has {given}")


def _taken(rows: Iterator[Known], left: Known, height: int) -> tuple[Known, Known]:
    """Take this many rows; return them, and what is left of the last band."""
    parts, n_rows = [left], len(left)
    while n_rows < height:
        parts.append(next(rows))
        n_rows += len(parts[-1])
    together = parts[0] if len(parts) == 1 else np.concatenate(parts)
    return together[:height], together[height:]
