"""Read FITS files of telescopes with astropy; Pillow ignores their zero point, sign and orientation."""

from __future__ import annotations

from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.extras import needs
from cvtimg.pictures.formats.arrays import as_samples
from cvtimg.pictures.formats.opening import UnfitContentError, check_size

__all__ = ["FITS_MAGIC", "decode_fits", "decode_planes"]

FITS_MAGIC = b"SIMPLE "


def decode_fits(file: BinaryIO) -> NDArray[Any]:
    """Read the first image of a file, (H, W), which must have a single plane."""
    planes: list[NDArray[Any]] = list(decode_planes(file))
    if len(planes) > 1:
        raise UnfitContentError(f"has {len(planes)} planes, where one image is expected; --page N chooses one")
    return planes[0]


def decode_planes(file: BinaryIO) -> NDArray[Any]:
    """Read the planes of the first image of a file, (P, H, W), in physical values; FITS stores the bottom row first."""
    try:
        from astropy.io import fits
    except ImportError as error:
        raise UnfitContentError(f"is a FITS file, which needs {needs('astropy', 'fits')}") from error
    file.seek(0)
    with fits.open(file, memmap=False) as units:
        for unit in units:
            header = unit.header
            sides = [int(header[f"NAXIS{axis + 1}"]) for axis in range(int(header.get("NAXIS", 0)))]
            if len(sides) < 2 or not unit.is_image or 0 in sides:
                continue
            check_size(int(np.prod(sides, dtype=float)))
            planes: NDArray[Any] = unit.data.reshape(-1, *unit.data.shape[-2:])
            return as_samples(planes.astype(planes.dtype.newbyteorder("="))[:, ::-1])
    raise UnfitContentError("holds no image")
