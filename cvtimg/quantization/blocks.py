"""Color quantization of Dask arrays, block by block, wherever the blocks are computed."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_image_shape
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import with_mark
from cvtimg.colors.samples import ColorSamples
from cvtimg.quantization.palette_search import EngineOptions, Palette, find_palette
from cvtimg.quantization.remapping import map_to_palette
from cvtimg.quantization.sharing import add_samples, count_picture, in_fixed_order

if TYPE_CHECKING:
    import dask.array as da

__all__ = ["quantize_blocks"]


def quantize_blocks(
    image: da.Array,
    n_colors: int,
    *,
    alpha: bool = False,
    space: SpaceName = "rgb",
    locked: ArrayLike | None = None,
    **engine: Unpack[EngineOptions],
) -> tuple[Palette, da.Array]:
    """Find the palette that represents a Dask array with the least error, and map its pixels to it lazily.

    Dask's cluster counts the colors of the blocks and adds the counts in pairs; the palette is found here. `quantize`
    accepts a Dask array too, but loads it into memory first.

    Parameters
    ----------
    image : (H, W) or (H, W, C) dask.array.Array
        Of any integer or floating point type.
    n_colors : int
        Size of the palette, in 1..65536.
    alpha : bool
        Whether the last channel is alpha.
    space, locked, method, init, effort, volume_power, rng, callback
        As in `find_palette`.

    Returns
    -------
    Palette
        The same, bit for bit, for any blocks.
    dask.array.Array, (H, W)
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
    import dask.array
    from dask.delayed import delayed

    check_image_shape("image", image.shape)
    whole: Any = image
    if image.ndim == 3:
        whole = whole.rechunk({2: -1})
    sums = [delayed(_count_block)(block, alpha) for block in whole.to_delayed().ravel()]
    while len(sums) > 1:
        pairs = [delayed(add_samples)(*sums[n : n + 2]) for n in range(0, len(sums) - 1, 2)]
        sums = pairs + sums[2 * len(pairs) :]
    samples = in_fixed_order(sums[0].compute())
    palette = find_palette(samples, n_colors, space=space, locked=locked, **engine)
    colors = palette.colors
    dtype = np.uint8 if len(colors) <= 256 else np.uint16
    library: Any = dask.array
    map_block = partial(_map_block, palette=colors, alpha=alpha, space=space)
    indices: da.Array = library.map_blocks(map_block, whole, dtype=dtype, drop_axis=[2] if image.ndim == 3 else [])
    return palette, indices


def _count_block(block: NDArray[Any], alpha: bool) -> ColorSamples:
    return count_picture(with_mark(block, alpha))


def _map_block(block: NDArray[Any], *, palette: NDArray[Any], alpha: bool, space: SpaceName) -> NDArray[Any]:
    return map_to_palette(block, palette, alpha=alpha, space=space).indices
