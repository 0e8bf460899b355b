"""Pictures larger than memory: TIFF and Zarr read and written some rows at a time.

A band is so many rows of tiles, strips or chunks as have about `BAND_PIXELS` pixels; no more than a few bands are in
memory at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import n_threads
from cvtimg.files.whole import StrPath, whole_file, whole_folder
from cvtimg.pictures.formats.opening import UnfitContentError, reading

__all__ = ["BAND_PIXELS", "TILED_SUFFIXES", "Bands", "Form", "open_bands", "write_bands"]

#: Files that are written by tiles.
TILED_SUFFIXES = (".tif", ".tiff", ".zarr")
BAND_PIXELS = 1 << 23
#: A strip or tile of more bytes could as well be the whole picture.
_MOST_AT_ONCE = 1 << 28
#: Bytes of tiles that are decoded or encoded side by side.
_AT_ONCE = 1 << 24
_TILE = 256
_SAMPLES = ("uint8", "uint16", "float32", "float64")
#: Grey from black, RGB, and JPEG's YCbCr, which comes as RGB.
_GREY, _RGB, _YCBCR, _JPEG = 1, 2, 6, 7
_PALETTE = "palette"
#: Where a GeoTIFF lies.
_GEO_TAGS = (33550, 33922, 34264, 34735, 34736, 34737, 42113)
#: Files of more bytes before compression are written as BigTIFF.
_BIG = 1 << 31

Band: TypeAlias = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """What a picture file holds besides its pixels.

    Attributes
    ----------
    shape : tuple of int
        (H, W) or (H, W, C).
    dtype : numpy.dtype
        uint8, uint16, float32 or float64.
    icc : bytes or None
        Color profile: colors are taken as they are in the file, and written with the same profile.
    geo_tags : tuple
        Where it lies on Earth, as tifffile writes tags.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    icc: bytes | None = None
    geo_tags: tuple[tuple[Any, ...], ...] = ()

    @property
    def n_pixels(self) -> int:
        """Number of pixels."""
        return self.shape[0] * self.shape[1]


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """A picture on disk that is read from above to below, a band of rows after the other, as often as need be."""

    form: Form
    read: Callable[[], Iterator[Band]]

    def __iter__(self) -> Iterator[Band]:
        return self.read()


def open_bands(path: StrPath) -> Bands:
    """Open a TIFF (tiles or strips, BigTIFF too) or a Zarr array.

    Parameters
    ----------
    path : path
        Of a file, or of a folder that ends in .zarr; of a group the array "0" is taken.

    Returns
    -------
    Bands

    Raises
    ------
    OSError
        If the file cannot be read, or is of a kind that cannot be read by tiles; the message says why.
    """
    if Path(path).suffix.lower() == ".zarr":
        return _open_zarr(path)
    with reading(path) as file:
        import tifffile

        with tifffile.TiffFile(file) as tiff:
            page = tiff.pages.first
            _check_page(page)
            tags = ((tag, page.tags[tag]) for tag in _GEO_TAGS if tag in page.tags)
            geo = tuple((code, int(tag.dtype), tag.count, tag.value, True) for code, tag in tags)
            shape = (page.imagelength, page.imagewidth, *([page.samplesperpixel] if page.samplesperpixel > 1 else []))
            form = Form(shape, np.dtype(page.dtype), page.iccprofile, geo)
    return Bands(form, lambda: _read_tiff(path, form))


def _check_page(page: Any) -> None:
    """Refuse what cannot be read by tiles."""
    plain = page.photometric in (_GREY, _RGB) or (page.photometric, page.compression) == (_YCBCR, _JPEG)
    problem = ""
    if not plain or str(page.dtype) not in _SAMPLES or page.bitspersample % 8 or page.fillorder != 1:
        problem = f"its samples are {page.photometric.name}, {page.bitspersample} bits"
    elif page.samplesperpixel > 1 and page.planarconfig != 1:
        problem = "its bands lie one after the other"
    elif page.tags.valueof(274, 1) != 1:
        problem = "it lies on its side"
    elif not _is_plain(page) and math.prod(page.chunks) * page.dtype.itemsize > _MOST_AT_ONCE:
        problem = "it is one piece"
    if problem:
        raise UnfitContentError(f"cannot be read by tiles: {problem}")


def _is_plain(page: Any) -> bool:
    """Whether all pixels lie in the file one after the other."""
    return page.is_contiguous and not page.is_tiled and page.compression == 1


def _read_tiff(path: StrPath, form: Form) -> Iterator[Band]:
    import tifffile

    with reading(path) as file, tifffile.TiffFile(file) as tiff:
        page = tiff.pages.first
        if _is_plain(page):
            yield from _read_plain(page, form)
        else:
            yield from _read_pieces(page, form)


def _read_plain(page: Any, form: Form) -> Iterator[Band]:
    height, (n_rows, width) = _band_height(form.shape[1], 1), form.shape[:2]
    file = page.parent.filehandle
    for top in range(0, n_rows, height):
        n = min(height, n_rows - top)
        file.seek(page.dataoffsets[0] + top * (page.nbytes // n_rows))
        flat = file.read_array(
            page.parent.byteorder + page.dtype.char, n * page.nbytes // n_rows // page.dtype.itemsize
        )
        yield flat.reshape(n, width, *form.shape[2:]).astype(form.dtype, copy=False)


def _read_pieces(page: Any, form: Form) -> Iterator[Band]:
    """Gather tiles or strips, which come row by row, into bands."""
    n_rows, width = form.shape[:2]
    piece = page.tilelength if page.is_tiled else page.rowsperstrip
    height = _band_height(width, min(piece, n_rows))
    band, first = np.zeros((min(height, n_rows), *form.shape[1:]), form.dtype), 0
    for pixels, (_, _, top, left, _), (_, n, m, _) in _pieces(page):
        if top >= first + len(band):
            yield band
            first += len(band)
            band = np.zeros((min(height, n_rows - first), *form.shape[1:]), form.dtype)
        if pixels is not None:  # else a tile that was never written
            part = band[top - first : top - first + n, left : left + m]
            part[:] = pixels[0, : part.shape[0], : part.shape[1]].reshape(part.shape)
    yield band


def _pieces(page: Any) -> Iterator[Any]:
    """Decode tiles or strips, side by side but not so many as tifffile would: 256 MB before they are decoded."""
    n_pieces = math.prod(page.chunked)
    at_once = max(n_threads(), _AT_ONCE // (math.prod(page.chunks) * page.dtype.itemsize))
    of_jpeg = {"jpegtables": page.jpegtables, "jpegheader": page.jpegheader} if page.compression == _JPEG else {}
    with ThreadPoolExecutor(n_threads()) as pool:
        for first in range(0, n_pieces, at_once):
            some = range(first, min(first + at_once, n_pieces))
            where = (numbers[first : some.stop] for numbers in (page.dataoffsets, page.databytecounts))
            coded = page.parent.filehandle.read_segments(*where, some, sort=False)
            yield from pool.map(lambda piece: page.decode(*piece, **of_jpeg), coded)


def _band_height(width: int, piece: int) -> int:
    """Rows of a band: a multiple of the rows of a tile, for about as many pixels as a band has."""
    return max(1, BAND_PIXELS // (width * piece)) * piece


def _open_zarr(path: StrPath) -> Bands:
    array = _zarr_array(path)
    if array.ndim not in (2, 3) or 0 in array.shape or str(array.dtype) not in _SAMPLES:
        raise OSError(f"{path}: holds {array.dtype} of shape {array.shape}; it must be (H, W) or (H, W, C), {_SAMPLES}")
    form = Form(array.shape, np.dtype(array.dtype))

    def read() -> Iterator[Band]:
        height = _band_height(form.shape[1], min(array.chunks[0], form.shape[0]))
        for top in range(0, form.shape[0], height):
            yield np.ascontiguousarray(array[top : top + height])

    return Bands(form, read)


def _zarr_array(path: StrPath) -> Any:
    try:
        import zarr

        found = zarr.open(str(path), mode="r")
        return found["0"] if isinstance(found, zarr.Group) else found
    except ImportError as error:
        raise OSError(f"{path}: needs the package zarr: pip install 'cvtimg[zarr]'") from error
    except Exception as error:  # of damaged metadata it makes any error
        raise OSError(f"{path}: is no Zarr array ({type(error).__name__})") from error


def write_bands(
    path: StrPath,
    form: Form,
    bands: Iterable[Band],
    *,
    palette: NDArray[np.uint8] | None = None,
    overwrite: bool = False,
) -> None:
    """Write a picture by tiles, whole or not at all: .tif, or .zarr without palette.

    Parameters
    ----------
    path : path
        Where the picture shall appear.
    form : Form
        Of what is written.
    bands : iterable of arrays
        From above to below, of any heights.
    palette : (K, 3) uint8 array, optional
        The bands are indices into it.
    overwrite : bool
        Replace what exists.
    """
    if Path(path).suffix.lower() == ".zarr":
        with whole_folder(path, overwrite=overwrite) as folder:
            _write_zarr(folder, form, bands)
        return
    import tifffile

    n_bands = form.shape[2] if len(form.shape) > 2 else 1
    colormap = None
    if palette is not None:
        colormap = np.zeros((3, 256), np.uint16)
        colormap[:, : len(palette)] = palette.T.astype(np.uint16) * 257
    with whole_file(path, overwrite=overwrite) as file:
        tifffile.imwrite(
            file,
            _tiles(bands),
            shape=form.shape,
            dtype=form.dtype,
            tile=(_TILE, _TILE),
            bigtiff=math.prod(form.shape) * form.dtype.itemsize > _BIG,
            photometric=_PALETTE if palette is not None else "rgb" if n_bands in (3, 4) else "minisblack",
            planarconfig="contig" if n_bands > 1 else None,
            extrasamples={1: None, 3: None, 4: ["unassalpha"]}.get(n_bands, ["unspecified"] * (n_bands - 1)),
            colormap=colormap,
            compression="adobe_deflate",
            compressionargs={"level": 3},
            iccprofile=form.icc,
            extratags=form.geo_tags,
            metadata=None,
            software=False,
            maxworkers=n_threads(),
            buffersize=_AT_ONCE,
        )


def _write_zarr(folder: Path, form: Form, bands: Iterable[Band]) -> None:
    import zarr

    chunks = (min(4 * _TILE, form.shape[0]), min(4 * _TILE, form.shape[1]), *form.shape[2:])
    array = zarr.create_array(str(folder), shape=form.shape, chunks=chunks, dtype=form.dtype, overwrite=True)
    top = 0
    for band in _of_height(bands, chunks[0]):
        array[top : top + len(band)] = band
        top += len(band)


def _tiles(bands: Iterable[Band]) -> Iterator[Band]:
    """Cut bands into tiles, from left to right and from above to below, filled up with zeros at the edges."""
    for band in _of_height(bands, _TILE):
        for left in range(0, band.shape[1], _TILE):
            part = band[:, left : left + _TILE]
            tile = np.zeros((_TILE, _TILE, *band.shape[2:]), band.dtype)
            tile[: part.shape[0], : part.shape[1]] = part
            yield tile


def _of_height(bands: Iterable[Band], height: int) -> Iterator[Band]:
    """Give the same rows in bands of so many, but for the last."""
    left: list[Band] = []
    for band in bands:
        rows = np.concatenate([*left, band]) if left else band
        n_whole = len(rows) // height * height
        yield from (rows[top : top + height] for top in range(0, n_whole, height))
        left = [rows[n_whole:]] if n_whole < len(rows) else []
    yield from left
