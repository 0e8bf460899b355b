"""Arrays of numbers: samples of any type in native byte order, and .npy files."""

from typing import BinaryIO

import numpy as np

from cvtimg._shared.types import Array, Dtype
from cvtimg.pictures.formats.opening import UnfitContentError, check_size, selected

NPY_MAGIC = b"\x93NUMPY"


def as_samples(values: Array) -> Array:
    """Return samples C-contiguous in native byte order: integers in their own type, which says what white is.

    Booleans become 0 and 255, and floating point float32 or float64.
    """
    kind, size = values.dtype.kind, values.dtype.itemsize
    if kind == "b":
        return values * np.uint8(255)
    if kind not in "iuf":
        raise UnfitContentError(f"has samples of type {values.dtype}, which are not real numbers")
    floating = np.dtype(np.float32 if size <= 4 else np.float64)
    return np.ascontiguousarray(values, floating if kind == "f" else values.dtype.newbyteorder("="))


def upright(values: Array, orientation: int) -> Array:
    """Rotate or flip an array (H, W, ...) with the given EXIF orientation, 1..8, to be upright."""
    if orientation in (5, 6, 7, 8):
        values = values.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        values = values[::-1]
    if orientation in (2, 3, 6, 7):
        values = values[:, ::-1]
    return np.ascontiguousarray(values)


def decode_npy(file: BinaryIO) -> Array:
    """Read a numeric array (H, W) or (H, W, C)."""
    return as_samples(_checked(np.load(file, allow_pickle=False)))


def npy_header(file: BinaryIO) -> tuple[tuple[int, ...], Dtype]:
    """Return the shape and type of an array; a file on disk is only memory-mapped."""
    name = getattr(file, "name", None)
    whole = np.load(file, allow_pickle=False) if name is None else np.load(name, mmap_mode="r", allow_pickle=False)
    values = _checked(whole)
    return values.shape, values.dtype


def _checked(values: Array, few_bands: int = 4, flat: int = 4) -> Array:
    # A last axis of few values holds bands, however small the image is; otherwise a first axis that is shorter than the
    # others by the factor `flat` is doubtful: it may hold bands or pages.
    shape, axis = values.shape, selected().channel_axis
    if values.ndim not in (2, 3) or values.size == 0:
        raise UnfitContentError(f"holds an array of shape {shape}; an image must be (H, W) or (H, W, C)")
    if values.ndim == 3 and axis is not None:
        values = np.moveaxis(values, axis, -1)
    elif values.ndim == 3 and shape[2] > few_bands and flat * shape[0] <= min(shape[1:]):
        raise UnfitContentError(
            f"holds an array of shape {shape}, whose bands could lie along the first or the last axis: "
            "say which by --channel-axis 0 or 2 (channel_axis in Python)"
        )
    check_size(values.shape[0] * values.shape[1])
    return values
