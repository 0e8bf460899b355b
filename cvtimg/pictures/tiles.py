"""Read and write images larger than memory (TIFF and Zarr), a band of rows at a time.

A band consists of whole rows of tiles, strips or chunks, about `PIXELS_AT_ONCE` pixels in all. Only a few bands are in
memory at any time.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from cvtimg._shared.budgets import MOST_IN_MEMORY, PIXELS_AT_ONCE
from cvtimg._shared.choices import Arguments
from cvtimg._shared.extras import optional
from cvtimg._shared.threads import n_threads
from cvtimg._shared.types import Array, Bytes
from cvtimg.files.remote import url_of
from cvtimg.files.whole import StrPath, whole_file, whole_folder
from cvtimg.pictures.formats.geotiff import Place, extra_tags, geo_tags
from cvtimg.pictures.formats.opening import UnfitContentError, reading
from cvtimg.pictures.formats.stored import is_stored
from cvtimg.pictures.formats.tiff import TIFF_MAGICS, Layout, check_alone, icc_profile, size_of, tiff_tags, write_tiff

#: Suffixes of files that are written in tiles.
TILED_SUFFIXES = (".tif", ".tiff", ".zarr")
#: Sample types that can be read in bands.
SAMPLES = (*(f"{kind}{bits}" for bits in (8, 16, 32, 64) for kind in ("uint", "int")), "float32", "float64")

Band: TypeAlias = Array
#: Height and width of tiles, and of chunks of Zarr, that are written.
_TILE, _CHUNK = 256, 1024


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """Shape, sample type and metadata of an image file.

    Attributes
    ----------
    shape : tuple of int
        (H, W) or (H, W, C).
    dtype : numpy.dtype
        Any integer type, float32 or float64.
    alpha : bool
        Whether the last of several bands is transparency.
    icc : bytes or None
        Color profile; colors are not converted, and are written with the same profile.
    geo : mapping of int
        Georeferencing tags of a GeoTIFF, as in `Metadata`.
    nodata : float or None
        Value that marks missing pixels in a GeoTIFF.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    alpha: bool = False
    icc: bytes | None = None
    geo: Mapping[int, Any] = field(default_factory=dict)
    nodata: float | None = None

    @property
    def n_pixels(self) -> int:
        """Number of pixels."""
        return self.shape[0] * self.shape[1]


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """An image on disk; each iteration reads it from top to bottom, one band of rows at a time."""

    form: Form
    read: Callable[[], Iterator[Band]]

    def __iter__(self) -> Iterator[Band]:
        return self.read()


def band_height(width: int, piece: int) -> int:
    """Return the number of rows of a band: a multiple of the tile height, for about `PIXELS_AT_ONCE` pixels."""
    return max(1, PIXELS_AT_ONCE // (width * piece)) * piece


def in_heights(bands: Iterable[Band], height: int) -> Iterator[Band]:
    """Regroup rows into bands of the given height; the last may be shorter."""
    left: list[Band] = []
    for band in bands:
        rows = np.concatenate([*left, band]) if left else band
        n_whole = len(rows) // height * height
        yield from (rows[top : top + height] for top in range(0, n_whole, height))
        left = [rows[n_whole:]] if n_whole < len(rows) else []
    yield from left


def open_bands(path: StrPath) -> Bands:
    """Open a TIFF (tiles or strips, BigTIFF too) or a Zarr array: a folder ".zarr", or the array "0" of a group.

    Raises `OSError` if the file cannot be read in tiles; the message says why.
    """
    if Path(path).suffix.lower() == ".zarr":
        return _open_zarr(path)
    return _open_tiff(path)


def write_bands(
    path: StrPath, form: Form, bands: Iterable[Band], *, palette: Bytes | None = None, overwrite: bool = False
) -> None:
    """Write bands of rows from top to bottom, of any height, as an image in tiles: .tif, or .zarr without palette.

    With a (K, 3) uint8 palette, the bands are indices.
    """
    if Path(path).suffix.lower() == ".zarr":
        import zarr

        chunks = (min(_CHUNK, form.shape[0]), min(_CHUNK, form.shape[1]), *form.shape[2:])
        with whole_folder(path, overwrite=overwrite) as folder:
            array = zarr.create_array(str(folder), shape=form.shape, chunks=chunks, dtype=form.dtype, overwrite=True)
            top = 0
            for band in in_heights(bands, chunks[0]):
                array[top : top + len(band)] = band
                top += len(band)
        return
    with whole_file(path, overwrite=overwrite) as file:
        told: Arguments = {"iccprofile": form.icc, "extratags": extra_tags(form.geo, form.nodata), "palette": palette}
        told |= {"tile": (_TILE, _TILE), "compressionargs": {"level": 3}, "buffersize": PIXELS_AT_ONCE}
        write_tiff(file, _tiles(bands, _TILE), form.shape, form.dtype, alpha=form.alpha, **told)


def needs_tiles(source: StrPath, target: StrPath) -> bool:
    """Return whether to process an image in tiles: if it is large or a Zarr array, but not one of OME-Zarr."""
    suffixes = {Path(path).suffix.lower() for path in (source, target)}
    if is_stored(source) and Path(target).suffix.lower() != ".zarr":
        return False
    if ".zarr" in suffixes:
        return True
    if not suffixes <= {".tif", ".tiff"}:
        return False
    try:
        return open_bands(source).form.n_pixels > MOST_IN_MEMORY
    except OSError:  # the usual reader opens it or reports the error
        return False


def _open_tiff(path: StrPath) -> Bands:
    with reading(path) as file:
        import tifffile

        if not file.read(4).startswith(TIFF_MAGICS):
            raise UnfitContentError("cannot be read in tiles: it is neither a TIFF file nor a Zarr array")
        file.seek(0)
        with tifffile.TiffFile(file) as tiff:
            page = tiff.pages.first
            tags = tiff_tags(page)
            check_alone(file)
            _check_page(page)
            shape = (*size_of(page), *([page.samplesperpixel] if page.samplesperpixel > 1 else []))
            place, layout = Place.of(tags), Layout.of(tags)
            form = Form(shape, np.dtype(page.dtype), layout.alpha, icc_profile(tags), geo_tags(tags), place.nodata)
    return Bands(form, lambda: _read(path, form))


def _check_page(page: Any) -> None:
    color, coding = page.photometric.name, page.compression.name
    plain = color in ("MINISBLACK", "RGB") or (color, coding) == ("YCBCR", "JPEG")  # which is decoded to RGB
    problem = ""
    if not plain or str(page.dtype) not in SAMPLES or page.bitspersample % 8 or page.fillorder != 1:
        problem = f"its samples are {page.photometric.name}, {page.bitspersample} bits"
    elif page.samplesperpixel > 1 and page.planarconfig != 1:
        problem = "its bands lie one after the other"
    elif page.tags.valueof("Orientation", 1) != 1:
        problem = "it lies on its side"
    # A band of four doubles for each pixel: reading a larger piece would be like reading the whole image.
    elif not _is_plain(page) and math.prod(page.chunks) * page.dtype.itemsize > 32 * PIXELS_AT_ONCE:
        problem = "it is one piece"
    if problem:
        raise UnfitContentError(f"cannot be read in tiles: {problem}")


def _is_plain(page: Any) -> bool:
    return page.is_contiguous and not page.is_tiled and page.compression == 1


def _read(path: StrPath, form: Form) -> Iterator[Band]:
    import tifffile

    with reading(path) as file, tifffile.TiffFile(file) as tiff:
        page = tiff.pages.first
        if _is_plain(page):
            form_in_file = page.parent.byteorder + form.dtype.char
            values = np.memmap(file, form_in_file, "r", page.dataoffsets[0], form.shape)
            height = band_height(form.shape[1], 1)
            for top in range(0, form.shape[0], height):
                yield np.array(values[top : top + height], form.dtype)
        else:
            yield from _read_pieces(page, form)


def _read_pieces(page: Any, form: Form) -> Iterator[Band]:
    """Collect tiles or strips, which arrive row by row, into bands."""
    n_rows, width = form.shape[:2]
    piece = page.tilelength if page.is_tiled else page.rowsperstrip
    height = band_height(width, min(piece, n_rows))
    band, first = np.zeros((min(height, n_rows), *form.shape[1:]), form.dtype), 0
    # By default, tifffile would read 256 MB before decoding; it counts bytes before that.
    at_once = PIXELS_AT_ONCE * sum(page.databytecounts) // page.nbytes
    pieces = page.segments(maxworkers=n_threads(), buffersize=at_once)
    for pixels, (_, _, top, left, _), (_, n, m, _) in pieces:
        if top >= first + len(band):
            yield band
            first += len(band)
            band = np.zeros((min(height, n_rows - first), *form.shape[1:]), form.dtype)
        if pixels is not None:  # None is a tile that was never written
            part = band[top - first : top - first + n, left : left + m]
            part[:] = pixels[0, : part.shape[0], : part.shape[1]].reshape(part.shape)
    yield band


def _tiles(bands: Iterable[Band], side: int) -> Iterator[Band]:
    """Cut bands into tiles, left to right and top to bottom, padded with zeros at the edges."""
    for band in in_heights(bands, side):
        for left in range(0, band.shape[1], side):
            part = band[:, left : left + side]
            tile = np.zeros((side, side, *band.shape[2:]), band.dtype)
            tile[: part.shape[0], : part.shape[1]] = part
            yield tile


def _open_zarr(path: StrPath) -> Bands:
    zarr = optional("zarr", "zarr", f"{path}: needs")
    try:
        array = zarr.open(url_of(path), mode="r")
        array = array["0"] if isinstance(array, zarr.Group) else array
    except Exception as error:  # zarr raises many kinds of errors for damaged metadata
        raise OSError(f"{path}: is not a Zarr array ({type(error).__name__})") from error
    if array.ndim not in (2, 3) or 0 in array.shape or str(array.dtype) not in SAMPLES:
        raise OSError(
            f"{path}: holds {array.dtype} of shape {array.shape}; it must be (H, W) or (H, W, C), "
            "of integers, float32 or float64"
        )
    form = Form(array.shape, np.dtype(array.dtype))

    def read() -> Iterator[Band]:
        height = band_height(form.shape[1], min(array.chunks[0], form.shape[0]))
        for top in range(0, form.shape[0], height):
            yield np.ascontiguousarray(array[top : top + height])

    return Bands(form, read)
