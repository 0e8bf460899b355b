"""Color quantization: the palette that represents an image with the least error, and the image in its colors."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import (
    check_alone,
    check_alpha,
    check_count,
    check_given,
    check_keywords,
    check_non_negative,
    refuse,
)
from cvtimg._shared.choices import DitherName, EffortName, SpaceName
from cvtimg._shared.pixels import array_of
from cvtimg.blocks.images import is_image_in_blocks
from cvtimg.colors.places import with_alpha, without_idle_alpha
from cvtimg.colors.samples import color_samples
from cvtimg.elbow.curves import EnergyCurve, auto_count
from cvtimg.engine.tessellation import Tessellation
from cvtimg.quantization.blocks import in_blocks
from cvtimg.quantization.dithering import STRENGTH
from cvtimg.quantization.palette_search import EngineOptions, check_room, find_palette, fixed_colors
from cvtimg.quantization.remapping import MAX_COLORS, Quantized, keep_outside, map_samples
from cvtimg.quantization.targets import first_reaching

#: First number of colors in the search for a target, and the minimum gain from doubling it.
_FIRST_TRIAL = 32
_DECIBEL = 2.0
_BYTES_A_PIXEL = 0.05


def quantize(
    image: Any,
    n_colors: int | Literal["auto"] | None = None,
    *,
    alpha: bool | None = None,
    mask: ArrayLike | None = None,
    space: SpaceName = "rgb",
    palette: ArrayLike | None = None,
    locked: ArrayLike | None = None,
    psnr: float | None = None,
    dither: DitherName | None = None,
    dither_strength: float | None = None,
    weights: ArrayLike | None = None,
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
    n_colors : int
        Size of the palette, in 1..65536. This includes the locked colors and, if there are fully transparent pixels,
        the transparent color. "auto" uses the elbow of the energy curve, which the result then contains; see
        `EnergyCurve.elbow`. With `psnr`, optional and the maximum size. Not allowed with `palette`.
    alpha : bool, optional
        Whether the last channel is alpha. Then colors count as far as they are visible, opaque pixels stay opaque, and
        fully transparent pixels stay so. By default that of a Pillow image with alpha, and of an array that
        `cvtimg.read_image` read from such a file. All channels of other arrays are bands that count the same; for
        uint8 arrays of four channels, which may be RGBA, a warning asks for `alpha`.
    mask : (H, W) array, optional
        Pixels to quantize, where it is not 0. The others, and pixels that are not finite or masked in a masked array,
        have no influence, keep their value in the result, and become transparent in indexed files.
    space : {"rgb", "linear", "lab", "oklab"}
        Color space in which distances are measured and means taken. All but "rgb" need grey or RGB, with or without
        alpha.
    palette : (K, C) array, optional
        Colors to map the image to, in its units, instead of finding a palette.
    locked : (L, C) array, optional
        Colors that the palette must contain, in the units of the image.
    psnr : float, optional
        Use the fewest colors that reach this quality in dB.
    dither : {"floyd-steinberg", "edge-aware", "blue-noise", "bayer-2", "bayer-4", "bayer-8", "bayer-16"}, optional
        Mix colors so that areas keep the color of the image; by default each pixel gets the nearest color. "edge-aware"
        keeps text, drawings and flat areas clean.
    dither_strength : float, optional
        Fraction of the error that is handed on, in 0..1: less gives less grain, 1 keeps the mean best. By default 0.9,
        and 1 with a given `palette`, which may need strong mixtures.
    weights : (H, W) array, optional
        Weight >= 0 of each pixel in the search for the palette; 1 by default.
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

    Notes
    -----
    Images in blocks take `n_colors` (a number) or `palette`, `alpha`, `space`, `locked` and the options of the engine;
    with any other option they are loaded. The result has the same palette as in memory, and pixels that are computed
    when they are needed. Pixels of a `DataArray` that have its nodata value in all bands do not count.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import quantize
    >>> picture = np.array([[10, 12, 200], [11, 202, 201]], dtype=np.uint8)
    >>> result = quantize(picture, 2)
    >>> result.image.tolist(), result.energy
    ([[11, 11, 201], [11, 201, 201]], 4.0)
    >>> len(quantize(picture, psnr=40).palette)
    2
    """
    if dither_strength is None:
        dither_strength = STRENGTH if palette is None else 1.0
    check_keywords("quantize", engine, EngineOptions.__annotations__)
    whole = (mask, psnr, dither, weights)
    if is_image_in_blocks(image) and n_colors != "auto" and all(option is None for option in whole):
        found: Any = in_blocks(image, n_colors, alpha, space, palette, locked, engine)
        return cast(Quantized, found)
    source = _Source(image, alpha, mask, locked, weights, space, dither, dither_strength)
    if palette is not None:
        others = {"n_colors": n_colors, "locked": locked, "psnr": psnr, "weights": weights, **engine}
        check_alone("palette", [name for name, value in others.items() if value is not None])
        return source.mapped(palette)
    if psnr is None:
        wanted: int | Literal["auto"] = check_given("n_colors, psnr or palette", n_colors)
        if wanted == "auto":
            at_elbow, curve = source.elbow(engine)
            return source.quantized(at_elbow, engine, curve)
        return source.quantized(wanted, engine)
    quality = check_non_negative("psnr", psnr)
    if n_colors == "auto":
        refuse("n_colors", n_colors, "a number with psnr")
    most = MAX_COLORS if n_colors is None else n_colors
    results = source.first_reaching(lambda result: result.psnr, quality, most, _DECIBEL, engine)
    if True not in results:
        best = results[False]
        refuse("psnr", psnr, f"at most {best.psnr:.2f} dB, which {len(best.palette)} colors reach")
    return results[True]


def quantize_to_size(
    image: Any,
    max_bytes: int,
    size: Callable[[Quantized], int],
    n_colors: int = 256,
    *,
    alpha: bool | None = None,
    mask: ArrayLike | None = None,
    space: SpaceName = "rgb",
    locked: ArrayLike | None = None,
    dither: DitherName | None = None,
    dither_strength: float | None = None,
    weights: ArrayLike | None = None,
    **engine: Unpack[EngineOptions],
) -> Quantized:
    """Find the most colors whose file has at most this many bytes.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        As in `quantize`.
    max_bytes : int
        Largest size, >= 1.
    size : callable
        Returns the number of bytes that a file of the result would have.
    n_colors : int
        Maximum number of colors; by default as many as an indexed file holds.
    alpha, mask, space, locked, dither, dither_strength, weights, method, init, effort, volume_power, rng, callback
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
    >>> picture = np.arange(256, dtype=np.uint8).reshape(16, 16)
    >>> result = quantize_to_size(picture, 400, lambda result: result.indices.nbytes + 3 * len(result.palette))
    >>> len(result.palette)
    48
    """
    check_count("max_bytes", max_bytes, 1 << 62, "the size of a file")
    strength = STRENGTH if dither_strength is None else dither_strength
    source = _Source(image, alpha, mask, locked, weights, space, dither, strength)
    results = source.first_reaching(size, max_bytes + 1, n_colors, _BYTES_A_PIXEL * source.n_pixels, engine)
    if False not in results:
        fewest = results[True]
        refuse("max_bytes", max_bytes, f"at least {size(fewest)}, for the fewest colors, {len(fewest.palette)}")
    found = results[False]
    if len(found.palette) == 1 < found.n_distinct:
        warnings.warn(f"max_bytes={max_bytes} leaves one color of {found.n_distinct}", UserWarning, stacklevel=2)
    return found


class _Source:
    """An image to try palettes of several sizes on, and how these are found and used."""

    def __init__(
        self,
        image: Any,
        alpha: bool | None,
        mask: ArrayLike | None,
        locked: ArrayLike | None,
        weights: ArrayLike | None,
        space: SpaceName,
        dither: DitherName | None,
        dither_strength: float,
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
        seen = without_idle_alpha(array) if has_alpha else array
        self._image, self._shape, self._has_idle_alpha = image, array.shape, seen is not array
        # A masked array is passed on whole, with its mask.
        counted = seen if self._has_idle_alpha else image
        self._samples = color_samples(counted, alpha=has_alpha and not self._has_idle_alpha, mask=mask)
        self._counted = self._samples if weights is None else self._samples.weighted(weights)
        self._locked, self._space = locked, space
        self._dither, self._strength = dither, dither_strength
        self.n_pixels = self._samples.inverse.size

    @property
    def least(self) -> int:
        """The number of colors that its palettes must have."""
        return fixed_colors(self._samples, self._locked)[2]

    def quantized(self, n_colors: int, engine: EngineOptions, curve: EnergyCurve | None = None) -> Quantized:
        """Find a palette and map the image to it."""
        found = find_palette(self._counted, n_colors, space=self._space, locked=self._locked, **engine)
        return self.mapped(found.colors, found.tessellation, curve)

    def elbow(self, engine: EngineOptions) -> tuple[int, EnergyCurve]:
        """Pick the number of colors by the elbow of their energies."""
        taken = ("volume_power", "rng", "callback")
        options: dict[str, Any] = {name: value for name, value in engine.items() if name in taken}
        n_colors, curve = auto_count(self._counted, space=self._space, **options)
        return max(n_colors, self.least), curve

    def mapped(
        self, palette: ArrayLike, tessellation: Tessellation | None = None, curve: EnergyCurve | None = None
    ) -> Quantized:
        """Map the image to a palette."""
        result = map_samples(self._samples, palette, self._space, self._dither, self._strength)
        colors, alpha = result.palette, result.alpha
        if self._has_idle_alpha and not alpha:
            colors, alpha = with_alpha(colors), True
        n_channels = colors.shape[1]
        as_before = n_channels == 1 or self._shape[2:] == (n_channels,)
        shape = self._shape if as_before else (*self._shape[:2], n_channels)
        result = replace(result, palette=colors, alpha=alpha, shape=shape, tessellation=tessellation, curve=curve)
        return keep_outside(result, self._image)

    def first_reaching(
        self,
        value: Callable[[Quantized], float],
        target: float,
        n_colors: int,
        per_octave: float,
        engine: EngineOptions,
    ) -> dict[bool, Quantized]:
        """Return the result with the fewest colors whose value reaches the target, under True.

        Under False is the result with one color less; either can be missing.

        A first pass with low effort shows where to look. Each trial is a search of its own, so that its result is what
        `quantize` returns for its size: starting from another trial would end at a higher energy.
        """
        least = self.least
        check_room(n_colors, least)
        n = _FIRST_TRIAL
        for effort in dict.fromkeys(["fast", engine.get("effort", "balanced")]):
            results: dict[bool, Quantized] = {}

            def measure(n: int, effort: EffortName = effort, results: dict[bool, Quantized] = results) -> float:
                result = self.quantized(n, {**engine, "effort": effort})
                reached = value(result)
                results[reached >= target] = result
                return reached

            n = first_reaching(measure, target, least, n_colors, first=n, per_octave=per_octave)
        return results
