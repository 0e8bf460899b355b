"""Pixels of images on disk that count: those in a mask, with a finite value that does not mean missing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import chain, islice
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
    rows = None if mask is None else chain.from_iterable(mask_bands(mask, bands.form.shape[:2]))
    for band in bands:
        known = not_missing(band, nodata, has_alpha=has_alpha)
        if rows is not None:
            known &= np.stack(list(islice(rows, len(band))))
        yield band, known


def mask_bands(path: StrPath, shape: tuple[int, ...]) -> Iterator[Known]:
    """Yield the pixels of a mask that are not black, some rows at a time; it must have the size of the image.

    TIFF files and Zarr arrays are read in bands. A mask of another format, or a TIFF that cannot be read in bands, is
    read whole, and takes a byte per pixel.
    """
    bands: Iterable[Band] = ()
    if Path(path).suffix.lower() in TILED_SUFFIXES:
        with suppress(OSError):
            bands = open_bands(path)
    if isinstance(bands, Bands):
        size = bands.form.shape[:2]
    else:
        bands = [whole := read_image(path)]
        size = whole.shape[:2]
    check_mask_size(path, size, shape)
    return map(not_black, bands)


def check_mask_size(path: StrPath, size: tuple[int, ...], shape: tuple[int, ...]) -> None:
    """Raise ValueError if a mask, of (H, W) `size`, does not have the (H, W) `shape` of its image."""
    given, wanted = (f"{width} x {height} pixels" for height, width in (size, shape))
    check_that(f"the mask {path}", size == shape, f"have {wanted}, as the image, and has {given}")


def known_pixels(image: NDArray[Any], header: ImageInfo, mask: StrPath | None, nodata: float | None) -> Known:
    """Find the pixels that are finite, not nodata, and not black in a mask; alpha plays no part.

    `nodata` is the value in all bands of pixels without data; by default what the header of the file says.
    """
    return known_in_all([image], header, mask, nodata)[0]


def known_in_all(
    images: Sequence[NDArray[Any]], header: ImageInfo, mask: StrPath | None, nodata: float | None, noun: str = ""
) -> list[Known]:
    """Find the pixels that count in each page or frame; a mask is for all of them, or has as many.

    A page or frame, called by `noun`, in which none counts is a ValueError.
    """
    found, missing = [], header.nodata if nodata is None else nodata
    masks = [None] * len(images) if mask is None else _read_masks(mask, len(images))
    for number, (image, shown) in enumerate(zip(images, masks, strict=True), start=1):
        known = not_missing(image, missing, has_alpha=header.has_alpha and image.shape[2:] == (4,))
        if mask is not None and shown is not None:
            check_mask_size(mask, shown.shape[:2], known.shape)
            known &= not_black(shown)
        if noun and not known.any():
            raise ValueError(f"{noun} {number} of {len(images)} has no pixel that counts: all are left out")
        found.append(known)
    return found


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
