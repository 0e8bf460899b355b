"""Files of several pages: what `segment` does to each page, and to all of them together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.segmentation.result import Segmentation

__all__ = ["read_whole", "segment_pages"]


def read_whole(source: Path) -> NDArray[Any]:
    """Read an image; all pages of a file are stacked vertically, for uses in which only the pixels count."""
    import numpy as np

    from cvtimg import read_image
    from cvtimg.pictures import image_info, read_pages

    return np.concatenate(read_pages(source).images) if image_info(source).has_pages else read_image(source)


def _check_target(target: Path) -> None:
    from cvtimg.pictures.pages import PAGE_SUFFIXES

    if target.suffix.lower() not in PAGE_SUFFIXES:
        raise ValueError(f"has several pages: name an output that can hold them, -o FILE.tif, and not {target.name}")


def segment_pages(
    task: Task,
    stopwatch: Stopwatch,
    divide: Callable[[NDArray[Any], NDArray[np.bool_]], tuple[NDArray[Any], Segmentation]],
    known: Callable[[Sequence[NDArray[Any]]], list[NDArray[np.bool_]]],
    *,
    volume: bool,
    overwrite: bool,
) -> Row:
    """Segment each page by itself, or with `volume` all pages by the same generators; labels become pages.

    `known` finds the pixels of the pages that count, and `divide` segments those of an image.
    """
    import numpy as np

    from cvtimg.pictures import read_pages, write_pages

    _check_target(task.output)
    pages = read_pages(task.source)
    images, inside = list(pages.images), known(pages.images)
    stopwatch.lap("read")
    if volume:
        images, inside = [np.concatenate(images)], [np.concatenate(inside)]
    results = [divide(image, own)[1] for image, own in zip(images, inside, strict=True)]
    labels = np.concatenate([result.labels for result in results]).reshape(
        len(pages.images), *pages.images[0].shape[:2]
    )
    stopwatch.lap("cluster")
    dtype = np.dtype(next(name for name in ("u1", "u2", "u4") if labels.max() <= np.iinfo(name).max))
    stored = replace(pages, images=tuple(labels.astype(dtype)), has_alpha=False)
    write_pages(task.output, stored, overwrite=overwrite)
    stopwatch.lap("write")
    image = pages.images[0]
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "channels": image.shape[2] if image.ndim == 3 else 1,
        "pages": len(pages.images),
        "left_out": int((labels == 0).sum()),
        "k": max(result.n_segments for result in results),
        "elbow": None,
        "edge_weight": results[0].edge_weight,
        "energy": sum(result.energy for result in results),
        "n_iter": max(len(result.energies) - 1 for result in results),
        "converged": all(result.converged for result in results),
    }
