"""Images of OME-Zarr (NGFF 0.4 and 0.5): their axes, channels and sizes."""

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

__all__ = ["is_ngff", "open_ngff"]


def is_ngff(path: Any) -> TypeGuard[StrPath]:
    """Whether a path is a folder of OME-Zarr, and not of a plain array."""
    is_path = isinstance(path, (str, os.PathLike)) and Path(path).suffix.lower() == ".zarr"
    return is_path and _multiscales(Path(path)) is not None


def _multiscales(folder: Path) -> tuple[Mapping[str, Any], Mapping[str, Any]] | None:
    """Return what the group says of its first image, and all that it says; None if it is no image of OME-Zarr."""
    for name, within in ((".zattrs", ()), ("zarr.json", ("attributes", "ome"))):
        with suppress(OSError, ValueError, KeyError, TypeError, IndexError):
            said = json.loads((folder / name).read_bytes())
            for key in within:
                said = said[key]
            return said["multiscales"][0], said
    return None


def open_ngff(path: StrPath) -> StoredStack:
    """Open the finest level of the first image of a group."""
    zarr = optional("zarr", "zarr")
    found = _multiscales(Path(path))
    assert found is not None  # as `is_ngff` has said
    image, said = found
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
