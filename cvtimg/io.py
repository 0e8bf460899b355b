"""Pictures and files on disk: the only part of cvtimg that reads or writes pictures.

A picture comes in as an upright sRGB array and goes out whole or not at all. Every file that
cannot be read or written ends in an `OSError` that says ``"{path}: {reason}"`` in one line.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.files import StrPath, find_images, one_line, whole_file
from cvtimg.images.decoding import decode, depth, orientation
from cvtimg.images.encoding import encode_image, encoder, lossless_suffixes
from cvtimg.images.opening import opened
from cvtimg.profiles import profile_name

__all__ = [
    "ImageInfo",
    "encode_image",
    "find_images",
    "image_info",
    "lossless_suffixes",
    "read_image",
    "whole_file",
    "write_image",
]


@dataclass(frozen=True, slots=True)
class ImageInfo:
    """What the header of a picture says.

    Attributes
    ----------
    width, height : int
        Size in pixels of the upright picture, as `read_image` returns it.
    format, mode : str
        Pillow's names, such as ``"PNG"`` and ``"RGB"``.
    bands : tuple of str
        Names of the bands, such as ``("R", "G", "B")``.
    bits : int
        Bits a band (an index in a palette picture) in the file.
    frames : int
        How many frames or pages; `read_image` reads the first.
    has_alpha : bool
        Whether the picture carries transparency of any kind.
    icc : str or None
        Description of the embedded colour profile, ``"unreadable"`` for a damaged one.
    """

    width: int
    height: int
    format: str
    mode: str
    bands: tuple[str, ...]
    bits: int
    frames: int
    has_alpha: bool
    icc: str | None


def read_image(path: StrPath) -> NDArray[Any]:
    """Read a picture as an upright sRGB array.

    Parameters
    ----------
    path : str or path-like
        Any raster picture that Pillow reads. Of several frames the first is taken.

    Returns
    -------
    ndarray, (H, W) or (H, W, C), C-contiguous
        uint8 (H, W) for 1-bit and grey; uint8 (H, W, 3) for RGB, palette, CMYK, YCbCr and LAB;
        uint8 (H, W, 4) for whatever has transparency; uint16 (H, W) for 16-bit grey;
        float32 (H, W) for floating point and for 32-bit integers outside 0..65535.

    Raises
    ------
    OSError
        If the file cannot be read; `FileNotFoundError`, `IsADirectoryError` and
        `PermissionError` where they apply.

    Notes
    -----
    Pillow gives 16-bit RGB as 8-bit RGB. Grey beyond 8 bits is taken for a measurement: its
    values stay as they are, without colour profile or transparency.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3, 3), np.uint8))
    ...     read_image(f"{folder}/a.png").shape
    (2, 3, 3)
    """
    with opened(path) as image:
        return decode(image)


def image_info(path: StrPath) -> ImageInfo:
    """Read what the header of a picture says, and no pixels.

    Parameters
    ----------
    path : str or path-like
        Any raster picture that Pillow reads.

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
    with opened(path) as image:
        width, height = image.size
        # Pillow states the size of a TIFF upright already. A PNG's EXIF behind the pixels would
        # cost a decoding.
        known = image.format != "PNG" or "exif" in image.info
        if image.format != "TIFF" and known and orientation(image) >= 5:
            width, height = height, width
        return ImageInfo(
            width=width,
            height=height,
            format=image.format or "",
            mode=image.mode,
            bands=image.getbands(),
            bits=depth(image),
            frames=getattr(image, "n_frames", 1),
            has_alpha=image.has_transparency_data,
            icc=profile_name(image.info.get("icc_profile")),
        )


def write_image(
    path: StrPath,
    image: NDArray[Any],
    *,
    palette: NDArray[np.uint8] | None = None,
    overwrite: bool = False,
) -> None:
    """Write a picture whole or not at all, in the format that the suffix names.

    Parameters
    ----------
    path : str or path-like
        Ends in .png, .tif, .tiff, .webp (lossless), .gif, .bmp, .ppm, .pgm, .jpg or .jpeg.
    image : ndarray
        (H, W) bool, uint8 or uint16, or (H, W, 3) or (H, W, 4) uint8, in sRGB. With a palette
        (H, W) integers in 0..K-1.
    palette : ndarray, (K, 3) or (K, 4) uint8, 1 <= K <= 256, optional
        Writes an indexed picture, a PNG of the smallest of 1, 2, 4 and 8 bits that holds K
        colours. A format without palette or without its transparency gets the same colours as
        RGB or RGBA. No format that loses colours is taken.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
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
    write = encoder(Path(path).suffix, image, palette)
    with whole_file(path, overwrite=overwrite) as file:
        try:
            write(file)
        except Exception as error:  # encoders raise ValueError, OSError, SystemError and others
            raise OSError(f"{path}: cannot be written ({one_line(error)})") from error
