"""One stack of images, whatever the file holds: a picture, the frames of an animation, pages, or a large image."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from cvtimg._shared.checks import check_that
from cvtimg._shared.choices import Arguments
from cvtimg._shared.pixels import is_known, not_black
from cvtimg._shared.types import Array, Bools
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import image_info, read_image, write_image
from cvtimg.pictures.formats.header import ImageInfo
from cvtimg.pictures.formats.metadata import Metadata
from cvtimg.pictures.formats.opening import Selection, pixels_limited, selected, selecting
from cvtimg.pictures.frames import is_animated, read_frames, write_frames
from cvtimg.pictures.pages import read_pages, write_pages
from cvtimg.pictures.tiles import TILED_SUFFIXES, Band, Bands, open_bands, write_bands

#: What a file holds, or that it is read in tiles: some rows at a time.
Kind: TypeAlias = Literal["image", "frames", "pages", "tiles"]


@dataclass(frozen=True, slots=True, eq=False)
class Stack:
    """The images of a file, and which of their pixels count.

    Attributes
    ----------
    kind : {"image", "frames", "pages", "tiles"}
        What the file holds. In tiles, the images are bands of rows, which each iteration reads.
    content : array, Frames, Pages or Bands
        What was read. Channels on pages of their own are joined.
    header : ImageInfo or None
        None in tiles.
    nodata : float or None
        Value of pixels that do not count.
    mask : path or None
        Image whose black pixels do not count.
    known : list of (H, W) bool arrays
        Pixels that count, for each image; in tiles none is kept.
    """

    kind: Kind
    content: Any
    header: ImageInfo | None
    nodata: float | None = None
    mask: StrPath | None = None
    known: Sequence[Bools] = ()

    @property
    def images(self) -> Iterable[Array]:
        """The images, or bands of rows."""
        single = (self.content,) if self.kind == "image" else None
        images: Iterable[Array] = single or (self.content if self.kind == "tiles" else self.content.images)
        return images

    @property
    def masks(self) -> list[Bools] | None:
        """The pixels that count, or None if all do."""
        return None if all(mask.all() for mask in self.known) else [*self.known]

    def __iter__(self) -> Iterator[tuple[Array, Bools]]:
        """Yield each image, or band of rows, with its pixels that count."""
        if self.kind != "tiles":
            yield from zip(self.images, self.known, strict=True)
            return
        form = self.content.form
        rows = None if self.mask is None else chain.from_iterable(_mask_bands(self.mask, form.shape[:2]))
        for band in self.content:
            known = not_missing(band, self.nodata, has_alpha=form.alpha)
            if rows is not None:
                known &= np.stack(list(islice(rows, len(band))))
            yield band, known

    def write(
        self,
        path: StrPath,
        images: Iterable[Array],
        *,
        palette: Any = None,
        alpha: bool | None = None,
        nodata: float | None = None,
        metadata: Metadata | None = None,
        optimize: bool = False,
        smallest: bool = False,
        overwrite: bool = False,
    ) -> None:
        """Write as many images in the places of these, as files of the kind hold them.

        Parameters
        ----------
        path, palette, alpha, metadata, optimize, smallest, overwrite
            As in `write_image`, `write_frames`, `write_pages` or `write_bands`.
        images : iterable of arrays
            For a file in tiles, bands of rows from top to bottom, of any height.
        nodata : float, optional
            Value that marks pixels without data in tiles.
        """
        if self.kind == "frames":
            frames = replace(self.content, images=tuple(images))
            write_frames(path, frames, palettes=palette, metadata=metadata, overwrite=overwrite)
        elif self.kind == "pages":
            pages = replace(self.content, images=tuple(images), has_alpha=bool(alpha))
            write_pages(path, pages, palette=palette, overwrite=overwrite)
        elif self.kind == "tiles":
            first, *_ = start = [next(bands := iter(images))]
            form = self.content.form
            form = replace(form, shape=(*form.shape[:2], *first.shape[2:]), alpha=bool(alpha), nodata=nodata)
            write_bands(path, form, chain(start, bands), palette=palette, overwrite=overwrite)
        else:
            options: Arguments = {"palette": palette, "alpha": alpha, "metadata": metadata, "optimize": optimize}
            write_image(path, next(iter(images)), **options, smallest=smallest, overwrite=overwrite)


def open_stack(
    path: StrPath,
    mask: StrPath | None = None,
    nodata: float | None = None,
    *,
    tiles: bool = False,
    frames: bool = True,
    keep_profile: bool = False,
    max_pixels: int | None = None,
) -> Stack:
    """Open a file as a stack of images.

    Parameters
    ----------
    path : path
        Any file that `read_image`, `read_frames`, `read_pages` or `open_bands` reads.
    mask : path, optional
        Image of the same size, whose black pixels do not count. For several images it may have as many.
    nodata : float, optional
        Pixels with this value in all bands do not count, nor do those that are not finite; by default what the file
        declares.
    tiles : bool
        Read rows of tiles when they are needed.
    frames : bool
        Take all frames of an animation, and not the first alone.
    keep_profile : bool
        As in `read_image`.
    max_pixels : int, optional
        Refuse images of more pixels.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg.pictures import open_stack, write_pages
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_pages(f"{folder}/a.tif", np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    ...     stack = open_stack(f"{folder}/a.tif", nodata=0)
    >>> stack.kind, [int(known.sum()) for image, known in stack]
    ('pages', [19, 20, 20])
    """
    if tiles:
        bands: Bands = open_bands(path)
        if max_pixels is not None and bands.form.n_pixels > max_pixels:
            raise ValueError(f"has over {max_pixels} pixels, the limit of max_pixels")
        return Stack("tiles", bands, None, bands.form.nodata if nodata is None else nodata, mask)
    with pixels_limited(max_pixels):
        header = image_info(path)
        stack = Stack("image", None, header, header.nodata if nodata is None else nodata, mask)
        if header.kind == "frames" and frames:
            stack = replace(stack, kind="frames", content=read_frames(path))
        elif header.kind == "pages":
            stack = replace(stack, kind="pages", content=read_pages(path).joined())
        else:
            stack = replace(stack, content=read_image(path, keep_profile=keep_profile))
        noun = {"frames": "frame", "pages": "page"}.get(stack.kind, "")
        return replace(stack, known=known_in_all([*stack.images], header, mask, nodata, noun))


def not_missing(band: Band, nodata: float | None, *, has_alpha: bool = False) -> Bools:
    """(H, W) pixels of a band of rows that are finite, and not `nodata` in all bands but alpha."""
    colors = band.reshape(*band.shape[:2], -1)
    colors = colors[:, :, :-1] if has_alpha else colors
    return is_known(colors, nodata)


def _mask_bands(path: StrPath, shape: tuple[int, ...]) -> Iterator[Bools]:
    """Yield the pixels of a mask that are not black, some rows at a time, or all where it cannot be read in bands."""
    bands: Iterable[Band] = ()
    if Path(path).suffix.lower() in TILED_SUFFIXES:
        with suppress(OSError):
            bands = open_bands(path)
    if isinstance(bands, Bands):
        size = bands.form.shape[:2]
    else:
        bands = [whole := read_image(path)]
        size = whole.shape[:2]
    _check_mask_size(path, size, shape)
    return map(not_black, bands)


def _check_mask_size(path: StrPath, size: tuple[int, ...], shape: tuple[int, ...]) -> None:
    given, wanted = (f"{width} x {height} pixels" for height, width in (size, shape))
    check_that(f"the mask {path}", size == shape, f"have {wanted}, as the image, and has {given}")


def known_in_all(
    images: Sequence[Array], header: ImageInfo, mask: StrPath | None, nodata: float | None, noun: str = ""
) -> list[Bools]:
    """Find the pixels that are finite, not nodata and not black in a mask, which is for all images, or has as many.

    `nodata` is by default what the header of the file says. A page or frame, called by `noun`, in which none counts is
    a ValueError.
    """
    known_of_each, missing = [], header.nodata if nodata is None else nodata
    masks = [None] * len(images) if mask is None else _read_masks(mask, len(images))
    for number, (image, shown) in enumerate(zip(images, masks, strict=True), start=1):
        known = not_missing(image, missing, has_alpha=header.has_alpha and image.shape[2:] == (4,))
        if mask is not None and shown is not None:
            _check_mask_size(mask, shown.shape[:2], known.shape)
            known &= not_black(shown)
        if noun and not known.any():
            raise ValueError(f"{noun} {number} of {len(images)} has no pixel that counts: all are left out")
        known_of_each.append(known)
    return known_of_each


def _read_masks(path: StrPath, n: int) -> Sequence[Array]:
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


def read_whole(source: StrPath) -> Array:
    """Read an image; all pages of a file are stacked vertically, for uses in which only the pixels count."""
    return (
        np.concatenate(read_pages(source).joined().images) if image_info(source).kind == "pages" else read_image(source)
    )
