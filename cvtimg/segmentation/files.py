"""Divide a file into segments, in the way that suits it: a picture, or pages by themselves or as one volume.

What is larger than memory is divided in strips, by `cvtimg.segmentation.segment_file`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.files.whole import StrPath
from cvtimg.labels.files import write_labels
from cvtimg.pictures.files import ImageInfo, Metadata, image_info, read_image
from cvtimg.pictures.known import known_in_all, known_pixels
from cvtimg.pictures.pages import PAGE_SUFFIXES, Pages, read_pages, write_pages
from cvtimg.segmentation.result import Segmentation

#: Takes an image and its pixels that count; `segment` and its siblings with their options.
Divide = Callable[[NDArray[Any], NDArray[np.bool_]], Segmentation]


@dataclass(frozen=True, slots=True, eq=False)
class DividedFile:
    """A file divided into segments."""

    header: ImageInfo
    pages: Pages | None  # None for a picture
    image: NDArray[Any]  # the picture, or the first page, without alpha
    results: tuple[Segmentation, ...]  # of each page; one of all in a volume

    @property
    def labels(self) -> NDArray[np.int32]:
        """(H, W) labels of a picture, or (T, H, W) of pages."""
        found = np.concatenate([result.labels for result in self.results])
        return found if self.pages is None else found.reshape(-1, *self.image.shape[:2])

    def save(self, target: StrPath, metadata: Metadata | None = None, *, overwrite: bool = False) -> None:
        """Write the labels: those of pages as pages, with as few bits as hold them."""
        if self.pages is None:
            write_labels(target, self.labels, metadata=metadata, overwrite=overwrite)
            return
        dtype = np.dtype(next(name for name in ("u1", "u2", "u4") if self.labels.max() <= np.iinfo(name).max))
        stored = replace(self.pages, images=tuple(self.labels.astype(dtype)), has_alpha=False)
        write_pages(target, stored, overwrite=overwrite)


def divide_file(
    source: StrPath,
    divide: Divide,
    *,
    target: StrPath | None = None,
    mask: StrPath | None = None,
    nodata: float | None = None,
    volume: bool = False,
    on_stage: Callable[[str], None] = lambda stage: None,
) -> DividedFile:
    """Divide the picture of a file, or each of its pages, or with `volume` all pages by the same generators."""
    # Pixels without data, black in the image `mask`, or transparent have label 0. Of several pages only labels can be
    # written, to the `target`. `on_stage` is called with the name of each stage that is done.
    header = image_info(source)
    pages = read_pages(source).joined() if header.has_pages else None
    if pages is None or len(pages.images) == 1:
        image = read_image(source) if pages is None else pages.images[0]
        known = known_pixels(image, header, mask, nodata)
        on_stage("read")
        image, known = _without_alpha(image, known, header)
        result = divide(image, known)
        on_stage("cluster")
        return DividedFile(header, None, image, (result,))
    if target is None:
        raise ValueError("has several pages, of which only labels are written")
    if Path(target).suffix.lower() not in PAGE_SUFFIXES:
        name = Path(target).name
        raise ValueError(f"has several pages: name an output that can hold them, -o FILE.tif, and not {name}")
    images, inside = list(pages.images), known_in_all(pages.images, header, mask, nodata, "page")
    on_stage("read")
    if volume:
        images, inside = [np.concatenate(images)], [np.concatenate(inside)]
    parts = [_without_alpha(image, known, header) for image, known in zip(images, inside, strict=True)]
    results = tuple(divide(image, known) for image, known in parts)
    on_stage("cluster")
    return DividedFile(header, pages, pages.images[0], results)


def _without_alpha(
    image: NDArray[Any], known: NDArray[np.bool_], header: ImageInfo
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the bands that count, and the pixels that count and can be seen."""
    if header.has_alpha and image.shape[2:] == (4,):
        return image[:, :, :3], known & (image[:, :, 3] > 0)
    return image, known
