"""Stacks that other packages open as arrays on disk: OME-Zarr (NGFF 0.4 and 0.5), and the files of microscopes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from cvtimg._shared.extras import optional
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.axes import StoredStack
from cvtimg.pictures.formats.opening import UnfitContentError
from cvtimg.pictures.formats.pixel_size import PixelSize

#: Files of the programs of Zeiss and Nikon.
MICROSCOPE_SUFFIXES = (".czi", ".nd2")


def is_stored(path: Any) -> TypeGuard[StrPath]:
    """Whether a path is a stack that `open_stored` opens."""
    return is_ngff(path) or _is_of_microscope(path)


def open_stored(path: StrPath) -> StoredStack:
    """Open a stack, without reading its pages."""
    return _open_microscope(path) if _is_of_microscope(path) else _open_ngff(path)


def is_ngff(path: Any) -> TypeGuard[StrPath]:
    """Whether a path is a folder of OME-Zarr, and not of a plain array."""
    is_path = isinstance(path, (str, os.PathLike)) and Path(path).suffix.lower() == ".zarr"
    return is_path and bool(_said_of(Path(path)))


def _said_of(folder: Path) -> Mapping[str, Any]:
    """Return what the group says of its images; nothing if it is no group of OME-Zarr."""
    for name, within in ((".zattrs", ()), ("zarr.json", ("attributes", "ome"))):
        with suppress(OSError, ValueError, KeyError, TypeError, IndexError):
            said: Mapping[str, Any] = json.loads((folder / name).read_bytes())
            for key in within:
                said = said[key]
            if said["multiscales"][0]:
                return said
    return {}


def _open_ngff(path: StrPath) -> StoredStack:
    """Open the finest level of the first image of a group."""
    zarr, said = optional("zarr", "zarr"), _said_of(Path(path))
    image = said["multiscales"][0]
    axes, level = image["axes"], image["datasets"][0]
    letters = "".join(str(one["name"])[:1].upper() for one in axes)
    if not letters.endswith("YX") or len({*letters}) < len(letters):
        raise UnfitContentError(f"has the axes {letters}, which do not end in YX")
    sizes = np.ones(len(axes))
    for step in (*level.get("coordinateTransformations", ()), *image.get("coordinateTransformations", ())):
        if step.get("type") == "scale":
            sizes = sizes * np.asarray(step["scale"], np.float64)
    units = {str(one.get("unit", "")) for one in axes if one["name"] in ("z", "y", "x")}
    size = dict(zip(letters, sizes.tolist(), strict=True))
    unit = units.pop() if len(units) == 1 else ""
    pixel_size = PixelSize.named(size["X"], size["Y"], unit, size.get("Z"))
    named = [str(one.get("label", "")) for one in said.get("omero", {}).get("channels", ())]
    array = zarr.open_array(str(Path(path, level["path"])), mode="r")
    names = tuple(named) if "C" in letters and len({*named}) == array.shape[letters.index("C")] else ()
    return StoredStack(array, letters, names, pixel_size, "OME-Zarr")


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
