"""Color quantization of images larger than memory: one pass through the file to count colors, one to map them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_colors, check_one_of
from cvtimg.colors.counting import Counter
from cvtimg.colors.fidelity import psnr
from cvtimg.colors.places import CLEAR, kinds_of
from cvtimg.colors.spaces import peak, white_of
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
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
    """

    palette: NDArray[Any]
    shape: tuple[int, ...]
    energy: float
    tessellation: Tessellation | None
    n_distinct: int
    exact: bool
    alpha: bool = False

    def __repr__(self) -> str:
        """Tell size, colors and error in one line."""
        shape = " x ".join(map(str, self.shape))
        return f"QuantizedFile({shape}, {len(self.palette)} of {self.n_distinct} colors, PSNR {self.psnr:.2f} dB)"

    @property
    def mse(self) -> float:
        """Mean squared error per sample, alpha not counted."""
        return float(self.energy / (prod(self.shape[:2]) * (self.palette.shape[1] - self.alpha)))

    @property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio in dB, as in `Quantized`."""
        return float(psnr(self.mse, peak(self.palette.dtype)))


def quantize_file(
    source: StrPath,
    target: StrPath,
    n_colors: int | None = None,
    *,
    space: str = "rgb",
    palette: ArrayLike | None = None,
    locked: ArrayLike | None = None,
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
    space, palette, locked, method, init, effort, volume_power, rng
        As in `quantize`.
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
    for band in bands:
        counter.add(band)
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
    mapping = _Mapping(bands, colors, space, Path(target).suffix.lower() != ".zarr")
    write_bands(target, mapping.form, mapping, palette=mapping.indexed, overwrite=overwrite)
    return QuantizedFile(
        mapping.palette, bands.form.shape, mapping.energy, tessellation, n_distinct, exact, mapping.alpha
    )


class _Mapping:
    """The strips of an image in the colors of a palette, and the energy of those done so far."""

    def __init__(self, bands: Bands, palette: NDArray[Any], space: str, may_be_indexed: bool) -> None:
        # One pixel shows how a palette and an image of unequal channels agree.
        form = bands.form
        white = np.full((1, 1, *form.shape[2:]), white_of(form.dtype), form.dtype)
        pixel = map_to_palette(white, palette, alpha=form.alpha, space=space)
        self.palette, self.alpha = palette, pixel.alpha and pixel.palette.shape[1] == np.shape(palette)[1]
        self.energy = 0.0
        self._bands, self._space, self._alpha = bands, space, form.alpha
        n_channels = pixel.palette.shape[1]
        fits = len(palette) <= 256 and palette.dtype == np.uint8 and n_channels == 3
        self.indexed = pixel.palette if may_be_indexed and fits else None
        shape = form.shape[:2] if n_channels == 1 or self.indexed is not None else (*form.shape[:2], n_channels)
        # An index, or a color that is the mean of others, is not the value of unknown pixels.
        nodata = None if self.indexed is not None else form.nodata
        alpha = form.alpha and shape == form.shape
        self.form = replace(form, shape=shape, alpha=alpha, nodata=nodata)

    def __iter__(self) -> Iterator[Band]:
        for band in self._bands:
            result = map_to_palette(band, self.palette, alpha=self._alpha, space=self._space)
            self.energy += result.energy
            yield result.indices if self.indexed is not None else result.image.reshape(len(band), *self.form.shape[1:])
