"""Divide a file into segments, in the way that suits it: a picture, or pages by themselves or as one volume.

What is larger than memory is divided in strips, by `cvtimg.segmentation.segment_file`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.files.whole import StrPath
from cvtimg.labels.tracking import track_labels
from cvtimg.pictures.files import ImageInfo, image_info, read_image
from cvtimg.pictures.known import known_in_all, known_pixels
from cvtimg.pictures.pages import Pages, read_pages
from cvtimg.segmentation.result import Segmentation

#: Takes an image and its pixels that count; `segment` and its siblings with their options.
Divide = Callable[[NDArray[Any], NDArray[np.bool_]], Segmentation]
#: Takes a volume, (Z, H, W) or (Z, H, W, C), its voxels that count, and their distances along Z, H and W.
DivideVolume = Callable[[NDArray[Any], NDArray[np.bool_], tuple[float, float, float]], Segmentation]


@dataclass(frozen=True, slots=True, eq=False)
class DividedFile:
    """A file divided into segments."""

    header: ImageInfo
    pages: Pages | None  # None for a picture
    images: tuple[NDArray[Any], ...]  # the picture, or the pages, without alpha
    results: tuple[Segmentation, ...]  # of each page, or of each volume; their labels are parts of those below
    labels: NDArray[np.int32]  # (P, H, W), of the pages

    @classmethod
    def of(
        cls, header: ImageInfo, pages: Pages | None, images: tuple[NDArray[Any], ...], each: Iterable[Segmentation]
    ) -> DividedFile:
        """Put the labels of all results together, as these come."""
        labels = np.empty((len(images), *images[0].shape[:2]), np.int32)
        rows, at, results = labels.reshape(-1, labels.shape[2]), 0, []
        for result in each:
            shape = result.labels.shape
            part = rows[at : at + result.labels.size // shape[-1]].reshape(shape)
            part[:] = result.labels
            at += part.size // shape[-1]
            results.append(replace(result, labels=part))
        return cls(header, pages, images, tuple(results), labels)

    def tracked(self) -> DividedFile:
        """Return labels that keep their number from frame to frame."""
        n_frames = self.pages.shape[0] if self.pages else 1
        frames = self.labels.reshape(n_frames, -1, *self.labels.shape[1:])
        return replace(self, labels=track_labels(frames).reshape(self.labels.shape))


def divide_file(
    source: StrPath,
    divide: Divide,
    *,
    mask: StrPath | None = None,
    nodata: float | None = None,
    volume: bool | DivideVolume = False,
    track: bool = False,
    apart: int = 0,
    on_pages: Callable[[int], None] = lambda n_pages: None,
    on_stage: Callable[[str], None] = lambda stage: None,
) -> DividedFile:
    """Divide the picture of a file, or each of its pages, or with `volume` all pages together."""
    # With `volume=True`, the same generators divide all pages, as if they were one image with so many rows between them
    # that pages are not near each other; a function gets the planes of
    # each frame as a volume. With `track`, labels keep their number from frame to frame. Pixels without data, black in
    # the image `mask`, or transparent have label 0. `on_pages` is called with the number of several pages
    # before any is divided, `on_stage` with the name of each stage that is done.
    header = image_info(source)
    pages = read_pages(source).joined() if header.has_pages else None
    if track:
        _check_frames(pages, in_volumes=callable(volume))
    if pages is None or len(pages.images) == 1:
        if callable(volume):
            raise ValueError("is one image, and a volume has several planes")
        image = read_image(source) if pages is None else pages.images[0]
        known = known_pixels(image, header, mask, nodata)
        on_stage("read")
        image, known = _without_alpha(image, known, header)
        result = divide(image, known)
        on_stage("cluster")
        return DividedFile.of(header, None, (image,), (result,))
    on_pages(len(pages.images))
    images, inside = list(pages.images), known_in_all(pages.images, header, mask, nodata, "page")
    on_stage("read")
    parts = [_without_alpha(image, known, header) for image, known in zip(images, inside, strict=True)]
    seen = tuple(image for image, _ in parts)
    if volume is True:
        each: Iterable[Segmentation] = (_divided_together(parts, divide, apart),)
    elif callable(volume):
        each = _divided_volumes(parts, pages, volume)
    else:
        each = (divide(*part) for part in parts)
    found = DividedFile.of(header, pages, seen, each)
    on_stage("cluster")
    return found.tracked() if track else found


def _check_frames(pages: Pages | None, *, in_volumes: bool) -> None:
    """Refuse stacks without frames to track objects along."""
    axes = pages.axes if pages and len(pages.images) > 1 else ""
    if not axes.startswith("T"):
        raise ValueError(f"has the axes {axes}YX, without T to track objects along; --axes names them")
    if axes != "T" and not in_volumes:
        raise ValueError(f"has the axes {axes}YX: objects are tracked with --volume, or in one plane, --z N")


def _divided_together(
    parts: Sequence[tuple[NDArray[Any], NDArray[np.bool_]]], divide: Divide, apart: int
) -> Segmentation:
    """Divide pages as one image, in which rows that do not count are between them."""
    height = len(parts[0][0])
    together = [
        np.concatenate([np.pad(page, ((0, apart), *[(0, 0)] * (page.ndim - 1))) for page in pages])
        for pages in zip(*parts, strict=True)
    ]
    found = divide(*together)
    rows = found.labels.reshape(len(parts), height + apart, -1)[:, :height]
    return replace(found, labels=rows.reshape(len(parts) * height, -1))


def _divided_volumes(
    parts: Sequence[tuple[NDArray[Any], NDArray[np.bool_]]], pages: Pages, divide: DivideVolume
) -> Iterator[Segmentation]:
    """Divide the volume of each frame of a stack."""
    size = pages.pixel_size
    if size is None or size.z is None:
        said = f", of which only {size} is known" if size else ""
        raise ValueError(f"needs the size of voxels{said}; name it by --pixel-size, such as 0.3x0.3x2um")
    if pages.axes not in ("Z", "TZ", "Q"):
        raise ValueError(f"has the axes {pages.axes}YX, where (T)ZYX is expected; --axes names them")
    n_planes = pages.shape[-1]
    for start in range(0, len(parts), n_planes):
        images, known = zip(*parts[start : start + n_planes], strict=True)
        yield divide(np.stack(images), np.stack(known), (size.z, size.y, size.x))


def _without_alpha(
    image: NDArray[Any], known: NDArray[np.bool_], header: ImageInfo
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the bands that count, and the pixels that count and can be seen."""
    if header.has_alpha and image.shape[2:] == (4,):
        return image[:, :, :3], known & (image[:, :, 3] > 0)
    return image, known
