"""Image files of one image: read as an upright sRGB array, and written whole or not at all.

A file that cannot be read or written ends in an `OSError` that says ``"{path}: {reason}"`` in one line. Animations are
in `frames`, files of several pages in `pages`, images larger than memory in `tiles`.
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
from cvtimg.pictures.formats.opening import Source, reading

__all__ = [
    "ImageInfo",
    "Metadata",
    "encode_image",
    "find_images",
    "image_info",
    "lossless_suffixes",
    "read_image",
    "read_indices",
    "read_metadata",
    "whole_file",
    "write_image",
]


def read_image(source: Source, *, keep_profile: bool = False) -> NDArray[Any]:
    """Read an image as an upright sRGB array.

    Parameters
    ----------
    source : path, bytes or binary file
        Any raster format that Pillow reads (PNG, JPEG, TIFF, WebP, GIF, BMP, AVIF and others), TIFF of any samples and
        bands, FITS (with ``cvtimg[fits]``), or a .npy array (H, W) or (H, W, C). Of an animation the first frame is
        read; of files with several pages, `read_pages` reads all.
    keep_profile : bool
        Leave colors as they are under an RGB profile, such as Display P3, in place of converting them to sRGB; to be
        written with ``read_metadata(source, keep_profile=True)``.

    Returns
    -------
    ndarray, (H, W) or (H, W, C), C-contiguous
        uint8 (H, W) for 1-bit and gray; uint8 (H, W, 3) for RGB, palette, CMYK, YCbCr and LAB; uint8 (H, W, 4) for
        images with transparency; uint16 of the same shapes for 16-bit gray or RGB in PNG and TIFF. Floating point
        stays float32 or float64; integers of other types become uint16 if they are in 0..65535, else floating point.
        Bands that are not colors give (H, W, C) with all of them, C >= 2.

    Raises
    ------
    OSError
        If the file cannot be read, or has several pages; `FileNotFoundError`, `IsADirectoryError` and
        `PermissionError` where they apply.

    Notes
    -----
    The orientation in EXIF is applied. Colors are converted to sRGB by the ICC profile of the file, if it has one, and
    16-bit RGB at its full depth; CMYK is converted by its profile, or without one by plain complement. Gray beyond
    8 bits, floating point and bands that are not colors are taken for measurements: their values stay as they are.

    The last band is transparency only where the file says so; `image_info` tells. A TIFF with three colors and one
    more band without a meaning gives all four bands.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3, 3), np.uint8))
    ...     read_image(f"{folder}/a.png").shape
    (2, 3, 3)
    """
    with reading(source) as file:
        image = decode(file, keep_profile=keep_profile)
        if image.shape[2:] != (4,):
            return image
        file.seek(0)
        return with_mark(image, read_header(file).has_alpha)


def read_indices(source: Source) -> NDArray[Any]:
    """Read the samples of an image as numbers: the indices of one with a palette, and others as `read_image` does.

    Parameters
    ----------
    source : path, bytes or binary file
        As in `read_image`.

    Returns
    -------
    (H, W) or (H, W, C) array

    Raises
    ------
    OSError
        As `read_image` does.

    Examples
    --------
    >>> palette = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)
    >>> read_indices(encode_image(".png", np.array([[0, 1, 1]]), palette=palette)).tolist()
    [[0, 1, 1]]
    """
    with reading(source) as file:
        return decode(file, indices=True)


def image_info(source: Source) -> ImageInfo:
    """Read the header of an image file, and no pixels.

    Parameters
    ----------
    source : path, bytes or binary file
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
    with reading(source) as file:
        return read_header(file)


def read_metadata(source: Source, *, keep_profile: bool = False) -> Metadata:
    """Read what can be kept of an image file beside the pixels, for `write_image`.

    Parameters
    ----------
    source : path, bytes or binary file
        As in `read_image`.
    keep_profile : bool
        Whether `read_image` keeps the profile, too.

    Returns
    -------
    Metadata
        Color profile, pixels per inch, EXIF without orientation, and where a GeoTIFF lies; for a TIFF of bands, the
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
    with reading(source) as file:
        return decode_metadata(file, keep_profile=keep_profile)


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
    """Write an image whole or not at all, in the format that the suffix names.

    Parameters
    ----------
    path : str or path-like
        Ends in .png, .tif, .tiff, .webp (lossless), .gif, .bmp, .ppm, .pgm, .npy, .jpg or .jpeg,
        or .avif where Pillow has it.
    image : ndarray
        (H, W) bool, uint8 or uint16, or (H, W, 3) or (H, W, 4) uint8 or uint16 (in .png and .tif), in sRGB. A .tif or
        .npy takes any bands of integers, float32 or float64. With a palette (H, W) integers in 0..K-1.
    palette : ndarray, (K, 3) or (K, 4) uint8, 1 <= K <= 256, optional
        Writes an indexed image; a PNG of 1, 2, 4 or 8 bits per pixel, as K needs. Formats without palettes, or without
        transparency in them, get the same colors as RGB or RGBA. Lossy formats are refused.
    alpha : bool, optional
        Whether the last band is transparency. By default as `read_image` and `quantize` mark it; the last of four
        unmarked bands is in .png and .webp, and is a band like others in .tif and .npy.
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
