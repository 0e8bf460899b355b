"""Read and write multi-page TIFF files, such as those of ImageJ, OME and scanners."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_that
from cvtimg._shared.messages import one_line
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.pictures.formats.encoding import check_indexed
from cvtimg.pictures.formats.opening import reading
from cvtimg.pictures.formats.stacks import Stack, decode_stack, encode_stack
from cvtimg.pictures.formats.tiff import count_pages as _count

__all__ = ["PAGE_SUFFIXES", "Pages", "count_pages", "read_pages", "write_pages"]

#: Suffixes of files that can hold several pages.
PAGE_SUFFIXES = (".tif", ".tiff")


@dataclass(frozen=True, slots=True, eq=False)
class Pages:
    """The pages of a file, and how they are arranged.

    Attributes
    ----------
    images : tuple of (H, W) or (H, W, C) arrays
        Pages of the same shape and type, in file order: the last of `axes` varies fastest.
    axes : str
        One letter for each axis of the stack: Z for depth, T for time, C for channels, other letters (such as Q) for
        unknown axes.
    shape : tuple of int
        Number of pages along each axis.
    kind : {"", "imagej", "ome"}
        Convention that the file follows; "" for a plain TIFF.
    scale : mapping of str
        Physical sizes under the names that tifffile uses, such as ``{"spacing": 0.5, "unit": "um"}`` or
        ``{"PhysicalSizeX": 0.1}``; "resolution" and "resolutionunit" are the TIFF tags.
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
        check_that("images", len(self.images) > 0, "contain at least one page")
        forms = {(image.shape, image.dtype) for image in self.images}
        shapes = sorted(shape for shape, _ in forms)
        check_that(f"images of shapes {shapes}", len(forms) == 1, "have one shape and type")
        if not self.shape:
            object.__setattr__(self, "shape", (len(self.images),))
        fits = len(self.shape) == len(self.axes) and math.prod(self.shape) == len(self.images)
        check_that(f"axes={self.axes!r} of shape {self.shape}", fits, f"hold {len(self.images)} images")
        for image in self.images:
            image.flags.writeable = False

    def __repr__(self) -> str:
        first = self.images[0]
        return f"<Pages {self.axes} {self.shape} of {first.shape} {first.dtype}>"


def count_pages(path: StrPath) -> int:
    """Count the pages of a file, excluding masks and reduced-size copies; 1 for formats other than TIFF.

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
        A multi-page TIFF: plain, ImageJ or OME; or a FITS cube, whose planes are pages. Any other image is read as one
        page.

    Returns
    -------
    Pages
        Each page has the form in which `read_image` returns an image.

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
    """Write a multi-page TIFF atomically; axes and physical sizes are preserved.

    Parameters
    ----------
    path : str or path-like
        Ends in .tif or .tiff.
    pages : Pages, or (P, H, W) or (P, H, W, C) array
        Integers, float32 or float64.
    palette : (K, 3) uint8 array, 1 <= K <= 256, optional
        Palette that the pages index. ImageJ and OME files store the colors instead of indices.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    ValueError
        If the suffix is unknown, or the pages or the palette do not fit.
    FileExistsError
        If the file exists and `overwrite` is false.
    OSError
        If the file cannot be written. No partial file remains, and an existing file is unchanged.
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
