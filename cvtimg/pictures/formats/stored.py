"""Axes and channels of stacks, and stacks that others open as arrays on disk: OME-Zarr, files of microscopes."""

import json
import math
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Self, TypeGuard

import numpy as np

from cvtimg._shared.choices import Options
from cvtimg._shared.extras import optional
from cvtimg._shared.types import Array, Ints64
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.arrays import NPY_MAGIC, as_samples
from cvtimg.pictures.formats.opening import Selection, UnfitContentError, check_size, selected
from cvtimg.pictures.formats.pixel_size import PixelSize

#: Files of the programs of Zeiss and Nikon.
MICROSCOPE_SUFFIXES = (".czi", ".nd2")
_NOUNS = {"C": "channel", "T": "frame", "Z": "plane"}


class Arrangement(NamedTuple):
    """How the pages of a file are arranged: letters of axes, their lengths, and names of channels where known."""

    axes: str
    shape: tuple[int, ...]
    channels: tuple[str, ...] = ()

    def chosen(self, by: Selection) -> tuple[Self, Ints64]:
        """Return what remains of the stack, and the numbers of these pages, by the names and places that are given."""
        stack = self if by.axes is None else self._named(by.axes)
        numbers = np.arange(math.prod(stack.shape)).reshape(stack.shape)
        for axis, given in (("T", by.t), ("C", by.channel), ("Z", by.z)):
            if given is None or (axis == "C" and axis not in stack.axes):  # bands of a page are channels, too
                continue
            at = stack.axes.find(axis)
            if at < 0:
                raise UnfitContentError(f"has the axes {stack.axes}YX, without {axis}; --axes names them")
            place = place_of(given, stack.shape[at], stack.channels if axis == "C" else (), _NOUNS[axis])
            numbers = np.asarray(numbers.take(place, axis=at))
            channels = stack.channels[place : place + 1] if axis == "C" else stack.channels
            axes = stack.axes[:at] + stack.axes[at + 1 :]
            stack = stack._replace(axes=axes, shape=numbers.shape, channels=channels)
        return stack, numbers.ravel()

    def band(self, by: Selection, bands: tuple[str, ...]) -> int | None:
        """Return which of the bands of a page is chosen as a channel; None for all of them."""
        if by.channel is None or "C" in (by.axes or self.axes):
            return None
        names = self.channels if len(self.channels) == len(bands) else bands
        return place_of(by.channel, len(bands), names, _NOUNS["C"])

    def _named(self, axes: str) -> Self:
        letters = axes.upper().removesuffix("S").removesuffix("YX")
        if len(letters) != len(self.shape) or len(set(letters)) < len(letters):
            pages = " x ".join(map(str, self.shape)) or "1"
            have = f"{self.axes}YX, of {pages} page{'s' * (pages != '1')}"
            raise UnfitContentError(f"has the axes {have}; --axes {axes} must have a letter for each")
        return self._replace(axes=letters, channels=self.channels if "C" in letters or "C" not in self.axes else ())


@dataclass(frozen=True, slots=True, eq=False)
class StoredStack:
    """An array on disk whose axes have names, of which pages are read when they are needed."""

    array: Any  # Zarr or Dask array
    letters: str  # of its axes, in their order; the last ones are Y and X
    channels: tuple[str, ...]
    pixel_size: PixelSize | None
    form: str  # Name of the format
    kind: str = "ome"  # that of `Pages`

    @property
    def stack(self) -> Arrangement:
        """How its pages are arranged."""
        return Arrangement(self.letters[:-2], tuple(self.array.shape[:-2]), self.channels)

    @property
    def scale(self) -> Options:
        """Physical sizes, as in `Pages`."""
        return self.pixel_size.scale(self.kind) if self.pixel_size else {}

    def pages(self, numbers: Sequence[int]) -> list[Array]:
        """Read some pages."""
        check_size(len(numbers) * math.prod(self.array.shape[-2:]))
        places = [np.unravel_index(number, self.array.shape[:-2]) if self.letters != "YX" else () for number in numbers]
        return [as_samples(np.asarray(self.array[tuple(map(int, place))])) for place in places]


def npy_stack(file: BinaryIO) -> StoredStack | None:
    """Open an array whose axes are said; None for other files, and without letters."""
    is_npy = file.read(len(NPY_MAGIC)) == NPY_MAGIC
    file.seek(0)
    return _with_axes(np.load(file, allow_pickle=False), "NPY") if is_npy and selected().axes else None


def _with_axes(values: Array, form: str) -> StoredStack:
    axes = (selected().axes or "").upper()
    if len(axes) != values.ndim or len(set(axes)) < len(axes) or not {"Y", "X"} <= {*axes}:
        raise UnfitContentError(f"holds an array of shape {values.shape}, whose axes cannot be {axes}")
    check_size(values.size)
    planes = np.moveaxis(values, [axes.index("Y"), axes.index("X")], [-2, -1])
    letters = axes.replace("Y", "").replace("X", "") + "YX"
    return StoredStack(planes, letters, (), None, form, "")


def place_of(given: str | int, length: int, names: tuple[str, ...], noun: str) -> int:
    """Return the index of what is given by its name or by its number, from 1."""
    if str(given) in names:
        return names.index(str(given))
    if str(given).isdecimal() and 1 <= int(given) <= length:
        return int(given) - 1
    known = f" ({', '.join(names)})" if names else ""
    raise UnfitContentError(f"has {length} {noun}{'s' * (length > 1)}{known}, and no {noun} {given}")


def is_stored(path: object) -> TypeGuard[StrPath]:
    """Whether a path is a stack that `open_stored` opens."""
    return _opener(path) is not None


def open_stored(path: StrPath) -> StoredStack:
    """Open a stack, without reading its pages."""
    opener = _opener(path)
    assert opener is not None
    return opener(path)


def _opener(path: object) -> Callable[[StrPath], StoredStack] | None:
    """Return what opens a stack; None for images, such as a plain array of Zarr whose axes are not said."""
    if not isinstance(path, (str, os.PathLike)):
        return None
    suffix = Path(path).suffix.lower()
    if suffix == ".zarr" and _said_of(Path(path)):
        return _open_ngff
    if suffix == ".zarr" and selected().axes is not None and Path(path).is_dir():
        return _open_array
    return _open_microscope if suffix in MICROSCOPE_SUFFIXES else None


def _open_array(path: StrPath) -> StoredStack:
    return _with_axes(optional("zarr", "zarr").open_array(str(path), mode="r")[:], "Zarr")


def _said_of(folder: Path) -> Options:
    """Return what the group says of its images; nothing if it is no group of OME-Zarr."""
    for name, within in ((".zattrs", ()), ("zarr.json", ("attributes", "ome"))):
        with suppress(OSError, ValueError, KeyError, TypeError, IndexError):
            said: Options = json.loads((folder / name).read_bytes())
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
    letters = "".join(str(entry["name"])[:1].upper() for entry in axes)
    if not letters.endswith("YX") or len({*letters}) < len(letters):
        raise UnfitContentError(f"has the axes {letters}, which do not end in YX")
    sizes = np.ones(len(axes))
    for step in (*level.get("coordinateTransformations", ()), *image.get("coordinateTransformations", ())):
        if step.get("type") == "scale":
            sizes = sizes * np.asarray(step["scale"], np.float64)
    units = {str(entry.get("unit", "")) for entry in axes if entry["name"] in ("z", "y", "x")}
    size = dict(zip(letters, sizes.tolist(), strict=True))
    unit = units.pop() if len(units) == 1 else ""
    pixel_size = PixelSize.named(size["X"], size["Y"], unit, size.get("Z"))
    named = [str(entry.get("label", "")) for entry in said.get("omero", {}).get("channels", ())]
    array = zarr.open_array(str(Path(path, level["path"])), mode="r")
    names = tuple(named) if "C" in letters and len({*named}) == array.shape[letters.index("C")] else ()
    return StoredStack(array, letters, names, pixel_size, "OME-Zarr")


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
