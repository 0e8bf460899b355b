"""Pixels that count: not those that ``--mask`` or ``--nodata`` leave out, nor those without a value."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.pictures.files import ImageInfo

__all__ = ["known_in_all", "known_pixels"]


def known_pixels(image: NDArray[Any], header: ImageInfo, mask: Path | None, nodata: float | None) -> NDArray[np.bool_]:
    """Find the pixels that are finite, not nodata, and not black in a mask; alpha plays no part.

    `nodata` is the value in all bands of pixels without data; by default what the header of the file says.
    """
    return _known(image, header, None if mask is None else _read_masks(mask, 1)[0], mask, nodata)


def known_in_all(
    images: Sequence[NDArray[Any]], header: ImageInfo, mask: Path | None, nodata: float | None, noun: str
) -> list[NDArray[np.bool_]]:
    """Find the pixels that count in each page or frame; a mask is for all of them, or has as many.

    Raises
    ------
    ValueError
        If a page or frame, which the message calls by `noun`, has no pixel that counts.
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
    image: NDArray[Any], header: ImageInfo, shown: NDArray[Any] | None, mask: Path | None, nodata: float | None
) -> NDArray[np.bool_]:
    from cvtimg.pictures.known import check_mask_size, not_black, not_missing

    missing = header.nodata if nodata is None else nodata
    known = not_missing(image, missing, has_alpha=header.has_alpha and image.shape[2:] == (4,))
    if shown is None or mask is None:
        return known
    check_mask_size(mask, shown.shape[:2], known.shape)
    return known & not_black(shown)


def _read_masks(path: Path, n: int) -> Sequence[NDArray[Any]]:
    """Read a mask for each of n images: its pages or frames, or its only one for all."""
    from cvtimg.pictures import is_animated, read_frames, read_pages
    from cvtimg.pictures.formats.selection import Selection, selected, selecting

    with selecting(Selection()):
        masks = read_frames(path).images if is_animated(path) else read_pages(path).images
    page = selected().page
    if page is not None and 1 < page <= len(masks):
        masks = masks[page - 1 : page]
    if len(masks) not in (1, n):
        wanted = "1" if n == 1 else f"1 or {n}"
        raise ValueError(f"needs a mask of {wanted} pages or frames, and {path} has {len(masks)}")
    return masks if len(masks) == n else list(masks) * n
