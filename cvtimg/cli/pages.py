"""Files of several pages: what `quantize` and `segment` do to each page, and to all of them together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task
from cvtimg.cli.animations import figures_of
from cvtimg.cli.known_pixels import known_in_all
from cvtimg.cli.quantize_options import QuantizeOptions

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.pictures import ImageInfo, Pages
    from cvtimg.quantization import QuantizedFrames
    from cvtimg.segmentation.result import Segmentation

__all__ = ["has_pages", "quantize_pages", "read_whole", "segment_pages"]


def has_pages(header: ImageInfo) -> bool:
    """Return whether a file has several pages; frames of an animation are none."""
    return header.format in ("TIFF", "FITS") and header.frames > 1


def read_whole(source: Path) -> NDArray[Any]:
    """Read an image; all pages of a file are stacked vertically, for uses in which only the pixels count."""
    import numpy as np

    from cvtimg import read_image
    from cvtimg.pictures import image_info, read_pages

    return np.concatenate(read_pages(source).images) if has_pages(image_info(source)) else read_image(source)


def _check_target(target: Path) -> None:
    from cvtimg.pictures.pages import PAGE_SUFFIXES

    if target.suffix.lower() not in PAGE_SUFFIXES:
        raise ValueError(f"has several pages: name an output that can hold them, -o FILE.tif, and not {target.name}")


def quantize_pages(
    task: Task, stopwatch: Stopwatch, header: ImageInfo, how: QuantizeOptions, *, overwrite: bool
) -> Row:
    """Quantize all pages with one palette, or each with its own."""
    import numpy as np

    from cvtimg import quantize_frames, write_palette
    from cvtimg.pictures import Frames, read_pages, write_pages

    _check_target(task.output)
    pages = read_pages(task.source)
    known = known_in_all(pages.images, header, how.mask, how.nodata, "page")
    stopwatch.lap("read")
    frames = Frames(pages.images, (0.0,) * len(pages.images), 1)
    given = {**how.search, **how.mapping, **how.colors_of(pages.images[0].dtype)}
    masks = None if all(one.all() for one in known) else known
    result = quantize_frames(frames, per_frame=how.per_frame, alpha=pages.has_alpha, masks=masks, **given)
    stopwatch.lap("cluster")
    first = result.results[0]
    stored, palette = _stored_pages(pages, result, keeps_nodata=how.nodata is None and header.nodata is not None)
    write_pages(task.output, stored, palette=palette, overwrite=overwrite)
    if "--save-palette" in task.outputs:
        counts = sum(np.bincount(one.indices.ravel(), minlength=len(first.palette)) for one in result.results)
        write_palette(task.outputs["--save-palette"], first.palette, density=counts, overwrite=overwrite)
    stopwatch.lap("write")
    return {
        "width": pages.images[0].shape[1],
        "height": pages.images[0].shape[0],
        "channels": first.palette.shape[1],
        "pages": len(pages.images),
        **figures_of(result, known),
    }


def _stored_pages(
    pages: Pages, result: QuantizedFrames, *, keeps_nodata: bool
) -> tuple[Pages, NDArray[np.uint8] | None]:
    """Return pages as they are written: indices and their palette, or colors.

    Pixels that are left out become transparent, but in types without transparency, and where they are nodata.
    """
    import numpy as np

    first = result.results[0].palette
    left_out = any(one.inside is not None for one in result.results)
    eight_bit = first.dtype == np.uint8 and first.shape[1] in (1, 3)
    shared = all(np.array_equal(one.palette, first) for one in result.results)
    if shared and eight_bit and first.shape[1] == 3 and len(first) <= 256 and not left_out:
        return replace(pages, images=tuple(one.indices for one in result.results), has_alpha=False), first
    if not left_out or keeps_nodata or not eight_bit:
        return replace(pages, images=tuple(one.image for one in result.results)), None
    images = []
    for one in result.results:
        inside = np.ones(one.indices.shape, np.bool_) if one.inside is None else one.inside
        colors = np.broadcast_to(one.palette, (len(one.palette), 3))[one.indices]
        images.append(np.concatenate([colors * inside[..., None], inside[..., None] * np.uint8(255)], axis=2))
    return replace(pages, images=tuple(images), has_alpha=True), None


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
