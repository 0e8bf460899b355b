"""Raw files of cameras, developed by LibRaw."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

from cvtimg._shared.extras import optional

#: Suffixes tell: many raw files begin as a TIFF does, with a small preview.
RAW_SUFFIXES = frozenset(
    {".3fr", ".arw", ".cr2", ".cr3", ".dng", ".iiq", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".rwl", ".srw"}
)


def developed(path: Path, check_size: Callable[[int], None]) -> BytesIO:
    """Return a raw file as a TIFF of 16 bits: demosaiced, upright, sRGB, with the white balance of the camera."""
    # Brightness is as exposed, so that frames of a series stay alike.
    import tifffile

    rawpy = optional("rawpy", "raw")
    with rawpy.imread(str(path)) as raw:
        check_size(raw.sizes.iwidth * raw.sizes.iheight)
        pixels = raw.postprocess(use_camera_wb=True, no_auto_bright=True, output_bps=16, gamma=(2.4, 12.92))
    file = BytesIO()
    tifffile.imwrite(file, pixels, photometric="rgb")
    file.seek(0)
    return file
