"""Stacks of pages on disk: TIFF of several pages, as ImageJ, OME and scanners write them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice
from cvtimg._shared.messages import one_line
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.pictures.formats.encoding import check_indexed
from cvtimg.pictures.formats.opening import reading
from cvtimg.pictures.formats.stacks import Stack, decode_stack, encode_stack
from cvtimg.pictures.formats.tiff import count_pages as _count

__all__ = ["PAGE_SUFFIXES", "Pages", "count_pages", "read_pages", "write_pages"]

#: Files that hold several pages.
PAGE_SUFFIXES = (".tif", ".tiff")


@dataclass(frozen=True, slots=True, eq=False)
class Pages:
    """The pages of a file, and how they are arranged.

    Attributes
    ----------
    images : tuple of (H, W) or (H, W, C) arrays
        All of one shape and type, in the order of the file: the last of `axes` varies fastest.
    axes : str
        A letter for each axis that pages lie along: Z for depth, T for time, C for channels, another where the file
        does not say.
    shape : tuple of int
        Number of pages along each axis.
    kind : {"", "imagej", "ome"}
        Whose conventions the file follows.
    scale : mapping of str
        What the file says of physical sizes, in the words of tifffile, such as ``{"spacing": 0.5, "unit": "um"}`` or
        ``{"PhysicalSizeX": 0.1}``; "resolution" and "resolutionunit" are those of a TIFF.
    has_alpha : bool
        Whether the last channel is transparency.
    """

    images: tuple[NDArray[Any], ...]
    axes: str = "Q"
    shape: tuple[int, ...] = ()
    kind: str = ""
    scale: Mapping[str, Any] = field(default_factory=dict)
    has_alpha: bool = False

    def __post_init__(self) -> None:
        if not self.images:
            raise ValueError("images must be at least one")
        forms = {(image.shape, image.dtype) for image in self.images}
        if len(forms) > 1:
            raise ValueError(f"images of shapes {sorted(shape for shape, _ in forms)} must have one shape and type")
        if not self.shape:
            object.__setattr__(self, "shape", (len(self.images),))
        if len(self.shape) != len(self.axes) or math.prod(self.shape) != len(self.images):
            raise ValueError(f"axes={self.axes!r} of shape {self.shape} must hold {len(self.images)} images")
        for image in self.images:
            image.flags.writeable = False

    def __repr__(self) -> str:
        first = self.images[0]
        return f"<Pages {self.axes} {self.shape} of {first.shape} {first.dtype}>"


def count_pages(path: StrPath) -> int:
    """Count the pages of a file, without masks and reduced copies; 1 for other formats than TIFF.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg.pictures import write_pages
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_pages(f"{folder}/a.tif", np.zeros((3, 4, 5), np.uint8))
    ...     count_pages(f"{folder}/a.tif")
    3
    """
    if Path(path).suffix.lower() == ".zarr":
        return 1
    with reading(path) as file:
        return _count(file)


def read_pages(path: StrPath) -> Pages:
    """Read all pages of a file.

    Parameters
    ----------
    path : str or path-like
        A TIFF of several pages: plain, or of ImageJ or OME. Any other image is one page.

    Returns
    -------
    Pages
        Each page is as `read_image` returns an image.

    Raises
    ------
    OSError
        As `read_image` does; also if the pages differ in size or type.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg.pictures import read_pages, write_pages
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_pages(f"{folder}/a.tif", np.zeros((3, 4, 5), np.uint8))
    ...     read_pages(f"{folder}/a.tif")
    <Pages Q (3,) of (4, 5) uint8>
    """
    with reading(path) as file:
        stack = decode_stack(file)
    images = tuple(np.ascontiguousarray(image) for image in stack.images)
    return Pages(images, stack.axes, stack.shape, stack.kind, stack.scale, stack.has_alpha)


def write_pages(
    path: StrPath,
    pages: Pages | ArrayLike,
    *,
    palette: NDArray[np.uint8] | None = None,
    overwrite: bool = False,
) -> None:
    """Write pages whole or not at all, arranged and scaled as they were read.

    Parameters
    ----------
    path : str or path-like
        Ends in .tif or .tiff.
    pages : Pages, or (P, H, W) or (P, H, W, C) array
        Integers, float32 or float64.
    palette : (K, 3) uint8 array, 1 <= K <= 256, optional
        The pages are indices into it. Files of ImageJ and OME get the colors in its place.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    ValueError
        If the suffix is unknown, or the pages or the palette do not fit.
    FileExistsError
        If the file exists and `overwrite` is false.
    OSError
        If the file cannot be written. Nothing is left behind, an old file stays as it was.
    """
    check_choice(f"{path}: suffix", Path(path).suffix.lower(), PAGE_SUFFIXES)
    given = pages if isinstance(pages, Pages) else Pages(tuple(np.array(page) for page in np.asarray(pages)))
    if palette is not None:
        for image in given.images:
            check_indexed(image, palette)
    stack = Stack(given.images, given.axes, given.shape, given.kind, given.scale, given.has_alpha)
    with whole_file(path, overwrite=overwrite) as file:
        try:
            encode_stack(file, stack, palette)
        except Exception as error:  # tifffile raises ValueError, OSError, struct.error and others
            raise OSError(f"{path}: cannot be written ({one_line(error)})") from error
