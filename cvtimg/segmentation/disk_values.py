"""Arrays and images larger than memory, with some rows in memory at a time."""

from __future__ import annotations

import os
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import DTypeLike, NDArray

from cvtimg._shared.checks import check_needs
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import peak
from cvtimg.colors.counting import Counter
from cvtimg.colors.spaces import to_space
from cvtimg.files.whole import StrPath
from cvtimg.pictures.known import mask_bands, not_missing
from cvtimg.pictures.tiles import Bands
from cvtimg.segmentation.values import PictureValues, unit_of

#: Pixels of a strip. Values, labels and temporary arrays take about 100 bytes per pixel.
STRIP_PIXELS = 1 << 21
#: Smallest number of rows of a strip: more than the largest disc of neighbors reaches.
_LEAST_ROWS = 32
#: Bytes that are written at a time where the system cannot allocate a file.
_AT_ONCE = 1 << 24


class DiskRows:
    """An array of zeros in a file, of which slices of rows are mapped into memory."""

    def __init__(self, path: Path, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        self.shape, self.dtype, self._path = shape, np.dtype(dtype), path
        self._n_bytes = prod(shape[1:]) * self.dtype.itemsize
        with path.open("wb") as file:
            _allocate(file, shape[0] * self._n_bytes)

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        first, last, _ = rows.indices(self.shape[0])
        shape = (last - first, *self.shape[1:])
        return np.memmap(self._path, self.dtype, "r+", first * self._n_bytes, shape)


def _allocate(file: BinaryIO, n_bytes: int) -> None:
    """Take the room on the disk now: a full one is an error here, but ends the program where a file is mapped."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, n_bytes)
        return
    for left in range(n_bytes, 0, -_AT_ONCE):
        file.write(bytes(min(left, _AT_ONCE)))


class DiskValues:
    """The pixels of an image in an uncompressed file, and their colors."""

    # Outside are pixels that are not finite, whose last band is alpha (`has_alpha`) and 0, that are `nodata` in all
    # bands that have color, and those that are black in a mask. `strips` are the rows to hold in memory at a time,
    # `values` the colors of all pixels inside, and `exact` says whether they distinguish all.

    def __init__(
        self,
        bands: Bands,
        path: Path,
        space: SpaceName,
        *,
        has_alpha: bool,
        nodata: float | None,
        mask: StrPath | None = None,
    ) -> None:
        form = bands.form
        n_bands = form.shape[2] if len(form.shape) > 2 else 1
        check_needs("has_alpha", has_alpha, f"more bands than {n_bands}", n_bands > 1)
        self.shape = form.shape[:2]
        self.n_dims = n_bands - has_alpha
        height, width = self.shape
        n_rows = max(STRIP_PIXELS // width, _LEAST_ROWS)
        self.strips = [(first, min(first + n_rows, height)) for first in range(0, height, n_rows)]
        self._has_alpha, self._nodata = has_alpha, nodata
        self._pixels = DiskRows(path, (*self.shape, n_bands), form.dtype)
        self._mask = None if mask is None else DiskRows(path.with_suffix(".mask"), self.shape, np.bool_)
        if self._mask is not None and mask is not None:
            top = 0
            for rows in mask_bands(mask, self.shape):
                self._mask[top : top + len(rows)][:] = rows
                top += len(rows)
        self.values, self.exact = self._count(bands, space)
        self._center = self.values.center

    def _count(self, bands: Bands, space: SpaceName) -> tuple[PictureValues, bool]:
        """Store all pixels and count their colors."""
        counter, top = Counter(), 0
        for band in bands:
            rows = band.reshape(*band.shape[:2], -1)
            self._pixels[top : top + len(rows)][:] = rows
            colors, inside = self._split(rows, top)
            if inside.any():
                counter.add(colors if inside.all() else colors[inside][None])
            top += len(rows)
        count, dtype = counter.total(), self._pixels.dtype
        samples = count.of_some("is known")
        if space == "rgb":
            values = PictureValues(np.empty((0, 0), np.bool_), samples, 255 / peak(dtype), 0.0, space, dtype)
        else:
            places = to_space(samples.colors.astype(np.float64) / peak(dtype), space) * unit_of(space, dtype)
            samples = replace(samples, rows=places)
            values = PictureValues(np.empty((0, 0), np.bool_), samples, 1.0, 0.0, space, dtype)
        return values, count.exact

    def _split(self, rows: NDArray[Any], top: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Separate the colors of rows, of which `top` is the first, from where they are known."""
        inside = not_missing(rows, self._nodata, has_alpha=self._has_alpha)
        if self._has_alpha:
            inside &= rows[:, :, -1] > 0
        if self._mask is not None:
            inside &= self._mask[top : top + len(rows)]
        return rows[:, :, : self.n_dims], inside

    def read(self, first: int, last: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Return (H, W, D) values of some rows about the mean of all, 0 outside, and (H, W) where they are known."""
        colors, inside = self._split(self._pixels[first:last], first)
        if inside.all():
            return self._field(colors.reshape(-1, self.n_dims)).reshape(colors.shape), inside
        field = np.zeros(colors.shape, np.float32)
        field[inside] = self._field(colors[inside])
        return field, inside

    def __getitem__(self, rows: slice) -> NDArray[np.float32]:
        """Return the values of some rows."""
        return self.read(rows.start, rows.stop)[0]

    def _field(self, colors: NDArray[Any]) -> NDArray[np.float32]:
        """(N, D) values of (N, C) colors about the mean of all."""
        values, scale = self.values, self.values.scale
        if values.space != "rgb":
            colors, scale = to_space(colors.astype(np.float64) / peak(values.dtype), values.space), values.unit
        field = np.empty(colors.shape, np.float32)
        for dim, center in enumerate(self._center):  # long loops, one per dimension
            field[:, dim] = colors[:, dim].astype(np.float64) * scale - center
        return field

    @property
    def variance(self) -> float:
        """Sum over the dimensions of the variance of values."""
        samples, scale = self.values.samples, self.values.scale
        steps = samples.colors * scale - self._center
        return float(np.einsum("n,nd->", samples.density, steps**2) / samples.density.sum())
