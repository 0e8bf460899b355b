"""Read and write Zarr arrays a band of rows at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.extras import needs
from cvtimg.files.remote import url_of
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.bands import SAMPLES, Band, Bands, Form, band_height, in_heights

__all__ = ["open_zarr", "write_zarr"]

_CHUNK = 1024


def open_zarr(path: StrPath) -> Bands:
    """Open an array, or the array "0" of a group."""
    array = _zarr_array(path)
    if array.ndim not in (2, 3) or 0 in array.shape or str(array.dtype) not in SAMPLES:
        raise OSError(
            f"{path}: holds {array.dtype} of shape {array.shape}; it must be (H, W) or (H, W, C), "
            "of integers, float32 or float64"
        )
    form = Form(array.shape, np.dtype(array.dtype))

    def read() -> Iterator[Band]:
        height = band_height(form.shape[1], min(array.chunks[0], form.shape[0]))
        for top in range(0, form.shape[0], height):
            yield np.ascontiguousarray(array[top : top + height])

    return Bands(form, read)


def _zarr_array(path: StrPath) -> Any:
    try:
        import zarr

        found = zarr.open(url_of(path), mode="r")
        return found["0"] if isinstance(found, zarr.Group) else found
    except ImportError as error:
        raise OSError(f"{path}: needs {needs('zarr', 'zarr')}") from error
    except Exception as error:  # zarr raises many kinds of errors for damaged metadata
        raise OSError(f"{path}: is not a Zarr array ({type(error).__name__})") from error


def write_zarr(folder: Path, form: Form, bands: Iterable[Band]) -> None:
    """Write an array into a folder."""
    import zarr

    chunks = (min(_CHUNK, form.shape[0]), min(_CHUNK, form.shape[1]), *form.shape[2:])
    array = zarr.create_array(str(folder), shape=form.shape, chunks=chunks, dtype=form.dtype, overwrite=True)
    top = 0
    for band in in_heights(bands, chunks[0]):
        array[top : top + len(band)] = band
        top += len(band)
