"""Images in blocks: Dask arrays of pixels, and labeled arrays of xarray, of any number of dimensions."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_numbers, check_shape
from cvtimg._shared.pixels import is_known
from cvtimg._shared.threads import one_thread
from cvtimg.blocks.passes import add_up
from cvtimg.blocks.rows import dask_arrays

__all__ = ["PixelBlocks", "is_image_in_blocks"]

T = TypeVar("T")

#: Names of dimensions that hold the bands of a pixel.
BAND_DIMS = ("band", "bands", "channel", "channels", "c", "rgb", "wavelength")
#: Where a labeled array says which value means that there is none.
_NODATA = ("_FillValue", "nodata", "missing_value")


def is_image_in_blocks(image: object) -> bool:
    """Whether an image is a Dask array, or a labeled array of xarray."""
    return type(image).__module__.partition(".")[0] in ("dask", "xarray")


@dataclass(frozen=True, slots=True, eq=False)
class PixelBlocks:
    """Pixels in blocks, their bands last."""

    pixels: Any  # (..., C): all bands of a pixel are in one block
    # The value of pixels that do not count: those that have it in all bands. Nor do those that are not finite.
    nodata: float | None
    band: int | None  # Which dimension of the image holds the bands; None if each pixel is a single value
    like: Any  # What the results are labeled like

    @classmethod
    def of(cls, image: Any, nodata: float | None = None) -> PixelBlocks:
        """Return a Dask array or DataArray in blocks; `nodata` is by default what the attributes say."""
        # A Dask array is (H, W), (H, W, C) or a stack (T, ..., H, W, C). The bands of a DataArray are its dimension of
        # one of the names in `BAND_DIMS`; any others, such as time, y and x, make the pixels.
        da = dask_arrays()
        like, array = None, image
        if type(image).__module__.partition(".")[0] == "xarray":
            like, array = image, image.data
            names = [str(name).lower() for name in image.dims]
            band = next((names.index(name) for name in BAND_DIMS if name in names), None)
            if nodata is None:
                said = {**image.encoding, **image.attrs}
                nodata = next((said[name] for name in _NODATA if name in said), None)
        else:
            band = None if image.ndim == 2 else image.ndim - 1
        if not isinstance(array, da.Array):
            array = da.from_array(np.asarray(array), chunks=-1)
        allowed = "(H, W), (H, W, C) or (T, ..., H, W, C), none of them 0"
        check_shape("image", array.shape, array.ndim - (band is not None) >= 1 and 0 not in array.shape, allowed)
        check_numbers("image", array.dtype)
        pixels = array[..., None] if band is None else da.moveaxis(array, band, -1)
        return cls(pixels.rechunk({pixels.ndim - 1: -1}), nodata, band, like)

    def total(self, count: Callable[[NDArray[Any]], T], add: Callable[[Sequence[T]], T]) -> T:
        """Return the sum of what `count` makes of the (n, C) pixels of each block that count, as in `over_blocks`."""
        parts = [(part,) for part in self.pixels.to_delayed().ravel().tolist()]
        # What is in memory is worked on where it is, perhaps by a task of a cluster.
        scheduler = None if self._is_lazy else "sync"
        return add_up(parts, _counted, add, self.nodata, count, name="count", scheduler=scheduler)

    def mapped(self, function: Callable[[NDArray[Any]], NDArray[Any]], dtype: Any, n_bands: int | None = None) -> Any:
        """Return what a function makes of the (n, C) pixels of each block that count, labeled as the image is."""
        # It makes (n,) values, or (n, n_bands); pixels that do not count become 0.
        from dask.delayed import delayed

        ndim = self.pixels.ndim - (n_bands is None)
        found = self.pixels.map_blocks(
            _mapped_block,
            function=delayed(function, traverse=False, pure=True),
            nodata=self.nodata,
            out=np.dtype(dtype),
            n_bands=n_bands,
            dtype=dtype,
            drop_axis=[self.pixels.ndim - 1] if n_bands is None else [],
            chunks=(*self.pixels.chunks[:-1], *(() if n_bands is None else ((n_bands,),))),
            meta=np.empty((0,) * ndim, dtype),
        )
        return self._labeled(found, n_bands)

    @property
    def _is_lazy(self) -> bool:
        return self.like is None or isinstance(self.like.data, dask_arrays().Array)

    def _labeled(self, found: Any, n_bands: int | None) -> Any:
        dims = [] if self.like is None else [name for at, name in enumerate(self.like.dims) if at != self.band]
        if n_bands is not None and self.band is not None:
            found = dask_arrays().moveaxis(found, -1, self.band)
            dims = [] if self.like is None else list(self.like.dims)
        elif n_bands == 1:
            found = found[..., 0]
        elif n_bands is not None:
            dims.append(BAND_DIMS[0])
        if self.like is None:
            return found
        sizes = dict(zip(dims, found.shape, strict=True))
        coords = {
            name: coord
            for name, coord in self.like.coords.items()
            if all(sizes.get(dim) == size for dim, size in coord.sizes.items())
        }
        values = found if self._is_lazy else found.compute(scheduler="sync")
        library: Any = sys.modules["xarray"]
        return library.DataArray(values, coords, dims, name=self.like.name)


def _counted(number: int, block: Any, nodata: float | None, count: Callable[[NDArray[Any]], T]) -> T:
    return count(np.ascontiguousarray(block[is_known(block, nodata)]))


def _mapped_block(
    block: NDArray[Any],
    *,
    function: Callable[[NDArray[Any]], NDArray[Any]],
    nodata: float | None,
    out: np.dtype[Any],
    n_bands: int | None,
) -> NDArray[Any]:
    inside = is_known(block, nodata)
    result = np.zeros((*inside.shape, *(() if n_bands is None else (n_bands,))), out)
    if inside.any():
        with one_thread():
            result[inside] = function(np.ascontiguousarray(block[inside]))
    return result
