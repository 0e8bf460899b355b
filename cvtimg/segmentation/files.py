"""Divide the images of a file into segments: a picture, or pages by themselves or as one volume.

What is larger than memory is divided in strips, by `cvtimg.segmentation.segment_file`.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cvtimg._shared.choices import Row
from cvtimg._shared.types import Array, Bools, Ints
from cvtimg.labels.components import track_labels
from cvtimg.labels.figures import region_table
from cvtimg.pictures.files import ImageInfo, image_info, read_metadata
from cvtimg.pictures.formats.geotiff import is_in_meters
from cvtimg.pictures.formats.opening import Source
from cvtimg.pictures.pages import Pages
from cvtimg.pictures.stacks import Stack
from cvtimg.segmentation.counting import at_edges
from cvtimg.segmentation.editing import edit_labels
from cvtimg.segmentation.hierarchy.building import segment_hierarchy
from cvtimg.segmentation.result import Segmentation, measured

#: `segment` and its siblings with their options: takes an image, and its pixels that count as `mask`.
Divide = Callable[..., Segmentation]
_Part = tuple[Array, Bools]


@dataclass(frozen=True, slots=True, eq=False)
class DividedStack:
    """A file divided into segments."""

    header: ImageInfo
    pages: Pages | None  # None for a picture
    images: tuple[Array, ...]  # the picture, or the pages, without alpha
    results: tuple[Segmentation, ...]  # of each page, or of each volume; their labels are parts of those below
    labels: Ints  # (P, H, W), of the pages

    def summary(self) -> Row:
        """Return what a table says of all results, by column."""
        each = [result.summary() for result in self.results]
        together = {"k": sum if self.results[0].counting else max, "energy": sum, "n_iter": max, "converged": all}
        columns = each[0] | {name: join(row[name] for row in each) for name, join in together.items()}
        columns["elbow"] = None if self.pages else columns["elbow"]
        regions = sum(result.n_regions for result in self.results)
        sides = sum(result.edge_length for result in self.results)
        return {"left_out": int((self.labels == 0).sum()), **columns, "regions": regions, "edge_length": sides}


def by_tree(image: Array, n_regions: int | None = None, threshold: float | None = None, **options: Any) -> Segmentation:
    """Cut the tree of an image into regions, and measure these on the image itself."""
    tree = segment_hierarchy(image, **options)
    return measured(tree.cut(n_regions, threshold=threshold), image, hierarchy=tree)


def file_table(
    source: Source,
    labels: Ints,
    image: Array,
    properties: Collection[str] = (),
    *,
    channels: Sequence[str] | None = None,
    objects: bool = False,
    info: ImageInfo | None = None,
) -> dict[str, Array]:
    """Measure every region of an image in the units of its file.

    Parameters
    ----------
    source : path
        The file of the image.
    labels, image, properties
        As in `cvtimg.labels.region_table`.
    channels : sequence of str, optional
        Names of the bands of the image; by default those of the file.
    objects : bool
        Whether label 0 is the background of objects.
    info : ImageInfo, optional
        The header of the file, if it is at hand.

    Returns
    -------
    dict of arrays
        As `cvtimg.labels.region_table`, with its columns in the unit of the file. Of a GeoTIFF, ``x_map`` and ``y_map``
        are the centroids on the map and, where these are meters, ``area_m2``. With `objects`, ``touches_edge`` is 1 for
        objects that an edge of the image may cut off.

    Examples
    --------
    >>> from cvtimg.pictures import encode_image
    >>> image = np.array([[0, 9, 0, 0]], np.uint8)
    >>> table = file_table(encode_image(".png", image), np.array([[0, 1, 0, 0]]), image)
    >>> table["area"].tolist()
    [1.0]
    """
    info = info or image_info(source)
    names = info.channels if channels is None else channels
    table = region_table(labels, image, properties, pixel_size=info.pixel_size, channels=names)
    if info.geo_transform:
        a, b, c, d, e, f = info.geo_transform
        x, y = table["x"], table["y"]
        if is_in_meters(read_metadata(source).geo):
            table["area_m2"] = table["area"] * abs(a * e - b * d)
        table |= {"x_map": a * x + b * y + c, "y_map": d * x + e * y + f}
    if objects:
        table["touches_edge"] = at_edges(labels)[table["label"]].astype(int)
    return table


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
    # Together, pages are a volume if the distance of planes is known, or one image with rows between them, which keep
    # them `apart`. With `track`, labels keep their number from frame to frame.
    assert stack.header is not None  # in tiles, there is none
    parts: list[_Part] = []
    for image, known in stack:
        has_alpha = stack.header.has_alpha and image.shape[2:] == (4,)  # what it hides does not count
        parts.append((image[:, :, :3], known & (image[:, :, 3] > 0)) if has_alpha else (image, known))
    pages = stack.content if stack.kind == "pages" and len(parts) > 1 else None
    axes = pages.axes if pages else ""
    if track and not axes.startswith("T"):
        raise ValueError(f"has the axes {axes}YX, without T to track objects along; --axes names them")
    if track and axes != "T" and not volumes:
        raise ValueError(f"has the axes {axes}YX: objects are tracked with --volume, or in one plane, --z N")
    # Pages that are divided at a time, as one image or volume.
    n_together = len(pages.images) if pages and together else 1
    spacing: dict[str, Any] = {}
    if volumes:
        spacing, n_together = {"spacing": _spacing(pages)}, pages.shape[-1] if pages else 1
    elif pages and together and axes in ("Z", "Q") and pages.pixel_size and pages.pixel_size.z:
        spacing = {"spacing": _spacing(pages)}
    labels, results = np.empty((len(parts), *parts[0][0].shape[:2]), np.int32), []
    for start in range(0, len(parts), n_together):
        some = parts[start : start + n_together]
        image, known = some[0] if n_together == 1 and not spacing else _stacked(some, None if spacing else apart)
        if not known.any():
            raise ValueError("has no pixel that counts: all are transparent, without data or left out by the mask")
        result = divide(image, mask=known, **spacing)
        if edits:
            tree = result.hierarchy or partial(segment_hierarchy, image, mask=known)
            result = measured(edit_labels(result.labels, edits, hierarchy=tree), image, hierarchy=result.hierarchy)
        planes = labels[start : start + n_together]
        planes[:] = result.labels.reshape(n_together, -1, planes.shape[2])[:, : planes.shape[1]]
        results.append(replace(result, labels=planes))
    if track:
        frames = labels.reshape(pages.shape[0] if pages else 1, -1, *labels.shape[1:])
        labels = track_labels(frames).reshape(labels.shape)
    return DividedStack(stack.header, pages, tuple(image for image, _ in parts), tuple(results), labels)


def _stacked(parts: Sequence[_Part], apart: int | None) -> _Part:
    """Return pages as a volume, or below each other with that number of rows between them, which do not count."""
    images, known = zip(*parts, strict=True)
    if apart is None:
        return np.stack(images), np.stack(known)
    gap = (0, apart), (0, 0)
    below = [np.pad(page, (*gap, *[(0, 0)] * (page.ndim - 2))) for page in images]
    return np.concatenate(below), np.concatenate([np.pad(page, gap) for page in known])


def _spacing(pages: Pages | None) -> tuple[float, float, float]:
    """Return the sides of the voxels of a stack, along its axes."""
    if pages is None:
        raise ValueError("is one image, and a volume has several planes")
    size = pages.pixel_size
    if size is None or size.z is None:
        said = f", of which only {size} is known" if size else ""
        raise ValueError(f"needs the size of voxels{said}; name it by --pixel-size, such as 0.3x0.3x2um")
    if pages.axes not in ("Z", "TZ", "Q"):
        raise ValueError(f"has the axes {pages.axes}YX, where (T)ZYX is expected; --axes names them")
    return size.z, size.y, size.x
