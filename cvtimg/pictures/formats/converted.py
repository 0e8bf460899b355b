"""Files that become a TIFF first: FITS of telescopes, by astropy, and raw files of cameras, by LibRaw."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from cvtimg._shared.extras import optional

#: Suffixes tell: many raw files begin as a TIFF does, with a small preview.
RAW_SUFFIXES = frozenset(
    {".3fr", ".arw", ".cr2", ".cr3", ".dng", ".iiq", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".rwl", ".srw"}
)


def developed(path: Path, check_size: Callable[[int], None]) -> BytesIO:
    """Return a raw file as a TIFF of 16 bits: demosaiced, upright, sRGB, with the white balance of the camera."""
    # Brightness is as exposed, so that frames of a series stay alike.
    rawpy = optional("rawpy", "raw")
    with rawpy.imread(str(path)) as raw:
        check_size(raw.sizes.iwidth * raw.sizes.iheight)
        pixels = raw.postprocess(use_camera_wb=True, no_auto_bright=True, output_bps=16, gamma=(2.4, 12.92))
    return _as_tiff(pixels, photometric="rgb")


def fits_as_tiff(file: BinaryIO, check_size: Callable[[int], None]) -> BytesIO | None:
    """Return the first image of a FITS file as a TIFF, a page for each plane, upright and in physical values."""
    # Pillow ignores their zero point, sign and orientation.
    fits = optional("astropy.io.fits", "fits", "is a FITS file, which needs")
    with fits.open(file, memmap=False) as units:
        for unit in units:
            header = unit.header
            sides = [int(header[f"NAXIS{axis + 1}"]) for axis in range(int(header.get("NAXIS", 0)))]
            if len(sides) < 2 or not unit.is_image or 0 in sides:
                continue
            check_size(int(np.prod(sides, dtype=float)))
            planes = unit.data.reshape(-1, *unit.data.shape[-2:])[:, ::-1]  # the bottom row comes first
            planes = planes.astype(planes.dtype.newbyteorder("="))
            if len(planes) > 1:
                return _as_tiff(planes, photometric="minisblack", metadata={"axes": "QYX"})
            return _as_tiff(planes[0], photometric="minisblack", metadata=None)
    return None


#: The registry of formats that become a TIFF first: from the first bytes of files, at most 8, to what converts them.
AS_TIFF: dict[bytes, Callable[[BinaryIO, Callable[[int], None]], BytesIO | None]] = {b"SIMPLE ": fits_as_tiff}


def _as_tiff(values: Any, **options: Any) -> BytesIO:
    import tifffile

    file = BytesIO()
    tifffile.imwrite(file, values, **options)
    file.seek(0)
    return file
