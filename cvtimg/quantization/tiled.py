"""Color quantization of images larger than memory: one pass through the file to count colors, one to map them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_colors
from cvtimg._shared.pixels import white_of
from cvtimg.colors.counting import Counter
from cvtimg.colors.fidelity import Fidelity
from cvtimg.colors.places import CLEAR, kinds_of
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
from cvtimg.pictures.known import with_known
from cvtimg.pictures.tiles import Band, open_bands, write_bands
from cvtimg.quantization.driver import QuantizeOptions
from cvtimg.quantization.palette_search import Palette
from cvtimg.quantization.remapping import map_to_palette

__all__ = ["Strips"]


@dataclass(frozen=True, slots=True)
class Written(Fidelity):
    """What is known of an image that was written in strips; see `Quantized` and `cvtimg.colors.counting.Count`."""

    palette: NDArray[Any]
    alpha: bool
    energy: float
    n_values: int
    n_left_out: int
    tessellation: Tessellation | None
    n_distinct: int
    exact: bool


class Strips:
    """An image on disk that is read in strips: a `Source` of `quantize_file`, whose pixels are mapped into a file."""

    def __init__(
        self,
        source: StrPath,
        target: StrPath,
        mask: StrPath | None,
        nodata: float | None,
        max_pixels: int | None,
        overwrite: bool,
    ) -> None:
        self.bands = open_bands(source)
        form = self.bands.form
        if max_pixels is not None and form.n_pixels > max_pixels:
            raise ValueError(f"has over {max_pixels} pixels, the limit of max_pixels")
        nodata = form.nodata if nodata is None else nodata
        self.known = partial(with_known, self.bands, mask, nodata, has_alpha=self.bands.form.alpha)
        self.leaves_out = mask is not None or nodata is not None
        self.makes_zarr = Path(target).suffix.lower() == ".zarr"
        self._target, self._overwrite = target, overwrite
        counter = Counter(alpha=self.bands.form.alpha)
        for band, inside in self.known():
            if inside.any():
                counter.add(band if inside.all() else band[inside][None])
        count = counter.total()
        self._n_distinct, self._exact = count.n_distinct, count.exact
        # Counts may take more memory than the strips, and are let go before the pixels are mapped.
        self.counted = [count.of_some("is not left out")]

    def mapped(self, palettes: Sequence[Palette], how: QuantizeOptions) -> Written:
        """Map the pixels to a palette, and write them."""
        form, samples = self.bands.form, self.counted.pop()
        colors = check_colors("palette", palettes[0].colors, samples.colors.dtype)
        alpha = form.alpha and colors.shape[1] == samples.colors.shape[1]
        if alpha and CLEAR in kinds_of(samples.colors, True) and CLEAR not in kinds_of(colors, True):
            colors = map_to_palette(samples, colors, space=how.space).palette
        del samples
        mapping = _Mapping(self, colors, how)
        write_bands(self._target, mapping.form, mapping, palette=mapping.indexed, overwrite=self._overwrite)
        n_pixels = form.n_pixels - mapping.n_left_out
        return Written(
            palette=mapping.palette,
            alpha=mapping.alpha,
            energy=mapping.energy,
            n_values=n_pixels * (mapping.palette.shape[1] - mapping.alpha),
            n_left_out=mapping.n_left_out,
            tessellation=palettes[0].tessellation,
            n_distinct=self._n_distinct,
            exact=self._exact,
        )


class _Mapping:
    """The strips of an image in the colors of a palette, and the energy of those done so far."""

    def __init__(self, source: Strips, palette: NDArray[Any], how: QuantizeOptions) -> None:
        # One pixel shows how a palette and an image of unequal channels agree.
        form, leaves_out = source.bands.form, source.leaves_out
        white = np.full((1, 1, *form.shape[2:]), white_of(form.dtype), form.dtype)
        pixel = map_to_palette(white, palette, alpha=form.alpha, space=how.space)
        self.palette, self.alpha = palette, pixel.alpha and pixel.palette.shape[1] == palette.shape[1]
        self.energy, self.n_left_out = 0.0, 0
        self._known, self._space, self._alpha = source.known, how.space, form.alpha
        n_channels = pixel.palette.shape[1]
        keeps_nodata = leaves_out and form.nodata is not None and not (palette == form.nodata).all(axis=1).any()
        eight_bit = palette.dtype == np.uint8 and n_channels in (1, 3)
        fits = len(palette) <= 256 and eight_bit and n_channels == 3
        self.indexed = pixel.palette if fits and not leaves_out and not source.makes_zarr else None
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
