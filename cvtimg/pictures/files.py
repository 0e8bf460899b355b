"""Pictures and files on disk: the only part of cvtimg that reads or writes pictures.

A picture comes in as an upright sRGB array and goes out whole or not at all. Every file that
cannot be read or written ends in an `OSError` that says ``"{path}: {reason}"`` in one line.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.messages import one_line
from cvtimg._shared.pixels import with_mark
from cvtimg.files.finding import find_images
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.pictures.formats.decoding import decode
from cvtimg.pictures.formats.encoding import encode_image, encoder, lossless_suffixes
from cvtimg.pictures.formats.header import ImageInfo, read_header
from cvtimg.pictures.formats.metadata import Metadata, decode_metadata
from cvtimg.pictures.formats.opening import reading

__all__ = [
    "ImageInfo",
    "Metadata",
    "encode_image",
    "find_images",
    "image_info",
    "lossless_suffixes",
    "read_image",
    "read_metadata",
    "whole_file",
    "write_image",
]


def read_image(path: StrPath) -> NDArray[Any]:
    """Read a picture as an upright sRGB array.

    Parameters
    ----------
    path : str or path-like
        Any raster picture that Pillow reads, TIFF of any samples and bands, or a .npy array (H, W) or (H, W, C).
        Of several frames or pages the first is taken.

    Returns
    -------
    ndarray, (H, W) or (H, W, C), C-contiguous
        uint8 (H, W) for 1-bit and grey; uint8 (H, W, 3) for RGB, palette, CMYK, YCbCr and LAB;
        uint8 (H, W, 4) for whatever has transparency; uint16 of the same shapes for 16 bits, grey or RGB, in PNG and
        TIFF. Floating point stays float32 or float64, integers of other types become uint16 where they are in
        0..65535, else floating point. Bands that are no colors give (H, W, C) with all of them, C >= 2.

    Raises
    ------
    OSError
        If the file cannot be read; `FileNotFoundError`, `IsADirectoryError` and
        `PermissionError` where they apply.

    Notes
    -----
    16-bit RGB is brought to sRGB at its full depth. Grey beyond 8 bits, floating point and bands that are no colors
    are taken for measurements: their values stay as they are, without colour profile. Of a TIFF with three colors and
    one more band without a meaning all four bands come, which others then take for transparency; `image_info` tells
    them apart.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3, 3), np.uint8))
    ...     read_image(f"{folder}/a.png").shape
    (2, 3, 3)
    """
    with reading(path) as file:
        image = decode(file)
        if image.shape[2:] != (4,):
            return image
        file.seek(0)
        return with_mark(image, read_header(file).has_alpha)


def image_info(path: StrPath) -> ImageInfo:
    """Read what the header of a picture says, and no pixels.

    Parameters
    ----------
    path : str or path-like
        As in `read_image`.

    Returns
    -------
    ImageInfo

    Raises
    ------
    OSError
        As `read_image` does, as far as the header tells.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3), np.uint16))
    ...     info = image_info(f"{folder}/a.png")
    >>> info.width, info.height, info.bits
    (3, 2, 16)
    """
    with reading(path) as file:
        return read_header(file)


def read_metadata(path: StrPath) -> Metadata:
    """Read what can be kept of a picture file beside the pixels, for `write_image`.

    Parameters
    ----------
    path : str or path-like
        As in `read_image`.

    Returns
    -------
    Metadata
        Color profile, pixels an inch, EXIF without orientation, and where a GeoTIFF lies; of a TIFF of bands, the
        last alone.

    Raises
    ------
    OSError
        As `read_image` does, as far as the header tells.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3), np.uint8), metadata=Metadata(dpi=(300, 300)))
    ...     across, down = read_metadata(f"{folder}/a.png").dpi
    >>> round(across), round(down)
    (300, 300)
    """
    with reading(path) as file:
        return decode_metadata(file)


def write_image(
    path: StrPath,
    image: NDArray[Any],
    *,
    palette: NDArray[np.uint8] | None = None,
    alpha: bool | None = None,
    metadata: Metadata | None = None,
    optimize: bool = False,
    overwrite: bool = False,
) -> None:
    """Write a picture whole or not at all, in the format that the suffix names.

    Parameters
    ----------
    path : str or path-like
        Ends in .png, .tif, .tiff, .webp (lossless), .gif, .bmp, .ppm, .pgm, .npy, .jpg or .jpeg.
    image : ndarray
        (H, W) bool, uint8 or uint16, or (H, W, 3) or (H, W, 4) uint8 or uint16 (in .png and .tif), in sRGB. A .tif or
        .npy takes any bands of integers, float32 or float64. With a palette (H, W) integers in 0..K-1.
    palette : ndarray, (K, 3) or (K, 4) uint8, 1 <= K <= 256, optional
        Writes an indexed picture, a PNG of the smallest of 1, 2, 4 and 8 bits that holds K
        colours. A format without palette or without its transparency gets the same colours as
        RGB or RGBA. No format that loses colours is taken.
    alpha : bool, optional
        Whether the last band is transparency; by default that of four. Other bands than gray, RGB and alpha fit into
        a .tif or a .npy.
    metadata : Metadata, optional
        What to write beside the pixels, such as `read_metadata` gives: as much of it as the format has room for. A TIFF
        gets the first part of EXIF alone, and none with 16-bit color or bands.
    optimize : bool
        Make a .png smaller with oxipng (``pip install 'cvtimg[oxipng]'``), which takes longer and loses nothing.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    ModuleNotFoundError
        If oxipng is wanted and not there.
    ValueError
        If the suffix is unknown, or the array or palette does not fit the format.
    FileExistsError
        If the file exists and `overwrite` is false.
    OSError
        If the file cannot be written. Nothing is left behind, an old file stays as it was.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     red_blue = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)
    ...     write_image(f"{folder}/a.png", np.array([[0, 1, 1]]), palette=red_blue)
    ...     image_info(f"{folder}/a.png").bits
    1
    """
    write = encoder(Path(path).suffix, image, palette, alpha, metadata, optimize)
    with whole_file(path, overwrite=overwrite) as file:
        try:
            write(file)
        except ModuleNotFoundError:
            raise
        except Exception as error:  # encoders raise ValueError, OSError, SystemError and others
            raise OSError(f"{path}: cannot be written ({one_line(_cause(file, error))})") from error


def _cause(file: BinaryIO, error: Exception) -> Exception:
    """Return why writing failed: encoders hide what the system said, which says it again."""
    try:
        file.write(bytes(1 << 16))
        file.flush()
    except OSError as system:
        return system
    return error
