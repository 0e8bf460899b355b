"""Read and write TIFF and BigTIFF a band of rows at a time, in tiles or strips."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import n_threads
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.bands import SAMPLES, Band, Bands, Form, band_height, in_heights
from cvtimg.pictures.formats.geotiff import Place, extra_tags, geo_tags
from cvtimg.pictures.formats.opening import UnfitContentError, reading
from cvtimg.pictures.formats.tiff import (
    TIFF_MAGICS,
    Layout,
    count_pages,
    icc_profile,
    sample_options,
    size_of,
    tiff_tags,
)

__all__ = ["open_tiff", "write_tiff"]

#: Larger strips or tiles, in bytes, are rejected: reading one would be like reading the whole image.
_MOST_AT_ONCE = 1 << 28
#: Bytes of tiles that are decoded or encoded in parallel.
_AT_ONCE = 1 << 24
_TILE = 256
#: Gray (0 is black), RGB, and YCbCr in JPEG, which is decoded to RGB.
_GRAY, _RGB, _YCBCR, _JPEG = 1, 2, 6, 7
_ORIENTATION = 274
#: Images with more bytes before compression are written as BigTIFF.
_BIG = 1 << 31


def open_tiff(path: StrPath) -> Bands:
    """Open a TIFF with a single page."""
    with reading(path) as file:
        import tifffile

        if not file.read(4).startswith(TIFF_MAGICS):
            raise UnfitContentError("cannot be read in tiles: it is neither a TIFF file nor a Zarr array")
        file.seek(0)
        with tifffile.TiffFile(file) as tiff:
            page, tags = tiff.pages.first, tiff_tags(tiff)
            if (n_pages := count_pages(file)) > 1:
                raise UnfitContentError(f"has {n_pages} pages, where one image is expected")
            _check_page(page)
            shape = (*size_of(page), *([page.samplesperpixel] if page.samplesperpixel > 1 else []))
            place, layout = Place.of(tags), Layout.of(tags)
            form = Form(shape, np.dtype(page.dtype), layout.alpha, icc_profile(tags), geo_tags(tags), place.nodata)
    return Bands(form, lambda: _read(path, form))


def _check_page(page: Any) -> None:
    """Reject pages that cannot be read in tiles."""
    plain = page.photometric in (_GRAY, _RGB) or (page.photometric, page.compression) == (_YCBCR, _JPEG)
    problem = ""
    if not plain or str(page.dtype) not in SAMPLES or page.bitspersample % 8 or page.fillorder != 1:
        problem = f"its samples are {page.photometric.name}, {page.bitspersample} bits"
    elif page.samplesperpixel > 1 and page.planarconfig != 1:
        problem = "its bands lie one after the other"
    elif page.tags.valueof(_ORIENTATION, 1) != 1:
        problem = "it lies on its side"
    elif not _is_plain(page) and math.prod(page.chunks) * page.dtype.itemsize > _MOST_AT_ONCE:
        problem = "it is one piece"
    if problem:
        raise UnfitContentError(f"cannot be read in tiles: {problem}")


def _is_plain(page: Any) -> bool:
    """Return whether all pixels are contiguous in the file."""
    return page.is_contiguous and not page.is_tiled and page.compression == 1


def _read(path: StrPath, form: Form) -> Iterator[Band]:
    import tifffile

    with reading(path) as file, tifffile.TiffFile(file) as tiff:
        page = tiff.pages.first
        if _is_plain(page):
            yield from _read_plain(page, form)
        else:
            yield from _read_pieces(page, form)


def _read_plain(page: Any, form: Form) -> Iterator[Band]:
    height, (n_rows, width) = band_height(form.shape[1], 1), form.shape[:2]
    file = page.parent.filehandle
    for top in range(0, n_rows, height):
        n = min(height, n_rows - top)
        file.seek(page.dataoffsets[0] + top * (page.nbytes // n_rows))
        flat = file.read_array(
            page.parent.byteorder + page.dtype.char, n * page.nbytes // n_rows // page.dtype.itemsize
        )
        yield flat.reshape(n, width, *form.shape[2:]).astype(form.dtype, copy=False)


def _read_pieces(page: Any, form: Form) -> Iterator[Band]:
    """Collect tiles or strips, which arrive row by row, into bands."""
    n_rows, width = form.shape[:2]
    piece = page.tilelength if page.is_tiled else page.rowsperstrip
    height = band_height(width, min(piece, n_rows))
    band, first = np.zeros((min(height, n_rows), *form.shape[1:]), form.dtype), 0
    for pixels, (_, _, top, left, _), (_, n, m, _) in _pieces(page):
        if top >= first + len(band):
            yield band
            first += len(band)
            band = np.zeros((min(height, n_rows - first), *form.shape[1:]), form.dtype)
        if pixels is not None:  # None is a tile that was never written
            part = band[top - first : top - first + n, left : left + m]
            part[:] = pixels[0, : part.shape[0], : part.shape[1]].reshape(part.shape)
    yield band


def _pieces(page: Any) -> Iterator[Any]:
    """Decode tiles or strips in parallel, fewer at a time than tifffile, which would read 256 MB before decoding."""
    n_pieces = math.prod(page.chunked)
    at_once = max(n_threads(), _AT_ONCE // (math.prod(page.chunks) * page.dtype.itemsize))
    of_jpeg = {"jpegtables": page.jpegtables, "jpegheader": page.jpegheader} if page.compression == _JPEG else {}
    with ThreadPoolExecutor(n_threads()) as pool:
        for first in range(0, n_pieces, at_once):
            some = range(first, min(first + at_once, n_pieces))
            where = (numbers[first : some.stop] for numbers in (page.dataoffsets, page.databytecounts))
            coded = page.parent.filehandle.read_segments(*where, some, sort=False)
            yield from pool.map(lambda piece: page.decode(*piece, **of_jpeg), coded)


def write_tiff(file: BinaryIO, form: Form, bands: Iterable[Band], palette: NDArray[np.uint8] | None) -> None:
    """Write a TIFF in tiles; with a (K, 3) uint8 palette, the bands are indices."""
    import tifffile

    colormap = None
    if palette is not None:
        colormap = np.zeros((3, 256), np.uint16)
        colormap[:, : len(palette)] = palette.T.astype(np.uint16) * 257
    samples = sample_options(form.shape, form.alpha)
    tifffile.imwrite(
        file,
        _tiles(bands),
        shape=form.shape,
        dtype=form.dtype,
        tile=(_TILE, _TILE),
        bigtiff=math.prod(form.shape) * form.dtype.itemsize > _BIG,
        **(samples if colormap is None else {**samples, "photometric": "palette"}),
        colormap=colormap,
        compression="adobe_deflate",
        compressionargs={"level": 3},
        iccprofile=form.icc,
        extratags=extra_tags(form.geo, form.nodata),
        metadata=None,
        software=False,
        maxworkers=n_threads(),
        buffersize=_AT_ONCE,
    )


def _tiles(bands: Iterable[Band]) -> Iterator[Band]:
    """Cut bands into tiles, left to right and top to bottom, padded with zeros at the edges."""
    for band in in_heights(bands, _TILE):
        for left in range(0, band.shape[1], _TILE):
            part = band[:, left : left + _TILE]
            tile = np.zeros((_TILE, _TILE, *band.shape[2:]), band.dtype)
            tile[: part.shape[0], : part.shape[1]] = part
            yield tile
