"""Read image files as upright sRGB arrays, and write them atomically.

A file that cannot be read or written raises an `OSError` with the one-line message ``"{path}: {reason}"``. See `frames`
for animations, `pages` for multi-page files and `tiles` for images larger than memory.
"""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from cvtimg._shared.checks import check_at_least
from cvtimg._shared.types import Array, Bytes
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.decoding import decode
from cvtimg.pictures.formats.encoding import encode_image as encode_image
from cvtimg.pictures.formats.encoding import encoder
from cvtimg.pictures.formats.encoding import image_suffixes as image_suffixes
from cvtimg.pictures.formats.encoding import lossless_suffixes as lossless_suffixes
from cvtimg.pictures.formats.header import ImageInfo as ImageInfo
from cvtimg.pictures.formats.header import read_header, read_stored
from cvtimg.pictures.formats.metadata import Metadata as Metadata
from cvtimg.pictures.formats.metadata import decode_metadata
from cvtimg.pictures.formats.opening import Source, named, reading, selected, selecting, writing
from cvtimg.pictures.formats.stored import is_stored, open_stored
from cvtimg.pictures.pages import one_page, read_pages


def read_image(
    source: Source, *, page: int | None = None, channel_axis: int | None = None, keep_profile: bool = False
) -> Array:
    """Read an image as an upright sRGB array.

    Parameters
    ----------
    source : path, URL, bytes or binary file
        Any raster format that Pillow reads (PNG, JPEG, TIFF, WebP, GIF, BMP, AVIF and others), TIFF with any sample
        type and number of bands, FITS (with ``cvtimg[fits]``), or a .npy array (H, W) or (H, W, C). Only the first
        frame of an animation is read. Use `read_frames` for animations and `read_pages` for multi-page files.
    page : int, optional
        Page to read, from 1, of a file of several pages, planes or frames.
    channel_axis : int, optional
        Axis of the bands in a .npy array of three axes. By default the last; an array whose first axis is at most a
        quarter as long as both others, such as (3, 480, 640), is refused unless this says which.
    keep_profile : bool
        Do not convert colors with an RGB profile, such as Display P3, to sRGB. Write the result with the metadata from
        ``read_metadata(source, keep_profile=True)``.

    Returns
    -------
    ndarray, (H, W) or (H, W, C), C-contiguous
        uint8 (H, W) for 1-bit and gray; uint8 (H, W, 3) for RGB, palette, CMYK, YCbCr and LAB; uint8 (H, W, 4) for
        images with transparency; uint16 of the same shapes for 16-bit gray or RGB in PNG and TIFF. Other integers keep
        the type that the file has, and floating point stays float32 or float64. Images whose bands are not colors are
        (H, W, C) with all bands, C >= 2.

    Raises
    ------
    OSError
        If the file cannot be read, or has several pages and `page` chooses none.

    Notes
    -----
    The EXIF orientation is applied. Colors are converted to sRGB with the embedded ICC profile, if any, and by the
    chunks cICP, gAMA and cHRM of a PNG; 16-bit RGB is converted at full depth. CMYK without a profile is converted by
    complement. Gray with more than 8 bits, floating point samples and bands that are not colors are treated as
    measurements and returned unchanged.

    The last band is treated as transparency only if the file declares it as alpha; see `ImageInfo.has_alpha`. A TIFF
    with three colors and one unspecified band gives all four bands.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3, 3), np.uint8))
    ...     read_image(f"{folder}/a.png").shape
    (2, 3, 3)
    """
    chosen = selected()
    if page is not None:
        chosen = replace(chosen, page=check_at_least("page", page, 1, "the first"))
    if channel_axis is not None:
        chosen = replace(chosen, channel_axis=range(3)[channel_axis])
    with selecting(chosen):
        if chosen.page is None and not chosen.in_stack and not is_stored(source):
            with reading(source) as file:
                return decode(file, keep_profile=keep_profile)
        pages = read_pages(source)
    with named(source):
        return one_page(pages, None)


def read_indices(source: Source) -> Array:
    """Read the indices of an indexed image; read other images as `read_image` does.

    Returns (H, W) integers, or as `read_image`, whose `source` it takes; `cvtimg.read_palette` reads the colors.

    Examples
    --------
    >>> palette = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)
    >>> read_indices(encode_image(".png", np.array([[0, 1, 1]]), palette=palette)).tolist()
    [[0, 1, 1]]
    """
    with reading(source) as file:
        return decode(file, indices=True).view(np.ndarray)


def image_info(source: Source) -> ImageInfo:
    """Read the header of an image file, given as to `read_image`, without decoding its pixels.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3), np.uint16))
    ...     info = image_info(f"{folder}/a.png")
    >>> info.width, info.height, info.bits
    (3, 2, 16)
    """
    if is_stored(source):
        with named(source):
            return read_stored(open_stored(source))
    with reading(source) as file:
        return read_header(file)


def suffix_for(source: StrPath) -> str:
    """Return the suffix of .png, or of a source that holds what .png cannot: frames, pages, other samples, a place."""
    suffix = Path(source).suffix.lower()
    with suppress(OSError):  # which is told when the file is read
        if suffix in (".gif", ".tif", ".tiff", ".npy"):
            info = image_info(source)
            is_signed = info.mode in ("I", "int8", "int16")
            fits = info.bits <= 16 and not is_signed and len(info.bands) - info.has_alpha in (1, 3)
            fits = fits and info.kind == "image"
            return ".png" if fits and info.geo_transform is None else suffix
    return ".png"


def read_metadata(source: Source, *, keep_profile: bool = False) -> Metadata:
    """Read the metadata of an image file that `write_image` can write, with the arguments of `read_image`.

    Color profile, pixels per inch, EXIF without orientation, and the georeferencing of a GeoTIFF. For a TIFF whose
    bands are not colors, only the georeferencing.

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


def read_scale(source: Source, *, nodata: float | None = None) -> Metadata | None:
    """Read where and how large pixels are: what results of an image keep of its file.

    The georeference of a GeoTIFF, with a value of the result that stands for no data; else the size of a pixel; None if
    the file states neither.

    Examples
    --------
    >>> read_scale(encode_image(".png", np.zeros((2, 3), np.uint8))) is None
    True
    """
    info = image_info(source)
    if info.geo_transform is None:
        return Metadata.of_size(info.pixel_size)
    geo = read_metadata(source).geo
    return Metadata(geo=geo, nodata=nodata) if geo else None


def write_image(
    path: StrPath,
    image: Array,
    *,
    palette: Bytes | None = None,
    alpha: bool | None = None,
    metadata: Metadata | None = None,
    optimize: bool = False,
    smallest: bool = False,
    overwrite: bool = False,
) -> None:
    """Write an image atomically, in the format given by the suffix.

    Parameters
    ----------
    path : str or path-like
        Ends in .png, .tif, .tiff, .webp (lossless), .gif, .bmp, .ppm, .pgm, .npy, .jpg, .jpeg,
        or .avif if Pillow supports it.
    image : ndarray
        (H, W) bool, uint8 or uint16, or (H, W, 3) or (H, W, 4) uint8 or uint16 (in .png and .tif), in sRGB. A .tif or
        .npy file takes any number of bands of integers, float32 or float64. With a palette, (H, W) integers in 0..K-1.
    palette : ndarray, (K, 3) or (K, 4) uint8, 1 <= K <= 256, optional
        Write an indexed image. A PNG uses 1, 2, 4 or 8 bits per pixel, the fewest that K allows. Formats without
        palettes, or without transparent palette entries, store the same colors as RGB or RGBA. Lossy formats are not
        allowed.
    alpha : bool, optional
        Whether the last band is transparency. By default, arrays returned by `read_image` and `quantize` remember it.
        For other arrays, the fourth band is transparency in .png and .webp, and an ordinary band in .tif and .npy.
    metadata : Metadata, optional
        Metadata to write, for example from `read_metadata`; what the format cannot store is dropped. A TIFF stores only
        the main EXIF directory, and no EXIF with 16-bit color or with bands that are not colors.
    optimize : bool
        Recompress a .png losslessly with oxipng (``pip install 'cvtimg[oxipng]'``): smaller, but slower.
    smallest : bool
        Write a .png in few bytes, and the colors of a palette as gray or RGB where that takes fewer than indices.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    ValueError
        If the suffix is unknown, or the array or palette does not fit the format.
    OSError
        If the file cannot be written, or exists and `overwrite` is false. No partial file remains, and an existing
        file is unchanged.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     red_blue = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)
    ...     write_image(f"{folder}/a.png", np.array([[0, 1, 1]]), palette=red_blue)
    ...     image_info(f"{folder}/a.png").bits
    1
    """
    write = encoder(Path(path).suffix, image, palette, alpha, metadata, optimize, smallest)
    with writing(path, overwrite=overwrite) as file:
        write(file)
