"""FITS files of telescopes, which astropy reads: Pillow ignores their zero point, sign and orientation."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from typing import BinaryIO

import numpy as np

from cvtimg._shared.extras import needs


def fits_as_tiff(file: BinaryIO, check_size: Callable[[int], None]) -> BytesIO | None:
    """Return the first image of a FITS file as a TIFF, a page for each plane, upright and in physical values."""
    import tifffile

    try:
        from astropy.io import fits
    except ImportError as error:
        raise ImportError(f"is a FITS file, which needs {needs('astropy', 'fits')}") from error
    with fits.open(file, memmap=False) as units:
        for unit in units:
            header = unit.header
            sides = [int(header[f"NAXIS{axis + 1}"]) for axis in range(int(header.get("NAXIS", 0)))]
            if len(sides) < 2 or not unit.is_image or 0 in sides:
                continue
            check_size(int(np.prod(sides, dtype=float)))
            planes = unit.data.reshape(-1, *unit.data.shape[-2:])[:, ::-1]  # the bottom row comes first
            planes = planes.astype(planes.dtype.newbyteorder("="))
            copy = BytesIO()
            several = {"metadata": {"axes": "QYX"}} if len(planes) > 1 else {"metadata": None}
            tifffile.imwrite(copy, planes if len(planes) > 1 else planes[0], photometric="minisblack", **several)
            copy.seek(0)
            return copy
    return None
