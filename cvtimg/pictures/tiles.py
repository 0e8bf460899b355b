"""Read and write images larger than memory (TIFF and Zarr), a band of rows at a time.

A band consists of whole rows of tiles, strips or chunks, about `BAND_PIXELS` pixels in all. Only a few bands are in
memory at any time.
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

__all__ = ["BAND_PIXELS", "TILED_SUFFIXES", "Band", "Bands", "Form", "needs_tiles", "open_bands", "write_bands"]

#: Suffixes of files that are written in tiles.
TILED_SUFFIXES = (".tif", ".tiff", ".zarr")
#: TIFF files of more pixels are read in tiles, if the format of the output allows it.
_LARGE = 1 << 26


def open_bands(path: StrPath) -> Bands:
    """Open a TIFF (tiles or strips, BigTIFF too) or a Zarr array.

    Parameters
    ----------
    path : path
        A TIFF file, or a folder that ends in .zarr. For a Zarr group, its array "0" is opened.

    Returns
    -------
    Bands

    Raises
    ------
    OSError
        If the file cannot be read, or cannot be read in tiles; the message says why.
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
    """Write an image in tiles, atomically: .tif, or .zarr without palette.

    Parameters
    ----------
    path : path
        File or folder to write.
    form : Form
        Shape, type and metadata of the image.
    bands : iterable of arrays
        Bands from top to bottom, of any height.
    palette : (K, 3) uint8 array, optional
        Palette that the bands index.
    overwrite : bool
        Replace an existing file or folder.
    """
    if Path(path).suffix.lower() == ".zarr":
        with whole_folder(path, overwrite=overwrite) as folder:
            write_zarr(folder, form, bands)
        return
    with whole_file(path, overwrite=overwrite) as file:
        write_tiff(file, form, bands, palette)


def needs_tiles(source: StrPath, target: StrPath) -> bool:
    """Return whether to process an image in tiles: if it is large or a Zarr array."""
    suffixes = {Path(path).suffix.lower() for path in (source, target)}
    if ".zarr" in suffixes:
        return True
    if not suffixes <= {".tif", ".tiff"}:
        return False
    try:
        return open_bands(source).form.n_pixels > _LARGE
    except OSError:  # the usual reader opens it or reports the error
        return False
