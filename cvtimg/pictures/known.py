"""Pixels of images on disk that count: those in a mask, with a finite value that does not mean missing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg._shared.pixels import is_known, not_black
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import ImageInfo, image_info, read_image
from cvtimg.pictures.formats.opening import Selection, selected, selecting
from cvtimg.pictures.frames import is_animated, read_frames
from cvtimg.pictures.pages import read_pages
from cvtimg.pictures.tiles import TILED_SUFFIXES, Band, Bands, open_bands

Known = NDArray[np.bool_]


def not_missing(band: Band, nodata: float | None, *, has_alpha: bool = False) -> Known:
    """(H, W) pixels of a band of rows that are finite, and not `nodata` in all bands but alpha."""
    colors = band.reshape(*band.shape[:2], -1)
    colors = colors[:, :, :-1] if has_alpha else colors
    return is_known(colors, nodata)


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


def known_pixels(image: NDArray[Any], header: ImageInfo, mask: StrPath | None, nodata: float | None) -> Known:
    """Find the pixels that are finite, not nodata, and not black in a mask; alpha plays no part.

    `nodata` is the value in all bands of pixels without data; by default what the header of the file says.
    """
    return _known(image, header, None if mask is None else _read_masks(mask, 1)[0], mask, nodata)


def known_in_all(
    images: Sequence[NDArray[Any]], header: ImageInfo, mask: StrPath | None, nodata: float | None, noun: str
) -> list[NDArray[np.bool_]]:
    """Find the pixels that count in each page or frame; a mask is for all of them, or has as many.

    A page or frame, called by `noun`, in which none counts is a ValueError.
    """
    masks = [None] * len(images) if mask is None else _read_masks(mask, len(images))
    found = []
    for number, (image, own) in enumerate(zip(images, masks, strict=True), start=1):
        known = _known(image, header, own, mask, nodata)
        if not known.any():
            raise ValueError(f"{noun} {number} of {len(images)} has no pixel that counts: all are left out")
        found.append(known)
    return found


def _known(
    image: NDArray[Any], header: ImageInfo, shown: NDArray[Any] | None, mask: StrPath | None, nodata: float | None
) -> NDArray[np.bool_]:
    missing = header.nodata if nodata is None else nodata
    known = not_missing(image, missing, has_alpha=header.has_alpha and image.shape[2:] == (4,))
    if shown is None or mask is None:
        return known
    check_mask_size(mask, shown.shape[:2], known.shape)
    return known & not_black(shown)


def _read_masks(path: StrPath, n: int) -> Sequence[NDArray[Any]]:
    """Read a mask for each of n images: its pages or frames, or its only one for all."""
    with selecting(Selection()):
        masks = read_frames(path).images if is_animated(path) else read_pages(path).images
    page = selected().page
    if page is not None and page <= len(masks):
        masks = masks[page - 1 : page]
    if len(masks) not in (1, n):
        wanted = "1" if n == 1 else f"1 or {n}"
        raise ValueError(f"needs a mask of {wanted} pages or frames, and {path} has {len(masks)}")
    return masks if len(masks) == n else list(masks) * n


def read_whole(source: StrPath) -> NDArray[Any]:
    """Read an image; all pages of a file are stacked vertically, for uses in which only the pixels count."""
    return np.concatenate(read_pages(source).joined().images) if image_info(source).has_pages else read_image(source)
