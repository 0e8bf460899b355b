"""Color quantization of images in blocks, wherever the blocks are computed: the counts of their colors are added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import SpaceName
from cvtimg.blocks.images import PixelBlocks
from cvtimg.colors.counting import count_blocks
from cvtimg.colors.fidelity import Fidelity
from cvtimg.colors.samples import ColorSamples
from cvtimg.engine.tessellation import Tessellation
from cvtimg.quantization.driver import QuantizeOptions
from cvtimg.quantization.palette_search import Palette
from cvtimg.quantization.remapping import map_to_palette

__all__ = ["BlockSource", "QuantizedBlocks"]


@dataclass(frozen=True, slots=True, eq=False)
class QuantizedBlocks(Fidelity):
    """An image in blocks in few colors: the palette is known, and the pixels are computed when they are needed.

    Attributes
    ----------
    palette, energy, tessellation, n_distinct, alpha
        As in `Quantized`; the energy is that of all pixels that count.
    indices : dask.array.Array or xarray.DataArray
        Index of the color of each pixel, without the dimension of the bands; 0 for pixels that do not count.
    image : dask.array.Array or xarray.DataArray
        The image in its new colors, with its dimensions and coordinates; pixels that do not count are 0.
    n_pixels : int
        Number of pixels that count.
    exact : bool
        Whether all colors were distinguished. Beyond 2^22, near ones are merged while they are counted; the energy is
        then that of the merged colors.
    """

    palette: NDArray[Any]
    indices: Any
    image: Any
    energy: float
    tessellation: Tessellation | None
    n_distinct: int
    n_pixels: int
    alpha: bool = False
    exact: bool = True

    def __repr__(self) -> str:
        """Tell size, colors and error in one line."""
        shape = " x ".join(map(str, self.image.shape))
        return f"QuantizedBlocks({shape}, {len(self.palette)} of {self.n_distinct} colors, PSNR {self.psnr:.2f} dB)"

    @property
    def n_values(self) -> int:
        """Number of samples that count: pixels times channels without alpha."""
        return self.n_pixels * (self.palette.shape[1] - self.alpha)


class BlockSource:
    """An image in blocks, whose colors Dask counts and adds along a tree: a `Source` of `quantize`."""

    def __init__(self, blocks: PixelBlocks, alpha: bool) -> None:
        self._blocks, self._alpha = blocks, alpha
        self._count = count_blocks(blocks, alpha)

    @property
    def counted(self) -> list[ColorSamples]:
        """The one density of all pixels."""
        return [self._count.of_some()]

    def mapped(self, palettes: Sequence[Palette], how: QuantizeOptions) -> QuantizedBlocks:
        """Map the pixels to a palette, when they are needed; the energy is known at once from their counts."""
        blocks, samples = self._blocks, self.counted[0]
        mapped = map_to_palette(samples, palettes[0].colors, space=how.space)
        given: dict[str, Any] = {"palette": mapped.palette, "alpha": self._alpha, "space": how.space}
        dtype = np.uint8 if len(mapped.palette) <= 256 else np.uint16
        return QuantizedBlocks(
            palette=mapped.palette,
            indices=blocks.mapped(partial(_indices_of, **given), dtype),
            image=blocks.mapped(partial(_colors_of, **given), mapped.palette.dtype, mapped.palette.shape[1]),
            energy=mapped.energy,
            tessellation=palettes[0].tessellation,
            n_distinct=self._count.n_distinct,
            n_pixels=int(samples.density.sum()),
            alpha=mapped.alpha,
            exact=self._count.exact,
        )


def _indices_of(pixels: NDArray[Any], *, palette: NDArray[Any], alpha: bool, space: SpaceName) -> NDArray[Any]:
    return map_to_palette(pixels[None], palette, alpha=alpha, space=space).indices[0]


def _colors_of(pixels: NDArray[Any], *, palette: NDArray[Any], alpha: bool, space: SpaceName) -> NDArray[Any]:
    return palette[_indices_of(pixels, palette=palette, alpha=alpha, space=space)]
