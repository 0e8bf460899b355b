"""Color quantization of images in blocks, wherever the blocks are computed: the counts of their colors are added."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_one_of
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import peak
from cvtimg.blocks.images import PixelBlocks
from cvtimg.colors.adding import count_blocks
from cvtimg.colors.fidelity import psnr
from cvtimg.engine.tessellation import Tessellation
from cvtimg.quantization.palette_search import EngineOptions, Palette, find_palette
from cvtimg.quantization.remapping import map_to_palette

if TYPE_CHECKING:
    import dask.array as da

__all__ = ["QuantizedBlocks", "in_blocks", "quantize_blocks"]


@dataclass(frozen=True, slots=True, eq=False)
class QuantizedBlocks:
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
    def mse(self) -> float:
        """Mean squared error per sample, alpha not counted."""
        return float(self.energy / (self.n_pixels * (self.palette.shape[1] - self.alpha)))

    @property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio in dB, as in `Quantized`."""
        return float(psnr(self.mse, peak(self.palette.dtype)))


def quantize_blocks(
    image: da.Array,
    n_colors: int,
    *,
    alpha: bool = False,
    nodata: float | None = None,
    space: SpaceName = "rgb",
    locked: ArrayLike | None = None,
    **engine: Unpack[EngineOptions],
) -> tuple[Palette, da.Array]:
    """Find the palette that represents an image in blocks with the least error, and map its pixels to it lazily.

    Dask counts the colors of the blocks and adds the counts along a tree; the palette is found here, and no pixel is
    moved. `quantize` takes such images too, and returns more.

    Parameters
    ----------
    image : dask.array.Array or xarray.DataArray
        (H, W), (H, W, C) or a stack (T, ..., H, W, C), or a DataArray with any dimensions, of which one named "band" or
        "channel" holds the bands: of any integer or floating point type. A stack gets one palette.
    n_colors : int
        Size of the palette, in 1..65536.
    alpha : bool
        Whether the last channel is alpha.
    nodata : float, optional
        Pixels with this value in all bands do not count; by default what the attributes of a DataArray say. Nor do
        pixels that are not finite.
    space, locked, method, init, effort, volume_power, rng
        As in `find_palette`.

    Returns
    -------
    Palette
        The same, bit for bit, for any blocks.
    dask.array.Array or xarray.DataArray
        Index of the color of each pixel, uint8, or uint16 for more than 256 colors: not computed yet, in the blocks of
        the image.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it, its value and what is allowed.

    Examples
    --------
    >>> import dask.array as da
    >>> import numpy as np
    >>> from cvtimg.quantization import quantize_blocks
    >>> picture = da.from_array(np.array([[10, 12, 200], [11, 202, 201]], np.uint8), chunks=(1, 3))
    >>> palette, indices = quantize_blocks(picture, 2)
    >>> palette.colors.ravel().tolist(), indices.compute().tolist()
    ([11, 201], [[0, 0, 1], [0, 1, 1]])
    """
    blocks = PixelBlocks.of(image, nodata)
    samples, _ = count_blocks(blocks, alpha)
    palette = find_palette(samples, n_colors, space=space, locked=locked, **engine)
    return palette, _indices(blocks, palette.colors, alpha, space)


def in_blocks(
    image: Any,
    n_colors: int | None,
    alpha: bool | None,
    space: SpaceName,
    palette: ArrayLike | None,
    locked: ArrayLike | None,
    engine: EngineOptions,
) -> QuantizedBlocks:
    """Quantize an image in blocks; the parameters are those of `quantize`."""
    check_one_of(n_colors=n_colors, palette=palette)
    blocks, alpha = PixelBlocks.of(image), bool(alpha)
    samples, exact = count_blocks(blocks, alpha)
    tessellation = None
    if palette is None:
        assert n_colors is not None
        found = find_palette(samples, n_colors, space=space, locked=locked, **engine)
        palette, tessellation = found.colors, found.tessellation
    mapped = map_to_palette(samples, palette, space=space)  # whose energy is that of all pixels
    colors = mapped.palette
    same = partial(_colors_of, palette=colors, alpha=alpha, space=space)
    return QuantizedBlocks(
        palette=colors,
        indices=_indices(blocks, colors, alpha, space),
        image=blocks.mapped(same, colors.dtype, colors.shape[1]),
        energy=mapped.energy,
        tessellation=tessellation,
        n_distinct=samples.n_colors,
        n_pixels=int(samples.density.sum()),
        alpha=mapped.alpha,
        exact=exact,
    )


def _indices(blocks: PixelBlocks, palette: NDArray[Any], alpha: bool, space: SpaceName) -> Any:
    nearest = partial(_indices_of, palette=palette, alpha=alpha, space=space)
    return blocks.mapped(nearest, np.uint8 if len(palette) <= 256 else np.uint16)


def _indices_of(pixels: NDArray[Any], *, palette: NDArray[Any], alpha: bool, space: SpaceName) -> NDArray[Any]:
    indices: NDArray[Any] = map_to_palette(pixels[None], palette, alpha=alpha, space=space).indices[0]
    return indices


def _colors_of(pixels: NDArray[Any], *, palette: NDArray[Any], alpha: bool, space: SpaceName) -> NDArray[Any]:
    colors: NDArray[Any] = palette[_indices_of(pixels, palette=palette, alpha=alpha, space=space)]
    return colors
