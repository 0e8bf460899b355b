"""Images larger than memory: TIFF and Zarr read and written some rows at a time.

A band is so many rows of tiles, strips or chunks as have about `BAND_PIXELS` pixels; no more than a few bands are in
memory at a time.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cvtimg.files.whole import StrPath, whole_file, whole_folder
from cvtimg.pictures.formats.bands import BAND_PIXELS, Band, Bands, Form
from cvtimg.pictures.formats.tiled_tiff import open_tiff, write_tiff
from cvtimg.pictures.formats.zarr_arrays import open_zarr, write_zarr

__all__ = ["BAND_PIXELS", "TILED_SUFFIXES", "Band", "Bands", "Form", "open_bands", "write_bands"]

#: Files that are written in tiles.
TILED_SUFFIXES = (".tif", ".tiff", ".zarr")


def open_bands(path: StrPath) -> Bands:
    """Open a TIFF (tiles or strips, BigTIFF too) or a Zarr array.

    Parameters
    ----------
    path : path
        Of a file, or of a folder that ends in .zarr; of a group the array "0" is taken.

    Returns
    -------
    Bands

    Raises
    ------
    OSError
        If the file cannot be read, or is of a kind that cannot be read by tiles; the message says why.
    """
    if Path(path).suffix.lower() == ".zarr":
        return open_zarr(path)
    return open_tiff(path)


def write_bands(
    path: StrPath,
    form: Form,
    bands: Iterable[Band],
    *,
    palette: NDArray[np.uint8] | None = None,
    overwrite: bool = False,
) -> None:
    """Write a picture by tiles, whole or not at all: .tif, or .zarr without palette.

    Parameters
    ----------
    path : path
        Where the picture shall appear.
    form : Form
        Of what is written.
    bands : iterable of arrays
        From above to below, of any heights.
    palette : (K, 3) uint8 array, optional
        The bands are indices into it.
    overwrite : bool
        Replace what exists.
    """
    if Path(path).suffix.lower() == ".zarr":
        with whole_folder(path, overwrite=overwrite) as folder:
            write_zarr(folder, form, bands)
        return
    with whole_file(path, overwrite=overwrite) as file:
        write_tiff(file, form, bands, palette)
