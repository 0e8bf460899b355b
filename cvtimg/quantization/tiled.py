"""Color quantization of images larger than memory: one pass through the file to count colors, one to map them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import prod
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_colors, check_one_of, check_that
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import peak, white_of
from cvtimg.colors.counting import Counter
from cvtimg.colors.fidelity import psnr
from cvtimg.colors.places import CLEAR, kinds_of
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
from cvtimg.pictures.known import with_known
from cvtimg.pictures.tiles import TILED_SUFFIXES, Band, Bands, open_bands, write_bands
from cvtimg.quantization.palette_search import EngineOptions, find_palette
from cvtimg.quantization.remapping import map_to_palette

__all__ = ["QuantizedFile", "quantize_file"]


@dataclass(frozen=True, slots=True, eq=False)
class QuantizedFile:
    """The result of quantizing an image on disk.

    Attributes
    ----------
    palette, tessellation, alpha
        As in `Quantized`.
    shape : tuple of int
        Shape of the image: (H, W) or (H, W, C).
    energy : float
        As in `Quantized`; exact even if `exact` is false.
    n_distinct : int
        Number of distinct colors of the original; if `exact` is false and pixels have more than three bytes, the
        largest number held at a time.
    exact : bool
        Whether the palette was found from all distinct colors. Beyond 2^22 (`cvtimg.colors.counting.MOST_COLORS`),
        neighboring colors were merged first.
    n_left_out : int
        Number of pixels that do not count.
    """

    palette: NDArray[Any]
    shape: tuple[int, ...]
    energy: float
    tessellation: Tessellation | None
    n_distinct: int
    exact: bool
    alpha: bool = False
    n_left_out: int = 0

    def __repr__(self) -> str:
        """Tell size, colors and error in one line."""
        shape = " x ".join(map(str, self.shape))
        return f"QuantizedFile({shape}, {len(self.palette)} of {self.n_distinct} colors, PSNR {self.psnr:.2f} dB)"

    @property
    def mse(self) -> float:
        """Mean squared error per sample, alpha not counted."""
        n_pixels = prod(self.shape[:2]) - self.n_left_out
        return float(self.energy / (n_pixels * (self.palette.shape[1] - self.alpha)))

    @property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio in dB, as in `Quantized`."""
        return float(psnr(self.mse, peak(self.palette.dtype)))


def quantize_file(
    source: StrPath,
    target: StrPath,
    n_colors: int | None = None,
    *,
    space: SpaceName = "rgb",
    palette: ArrayLike | None = None,
    locked: ArrayLike | None = None,
    mask: StrPath | None = None,
    nodata: float | None = None,
    overwrite: bool = False,
    **engine: Unpack[EngineOptions],
) -> QuantizedFile:
    """Quantize an image on disk, of any size.

    The palette is that of the whole image, so there are no seams. Memory does not grow with the image: a few strips of
    about 2^23 pixels (`cvtimg.pictures.tiles.BAND_PIXELS`), or of one row of tiles if that is more, and at most 2^22
    distinct colors, beyond which neighbors are merged: under 2 GiB for RGB.

    Parameters
    ----------
    source : path
        A TIFF or BigTIFF in tiles or strips, or a Zarr array in a folder that ends in .zarr: any integer type,
        float32 or float64, (H, W) or (H, W, C). The last band is alpha if the file says so.
    target : path
        Ends in .tif, .tiff or .zarr. Up to 256 colors of 8-bit RGB are written as an indexed TIFF; a Zarr array holds
        the image in its new colors. A TIFF keeps the color profile and the georeference.
    n_colors : int
        Size of the palette, in 1..65536; not allowed with `palette`.
    space, palette, locked, method, init, effort, volume_power, rng, callback
        As in `quantize`.
    mask : path, optional
        Image of the same size, whose black pixels are left out: they have no influence and keep their value, or become
        transparent in 8-bit gray and RGB.
    nodata : float, optional
        Pixels with this value in all bands are left out, as are those that are NaN or infinite. If the file declares
        the same value, they keep it.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    QuantizedFile

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it, its value and what is allowed.
    OSError
        If a file cannot be read in tiles, or written.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from cvtimg import read_image, write_image
    >>> from cvtimg.quantization import quantize_file
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.tif", np.array([[[10, 12, 200], [11, 202, 201], [12, 12, 200]]], np.uint8))
    ...     result = quantize_file(f"{folder}/a.tif", f"{folder}/b.tif", 2)
    ...     read_image(f"{folder}/b.tif").tolist(), result.energy
    ([[[11, 12, 200], [11, 202, 201], [11, 12, 200]]], 2.0)
    """
    check_choice(f"{target}: suffix", Path(target).suffix.lower(), TILED_SUFFIXES)
    check_one_of(n_colors=n_colors, palette=palette)
    bands = open_bands(source)
    counter = Counter(alpha=bands.form.alpha)
    known = partial(with_known, bands, mask, nodata, has_alpha=bands.form.alpha)
    for band, inside in known():
        if inside.any():
            counter.add(band if inside.all() else band[inside][None])
    check_that("image", counter.has_any, "have at least one pixel that is not left out")
    samples, exact = counter.samples(), counter.exact
    tessellation = None
    if palette is None:
        assert n_colors is not None
        found = find_palette(samples, n_colors, space=space, locked=locked, **engine)
        colors, tessellation = found.colors, found.tessellation
    else:
        colors = check_colors("palette", palette, samples.colors.dtype)
    alpha = samples.alpha and colors.shape[1] == samples.colors.shape[1]
    if alpha and CLEAR in kinds_of(samples.colors, alpha) and CLEAR not in kinds_of(colors, alpha):
        colors = np.concatenate([colors, np.zeros_like(colors[:1])])
    n_distinct = counter.n_distinct
    del samples, counter  # which take more memory than the bands
    leaves_out = mask is not None or nodata is not None
    mapping = _Mapping(bands, known, colors, space, Path(target).suffix.lower() != ".zarr", leaves_out)
    write_bands(target, mapping.form, mapping, palette=mapping.indexed, overwrite=overwrite)
    return QuantizedFile(
        palette=mapping.palette,
        shape=bands.form.shape,
        energy=mapping.energy,
        tessellation=tessellation,
        n_distinct=n_distinct,
        exact=exact,
        alpha=mapping.alpha,
        n_left_out=mapping.n_left_out,
    )


class _Mapping:
    """The strips of an image in the colors of a palette, and the energy of those done so far."""

    def __init__(
        self,
        bands: Bands,
        known: Callable[[], Iterator[tuple[Band, NDArray[np.bool_]]]],
        palette: NDArray[Any],
        space: SpaceName,
        may_be_indexed: bool,
        leaves_out: bool,
    ) -> None:
        # One pixel shows how a palette and an image of unequal channels agree.
        form = bands.form
        white = np.full((1, 1, *form.shape[2:]), white_of(form.dtype), form.dtype)
        pixel = map_to_palette(white, palette, alpha=form.alpha, space=space)
        self.palette, self.alpha = palette, pixel.alpha and pixel.palette.shape[1] == np.shape(palette)[1]
        self.energy, self.n_left_out = 0.0, 0
        self._known, self._space, self._alpha = known, space, form.alpha
        n_channels = pixel.palette.shape[1]
        keeps_nodata = leaves_out and form.nodata is not None and not (palette == form.nodata).all(axis=1).any()
        eight_bit = palette.dtype == np.uint8 and n_channels in (1, 3)
        fits = len(palette) <= 256 and eight_bit and n_channels == 3
        self.indexed = pixel.palette if may_be_indexed and fits and not leaves_out else None
        self._clears = leaves_out and eight_bit and not keeps_nodata
        # A color that is the mean of others, or an index, is not the value of unknown pixels.
        nodata = form.nodata if keeps_nodata else None
        shape = form.shape[:2] if n_channels == 1 or self.indexed is not None else (*form.shape[:2], n_channels)
        if self._clears:
            shape = (*form.shape[:2], 4)
        alpha = self._clears or (form.alpha and shape == form.shape)
        self.form = replace(form, shape=shape, alpha=alpha, nodata=nodata)

    def __iter__(self) -> Iterator[Band]:
        for band, inside in self._known():
            self.n_left_out += int(np.count_nonzero(~inside))
            if not inside.any():
                yield self._left_out(band)
                continue
            mask = None if inside.all() else inside
            result = map_to_palette(band, self.palette, alpha=self._alpha, mask=mask, space=self._space)
            self.energy += result.energy
            if self.indexed is not None:
                yield result.indices
            elif self._clears:
                colors = np.broadcast_to(result.palette, (len(result.palette), 3))[result.indices]
                yield np.concatenate([colors * inside[..., None], inside[..., None] * np.uint8(255)], axis=2)
            else:
                yield result.image.reshape(len(band), *self.form.shape[1:])

    def _left_out(self, band: Band) -> Band:
        """Return a band of which no pixel counts."""
        shape = (len(band), *self.form.shape[1:])
        return band if band.shape == shape and not self._clears else np.zeros(shape, self.form.dtype)
