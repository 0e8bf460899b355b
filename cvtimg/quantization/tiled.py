"""Color quantization of images larger than memory: one pass through the file to count colors, one to map them."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cvtimg._shared.checks import check_colors
from cvtimg._shared.choices import Arguments
from cvtimg._shared.pixels import white_of
from cvtimg.colors.counting import Count
from cvtimg.colors.places import CLEAR, kinds_of
from cvtimg.colors.samples import color_samples
from cvtimg.pictures.stacks import Stack
from cvtimg.pictures.tiles import Band
from cvtimg.quantization.driver import QuantizeOptions
from cvtimg.quantization.palette_search import Palette
from cvtimg.quantization.remapping import Quantized, Storing, map_to_palette


class TiledSource:
    """An image on disk that is read in bands: a `Source` of `quantize_file`, whose pixels are mapped into a file."""

    def __init__(self, stack: Stack, target: Path, overwrite: bool) -> None:
        self._stack, self._target, self._overwrite = stack, target, overwrite
        count = Count()
        for band, inside in stack:
            if inside.any():
                pixels = band if inside.all() else band[inside][None]
                count = count.plus(color_samples(pixels, alpha=stack.content.form.alpha))
        self._n_distinct, self._exact = count.n_distinct, count.exact
        # Counts may take more memory than the bands, and are let go before the pixels are mapped.
        self.counted = [count.of_some("is not left out")]

    def mapped(self, palettes: Sequence[Palette], how: QuantizeOptions) -> Quantized:
        """Map the pixels to a palette, and write them."""
        form, samples = self._stack.content.form, self.counted.pop()
        colors = check_colors("palette", palettes[0].colors, samples.colors.dtype)
        alpha = form.alpha and colors.shape[1] == samples.colors.shape[1]
        if alpha and CLEAR in kinds_of(samples.colors, True) and CLEAR not in kinds_of(colors, True):
            colors = map_to_palette(samples, colors, space=how.space).palette
        del samples
        # One pixel shows how a palette and an image of unequal channels agree.
        white = np.full((1, 1, *form.shape[2:]), white_of(form.dtype), form.dtype)
        one = map_to_palette(white, colors, alpha=form.alpha, space=how.space)
        n_channels = one.palette.shape[1]
        leaves_out = self._stack.mask is not None or self._stack.nodata is not None
        # A color that is the mean of others, or an index, is not the value of unknown pixels.
        keeps = leaves_out and form.nodata is not None and not (colors == form.nodata).all(axis=1).any()
        indexed = self._target.suffix.lower() != ".zarr"
        storing = Storing.of(one.palette, left_out=leaves_out, keeps_nodata=keeps, indexed=indexed)
        bands_of_one = n_channels == 1 or storing.indexed
        last = (4,) if storing.clears else () if bands_of_one else (n_channels,)
        energy, n_left_out = 0.0, 0

        def mapped_bands() -> Iterator[Band]:
            nonlocal energy, n_left_out
            for band, inside in self._stack:
                n_left_out += int(np.count_nonzero(~inside))
                shape = (*band.shape[:2], *last)
                if not inside.any():
                    yield band if band.shape == shape and not storing.clears else np.zeros(shape, form.dtype)
                    continue
                mask = None if inside.all() else inside
                result = map_to_palette(band, colors, alpha=form.alpha, mask=mask, space=how.space)
                energy += result.energy
                yield result.stored(storing).reshape(shape)

        about: Arguments = {"nodata": form.nodata if keeps else None}
        about["palette"] = one.palette if storing.indexed else None
        about["alpha"] = storing.clears or (form.alpha and (*form.shape[:2], *last) == form.shape)
        self._stack.write(self._target, mapped_bands(), overwrite=self._overwrite, **about)
        result = Quantized(one.palette, None, form.shape, energy, palettes[0].tessellation, self._n_distinct)
        alpha = one.alpha and n_channels == colors.shape[1]
        return replace(result, alpha=alpha, n_left_out=n_left_out, exact=self._exact)
