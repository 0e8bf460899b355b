"""Divide the images of a file into segments: a picture, or pages by themselves or as one volume.

What is larger than memory is divided in strips, by `cvtimg.segmentation.segment_file`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.labels.components import connected_pieces
from cvtimg.labels.tracking import track_labels
from cvtimg.pictures.files import ImageInfo
from cvtimg.pictures.pages import Pages
from cvtimg.pictures.stacks import Stack
from cvtimg.segmentation.editing import edit_labels
from cvtimg.segmentation.hierarchy.building import segment_hierarchy
from cvtimg.segmentation.result import Segmentation, measured

#: `segment` and its siblings with their options: takes an image, and its pixels that count as `mask`.
Divide = Callable[..., Segmentation]
_Part = tuple[NDArray[Any], NDArray[np.bool_]]


@dataclass(frozen=True, slots=True, eq=False)
class DividedStack:
    """A file divided into segments."""

    header: ImageInfo
    pages: Pages | None  # None for a picture
    images: tuple[NDArray[Any], ...]  # the picture, or the pages, without alpha
    results: tuple[Segmentation, ...]  # of each page, or of each volume; their labels are parts of those below
    labels: NDArray[np.int32]  # (P, H, W), of the pages

    def summary(self) -> dict[str, Any]:
        """Return what a table says of all results, by column."""
        each = [result.summary() for result in self.results]
        together = {"k": sum if self.results[0].counting else max, "energy": sum, "n_iter": max, "converged": all}
        found = each[0] | {name: join(one[name] for one in each) for name, join in together.items()}
        found["elbow"] = None if self.pages else found["elbow"]
        regions = sum(int(connected_pieces(page).max()) for page in self.labels)
        sides = sum(int(np.count_nonzero(np.diff(self.labels, axis=axis))) for axis in (1, 2))
        return {"left_out": int((self.labels == 0).sum()), **found, "regions": regions, "edge_length": sides}


def by_tree(
    image: NDArray[Any], n_regions: int | None = None, threshold: float | None = None, **options: Any
) -> Segmentation:
    """Cut the tree of an image into regions, and measure these on the image itself."""
    tree = segment_hierarchy(image, **options)
    return measured(tree.cut(n_regions, threshold=threshold), image, hierarchy=tree)


def divide_stack(
    stack: Stack,
    divide: Divide,
    *,
    together: bool = False,
    volumes: bool = False,
    track: bool = False,
    apart: int = 0,
    edits: Sequence[str] = (),
) -> DividedStack:
    """Divide each image of a file, all pages `together` by the same generators, or the `volumes` of its frames."""
    # Together, pages are one image with so many rows `apart` that they are not near each other. With `track`, labels
    # keep their number from frame to frame.
    assert stack.header is not None  # in tiles, there is none
    parts = [_without_alpha(image, known, stack.header) for image, known in stack]
    pages = stack.content if stack.kind == "pages" and len(parts) > 1 else None
    if track:
        _check_frames(pages, volumes)
    if volumes and pages is None:
        raise ValueError("is one image, and a volume has several planes")
    if volumes:
        each = _volumes(parts, pages, divide)
    elif together and pages:
        each = iter([_together(parts, divide, apart)])
    else:
        each = (_edited(image, known, divide, edits) for image, known in parts)
    labels, results, at = np.empty((len(parts), *parts[0][0].shape[:2]), np.int32), [], 0
    for result in each:
        own = labels[at : at + result.labels.size // labels[0].size]
        own[:] = result.labels.reshape(own.shape)
        at += len(own)
        results.append(replace(result, labels=own))
    if track:
        frames = labels.reshape(pages.shape[0] if pages else 1, -1, *labels.shape[1:])
        labels = track_labels(frames).reshape(labels.shape)
    return DividedStack(stack.header, pages, tuple(image for image, _ in parts), tuple(results), labels)


def _edited(image: NDArray[Any], known: NDArray[np.bool_], divide: Divide, edits: Sequence[str]) -> Segmentation:
    """Divide an image, and change its labels by hand."""
    if not known.any():
        raise ValueError("has no pixel that counts: all are transparent, without data or left out by the mask")
    result = divide(image, mask=known)
    if not edits:
        return result
    tree = result.hierarchy or partial(segment_hierarchy, image, mask=known)
    return measured(edit_labels(result.labels, edits, hierarchy=tree), image, hierarchy=result.hierarchy)


def _check_frames(pages: Pages | None, in_volumes: bool) -> None:
    """Refuse stacks without frames to track objects along."""
    axes = pages.axes if pages else ""
    if not axes.startswith("T"):
        raise ValueError(f"has the axes {axes}YX, without T to track objects along; --axes names them")
    if axes != "T" and not in_volumes:
        raise ValueError(f"has the axes {axes}YX: objects are tracked with --volume, or in one plane, --z N")


def _together(parts: Sequence[_Part], divide: Divide, apart: int) -> Segmentation:
    """Divide pages as one image, in which rows that do not count are between them."""
    images, known = (
        np.concatenate([np.pad(page, ((0, apart), *[(0, 0)] * (page.ndim - 1))) for page in pages])
        for pages in zip(*parts, strict=True)
    )
    found = _edited(images, known, divide, ())
    rows = found.labels.reshape(len(parts), -1, found.labels.shape[1])[:, : len(parts[0][0])]
    return replace(found, labels=rows)


def _volumes(parts: Sequence[_Part], pages: Pages | None, divide: Divide) -> Iterator[Segmentation]:
    """Divide the volume of each frame of a stack."""
    assert pages is not None
    size = pages.pixel_size
    if size is None or size.z is None:
        said = f", of which only {size} is known" if size else ""
        raise ValueError(f"needs the size of voxels{said}; name it by --pixel-size, such as 0.3x0.3x2um")
    if pages.axes not in ("Z", "TZ", "Q"):
        raise ValueError(f"has the axes {pages.axes}YX, where (T)ZYX is expected; --axes names them")
    for start in range(0, len(parts), pages.shape[-1]):
        images, known = zip(*parts[start : start + pages.shape[-1]], strict=True)
        yield divide(np.stack(images), mask=np.stack(known), spacing=(size.z, size.y, size.x))


def _without_alpha(image: NDArray[Any], known: NDArray[np.bool_], header: ImageInfo) -> _Part:
    """Return the bands that count, and the pixels that count and can be seen."""
    if header.has_alpha and image.shape[2:] == (4,):
        return image[:, :, :3], known & (image[:, :, 3] > 0)
    return image, known
