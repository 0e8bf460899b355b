"""Color quantization: the palette that represents an image with the least error, and the image in its colors."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, TypeVar, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_alpha, check_count, check_keywords, refuse
from cvtimg._shared.choices import DitherName, GoalName, SpaceName
from cvtimg._shared.pixels import array_of, is_known
from cvtimg.blocks.images import PixelBlocks, is_image_in_blocks
from cvtimg.colors.places import with_alpha, without_idle_alpha
from cvtimg.colors.samples import color_samples
from cvtimg.elbow.curves import EnergyCurve, auto_count
from cvtimg.looks.similarity import VisualQuality
from cvtimg.pictures.frames import Frames
from cvtimg.quantization.animations import Film, QuantizedFrames
from cvtimg.quantization.blocks import BlockSource
from cvtimg.quantization.driver import (
    QuantizeOptions,
    Search,
    for_eyes,
    nearest_quality,
    palettes_of,
    quantized,
    toward,
)
from cvtimg.quantization.looks import DEAREST, PRICES
from cvtimg.quantization.palette_search import EngineOptions, Palette, fixed_colors, keeping_main_colors
from cvtimg.quantization.remapping import Quantized, keep_outside, map_samples

R = TypeVar("R", Quantized, QuantizedFrames)

#: By so much a file grows, roughly, when the number of colors doubles.
_BYTES_A_PIXEL = 0.05


def quantize(
    image: Any,
    n_colors: int | Literal["auto"] | None = None,
    *,
    alpha: bool | None = None,
    mask: ArrayLike | None = None,
    nodata: float | None = None,
    space: SpaceName = "rgb",
    palette: ArrayLike | None = None,
    ramp: bool = False,
    palette_hint: ArrayLike | None = None,
    locked: ArrayLike | None = None,
    color_bits: int | Sequence[int] | None = None,
    psnr: float | None = None,
    dither: DitherName | None = None,
    dither_strength: float | None = None,
    weights: ArrayLike | None = None,
    goal: GoalName = "error",
    quality: float | None = None,
    **engine: Unpack[EngineOptions],
) -> Quantized:
    """Find the palette that represents an image with the least error, and give each pixel its nearest color.

    The palette is rounded to the depth of the image before the pixels are mapped to it. Images with at most `n_colors`
    colors are reproduced exactly. This is `find_palette` followed by `map_to_palette`.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Any integer or floating point type and byte order; white is the largest integer of the type, or 1 for floats.
        Also masked arrays, and objects with ``__array__`` or the DLPack protocol. A Dask array or an
        `xarray.DataArray`, of any dimensions, is quantized block by block, and never loaded: see Notes.
    n_colors : int or "auto", optional
        Size of the palette, in 1..65536. This includes the locked colors and, if there are fully transparent pixels,
        the transparent color. "auto" uses the elbow of the energy curve, which the result then contains (see
        `EnergyCurve.elbow`), or as many more as keep the main colors of an image in color. With `psnr` it may be
        omitted, and is the maximum size.
    alpha : bool, optional
        Whether the last channel is alpha. Then colors count as far as they are visible, opaque pixels stay opaque, and
        fully transparent pixels stay so. By default that of a Pillow image with alpha, and of an array that
        `cvtimg.read_image` read from such a file. All channels of other arrays are bands that count the same; for
        uint8 arrays of four channels, which may be RGBA, a warning asks for `alpha`.
    mask : (H, W) array, optional
        Pixels to quantize, where it is not 0. The others, and pixels that are not finite or masked in a masked array,
        have no influence, keep their value in the result, and become transparent in indexed files.
    nodata : float, optional
        Pixels with this value in all bands do not count either; by default what the attributes of a `DataArray` say.
    space : {"rgb", "linear", "lab", "oklab"}
        Color space in which distances are measured and means taken. All but "rgb" need gray or RGB, with or without
        alpha.
    palette : (K, C) array, optional
        Colors to map the image to, in its units, instead of finding a palette. With `n_colors`, those of them that
        represent it best.
    ramp : bool
        Let the colors of `palette`, from dark to light, stand for as many tones of the image, those that represent its
        lightness best: all of them are used, however dark or colored the image is. For the tone ramps of consoles.
        An image that has no other colors stays as it is.
    palette_hint : (K, C) array, optional
        The palette of an indexed file, from `read_palette`. If it has at most `n_colors` colors and the image no
        others, it is kept, so that indices keep their meaning; otherwise it plays no part.
    locked : (L, C) array, optional
        Colors that the palette must contain, in the units of the image.
    color_bits : int or three ints, optional
        Bits per channel of the hardware that shows the colors, in 1..8, such as 5 or (5, 6, 5): the palette has only
        colors that it can show; see `find_palette`.
    psnr : float, optional
        Use the fewest colors that reach this quality in dB.
    dither : {"floyd-steinberg", "edge-aware", "blue-noise", "bayer-2", "bayer-4", "bayer-8", "bayer-16", "compact"}
        Mix colors so that areas keep the color of the image; by default each pixel gets the nearest color. "edge-aware"
        keeps text, drawings and flat areas clean. "compact" mixes so that the file is small: where errors are hidden,
        indices repeat earlier ones.
    dither_strength : float, optional
        Fraction of the error that is handed on, in 0..1: less gives less grain, 1 keeps the mean best. By default 0.9,
        and 1 with a given `palette`, which may need strong mixtures.
    weights : (H, W) array, optional
        Weight >= 0 of each pixel in the search for the palette; 1 by default.
    goal : {"error", "eyes"}
        "error" means the least squared error. "eyes" means a small file that looks the same: 256 colors by
        default, found in Oklab, and ``dither="compact"``.
    quality : float, optional
        The smallest file whose `cvtimg.visual_quality` is at least this, in 0..100: 80 is hard to tell from the
        original, 70 is good. It implies ``goal="eyes"``; see Notes.
    method, init, effort, volume_power, rng, callback
        As in `tessellate`. Pixels are mapped to their nearest color, whatever the `volume_power`. With `psnr` or
        "auto", `callback` is called in each of several searches; an exception that it raises ends them all.

    Returns
    -------
    Quantized
        `QuantizedBlocks` for an image in blocks.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or `psnr` is not reached; the message names it, its value and what is allowed.

    See Also
    --------
    find_palette, map_to_palette : Its two steps.
    quantize_file, quantize_frames, quantize_to_size : Files of any kind, animations, and files of at most a size.

    Notes
    -----
    Images in blocks take `n_colors` (a number) or `palette`, `alpha`, `nodata`, `space`, `locked` and the options of
    the engine; with any other option they are loaded. The result has the same palette as in memory, and pixels that are
    computed when they are needed.

    The quality follows from the price of bits in "compact", and once that would show as streaks, which the measure does
    not see, from fewer colors.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import quantize
    >>> image = np.array([[10, 12, 200], [11, 202, 201]], dtype=np.uint8)
    >>> result = quantize(image, 2)
    >>> result.image.tolist(), result.energy
    ([[11, 11, 201], [11, 201, 201]], 4.0)
    >>> len(quantize(image, psnr=40).palette)
    2
    """
    check_keywords(quantize, engine, EngineOptions.__annotations__)
    how = QuantizeOptions(
        n_colors, psnr, palette, locked, color_bits, ramp, space, dither, dither_strength, engine, goal, quality
    ).aimed()
    how.check(weights=weights)
    needs_all = ramp or n_colors == "auto" or any(one is not None for one in (mask, psnr, dither, weights))
    if is_image_in_blocks(image) and not needs_all:
        return cast(Quantized, quantized(BlockSource(PixelBlocks.of(image, nodata), bool(alpha)), how))
    return quantized_picture(PictureSource(image, alpha, mask, nodata, weights), how, palette_hint)


def quantized_picture(source: PictureSource, how: QuantizeOptions, hint: ArrayLike | None = None) -> Quantized:
    """Quantize an image in memory, which may have had a palette; see `quantize`."""
    kept = None
    if hint is not None and isinstance(how.n_colors, int) and how.locked is None and how.color_bits is None:
        kept = source.kept(np.asarray(hint), how.n_colors, how)
    if kept is not None:
        return replace(kept, quality=source.quality(kept)) if how.goal == "eyes" else kept
    if how.n_colors == "auto":
        at_elbow, curve = source.elbow(how)
        return replace(quantized(source, replace(how, n_colors=at_elbow)), curve=curve)
    return for_eyes(source, how) if how.goal == "eyes" else quantized(source, how)


def quantize_to_size(
    image: Any,
    max_bytes: int,
    size: Callable[[Any], int],
    n_colors: int = 256,
    *,
    alpha: bool | None = None,
    mask: ArrayLike | None = None,
    space: SpaceName = "rgb",
    locked: ArrayLike | None = None,
    color_bits: int | Sequence[int] | None = None,
    dither: DitherName | None = None,
    dither_strength: float | None = None,
    weights: ArrayLike | None = None,
    **engine: Unpack[EngineOptions],
) -> Quantized:
    """Find the most colors whose file has at most this many bytes.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, Pillow image, or Frames
        As in `quantize` or, for an animation, in `quantize_frames`.
    max_bytes : int
        Largest size, >= 1.
    size : callable
        Returns the number of bytes that a file of the result would have.
    n_colors : int
        Maximum number of colors; by default as many as an indexed file holds.
    alpha, mask, space, locked, color_bits, dither, dither_strength, weights
        As in `quantize`.
    method, init, effort, volume_power, rng, callback
        As in `quantize`.

    Returns
    -------
    Quantized

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or no palette is small enough; the message names it.

    Warns
    -----
    UserWarning
        If only a single color fits, which leaves nothing to see.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.quantization import quantize_to_size
    >>> image = np.arange(256, dtype=np.uint8).reshape(16, 16)
    >>> result = quantize_to_size(image, 400, lambda result: result.indices.nbytes + 3 * len(result.palette))
    >>> len(result.palette)
    48
    """
    check_keywords(quantize_to_size, engine, EngineOptions.__annotations__)
    check_count("max_bytes", max_bytes, 1 << 62, "the size of a file")
    how = QuantizeOptions(
        locked=locked, space=space, dither=dither, dither_strength=dither_strength, engine=engine, color_bits=color_bits
    )
    if isinstance(image, Frames):
        masks: Any = mask
        return to_size(Film(image, False, alpha, masks), how, max_bytes, size, n_colors)
    return to_size(PictureSource(image, alpha, mask, None, weights), how, max_bytes, size, n_colors)


def to_size(source: Any, how: QuantizeOptions, max_bytes: int, size: Callable[[Any], int], n_colors: int) -> Any:
    """Find the most colors whose file is small enough, see `quantize_to_size`; for eyes the best image that fits."""
    how = replace(how, n_colors=n_colors)
    if how.quality is not None:
        result = nearest_quality(source, how)
        if size(result) <= max_bytes:
            return result
    if how.dither == "compact":
        dearest = replace(how, price=DEAREST)
        fitting, _ = toward(source, dearest, DEAREST, PRICES[0], lambda result: size(result) <= max_bytes)
        if size(fitting) <= max_bytes:
            return replace(fitting, quality=source.quality(fitting)) if how.goal == "eyes" else fitting
        how = dearest
    results = Search(source, how, size, _BYTES_A_PIXEL * source.n_pixels).reach(max_bytes + 1, n_colors)
    if False not in results:
        fewest = results[True]
        n_colors = max(len(colors) for colors in palettes_of(fewest))
        refuse("max_bytes", max_bytes, f"at least {size(fewest)}, for the fewest colors, {n_colors}")
    found: Any = results[False]
    if found.n_distinct > 1 and all(len(colors) == 1 for colors in palettes_of(found)):
        warnings.warn(f"max_bytes={max_bytes} leaves one color of {found.n_distinct}", UserWarning, stacklevel=3)
    return replace(found, quality=source.quality(found)) if how.goal == "eyes" else found


class PictureSource:
    """An image in memory: the `Source` of `quantize`."""

    def __init__(
        self, image: Any, alpha: bool | None, mask: ArrayLike | None, nodata: float | None, weights: ArrayLike | None
    ) -> None:
        array = array_of(image)
        n_channels = array.shape[2] if array.ndim == 3 else 1
        has_alpha = check_alpha(alpha, image, n_channels)
        if alpha is None and not has_alpha and n_channels == 4 and array.dtype == np.uint8:
            warnings.warn(
                "image has 4 channels that all count: give alpha=True if the last is alpha, else alpha=False",
                UserWarning,
                stacklevel=3,
            )
        if nodata is not None:
            known = is_known(array.reshape(*array.shape[:2], -1), nodata)
            mask = known if mask is None else known & (np.asarray(mask) != 0)
        seen = without_idle_alpha(array) if has_alpha else array
        self._image, self._shape, self._has_idle_alpha = image, array.shape, seen is not array
        self.image = seen
        # A masked array is passed on whole, with its mask.
        given = seen if self._has_idle_alpha else image
        self._samples = color_samples(given, alpha=has_alpha and not self._has_idle_alpha, mask=mask)
        self.counted = [self._samples if weights is None else self._samples.weighted(weights)]
        self.n_pixels = self._samples.inverse.size
        self._measure: VisualQuality | None = None

    def quality(self, result: Quantized) -> float:
        """Return the visual quality of a result."""
        self._measure = self._measure or VisualQuality(self.image)
        return self._measure(result.image)

    def elbow(self, how: QuantizeOptions) -> tuple[int, EnergyCurve]:
        """Pick the number of colors by the elbow of their energies, and as many more as keep the main colors."""
        taken = ("volume_power", "rng", "callback")
        options: dict[str, Any] = {name: value for name, value in how.engine.items() if name in taken}
        n_colors, curve = auto_count(self.counted[0], space=how.space, **options)
        n_colors = keeping_main_colors(self.counted[0], curve, n_colors, how.space)
        return max(n_colors, fixed_colors(self._samples, how.locked)[2]), curve

    def kept(self, palette: np.ndarray[Any, Any], n_colors: int, how: QuantizeOptions) -> Quantized | None:
        """Return the image in its own palette, if that is small enough and has all its colors."""
        n_channels = self._shape[2] if len(self._shape) == 3 else 1
        if len(palette) > n_colors or palette.dtype != self._samples.colors.dtype or palette.shape[1:] != (n_channels,):
            return None
        result = self.mapped([Palette(palette, None)], how)
        return None if result.energy or len(result.palette) > len(palette) else result

    def mapped(self, palettes: Sequence[Palette], how: QuantizeOptions) -> Quantized:
        """Map the image to a palette."""
        found = palettes[0]
        result = map_samples(self._samples, found.colors, how.space, how.dither, how.strength, how.rate, found.tones)
        colors, alpha = result.palette, result.alpha
        if self._has_idle_alpha and not alpha:
            colors, alpha = with_alpha(colors), True
        n_channels = colors.shape[1]
        as_before = n_channels == 1 or self._shape[2:] == (n_channels,)
        shape = self._shape if as_before else (*self._shape[:2], n_channels)
        result = replace(result, palette=colors, alpha=alpha, shape=shape, tessellation=found.tessellation)
        return keep_outside(result, self._image)
