"""Stacks that other packages open as arrays on disk: OME-Zarr, and the files of microscopes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, TypeGuard

from cvtimg._shared.extras import optional
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.axes import StoredStack
from cvtimg.pictures.formats.ngff import is_ngff, open_ngff
from cvtimg.pictures.formats.opening import UnfitContentError
from cvtimg.pictures.formats.pixel_size import PixelSize

__all__ = ["MICROSCOPE_SUFFIXES", "is_stored", "open_stored"]

#: Files of the programs of Zeiss and Nikon.
MICROSCOPE_SUFFIXES = (".czi", ".nd2")


def is_stored(path: Any) -> TypeGuard[StrPath]:
    """Whether a path is a stack that `open_stored` opens."""
    return is_ngff(path) or _is_of_microscope(path)


def open_stored(path: StrPath) -> StoredStack:
    """Open a stack, without reading its pages."""
    return _open_microscope(path) if _is_of_microscope(path) else open_ngff(path)


def _is_of_microscope(path: Any) -> TypeGuard[StrPath]:
    return isinstance(path, (str, os.PathLike)) and Path(path).suffix.lower() in MICROSCOPE_SUFFIXES


def _open_microscope(path: StrPath) -> StoredStack:
    """Open a file of one scene by a plugin of BioIO, which has the same axes for all formats, and micrometers."""
    form = Path(path).suffix[1:].upper()
    image = optional(f"bioio_{form.lower()}", "microscopes").Reader(Path(path).absolute())
    lengths = dict(zip(image.dims.order, image.shape, strict=True))
    if len(image.scenes) > 1 or "S" in lengths:
        what = "pixels in color" if "S" in lengths else f"{len(image.scenes)} scenes ({', '.join(image.scenes)})"
        raise UnfitContentError(f"has {what}, where one scene of gray channels is expected; save it as OME-TIFF")
    axes = "".join(axis for axis, length in lengths.items() if length > 1 or axis in "YX")
    size, names = image.physical_pixel_sizes, tuple(map(str, image.channel_names or ()))
    pixel_size = PixelSize.named(size.X, size.Y, "um", size.Z or None)
    named = names if len(set(names)) == lengths.get("C", 1) else ()
    return StoredStack(image.get_image_dask_data(axes), axes, named, pixel_size, form)
