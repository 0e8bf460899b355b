"""Color quantization: a picture in the few colors that stand best for it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, Literal, Unpack

from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_alone, check_count, check_image, check_non_negative
from cvtimg.colors.places import has_alpha, with_alpha, without_idle_alpha
from cvtimg.colors.samples import color_samples
from cvtimg.elbow.curves import EnergyCurve, auto_count
from cvtimg.engine.tessellation import Tessellation
from cvtimg.quantization.dithering import STRENGTH
from cvtimg.quantization.palette_search import EngineOptions, check_room, find_palette, fixed_colors
from cvtimg.quantization.remapping import MAX_COLORS, Quantized, map_samples
from cvtimg.quantization.targets import first_reaching

#: Colors to begin with, and what twice as many bring at least, where a target is to be reached.
_FIRST_TRIAL = 32
_DECIBEL = 2.0
_BYTES_A_PIXEL = 0.05


def quantize(
    image: Any,
    n_colors: int | Literal["auto"] | None = None,
    *,
    space: str = "rgb",
    palette: ArrayLike | None = None,
    locked: ArrayLike | None = None,
    psnr: float | None = None,
    dither: str | None = None,
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
        uint8, uint16 or floating point. Of two or four channels the last is alpha: colors count as far as they are
        seen, opaque pixels stay opaque, and what is fully transparent stays so.
    n_colors : int
        Size of the palette, in 1..65536, with the locked colors and, if there are such pixels, with full transparency.
        With `psnr` the largest size, and not needed; not to be given with `palette`. "auto" takes the elbow of the
        energy curve, which the result then has; see `EnergyCurve.elbow`.
    space : {"rgb", "linear", "lab", "oklab"}
        Where distances are measured, and means are taken. All but "rgb" are for grey and RGB, with alpha or without.
    palette : (K, C) array, optional
        Colors to map the picture to, in its units, in place of finding some.
    locked : (L, C) array, optional
        Colors that are in the palette exactly, in the units of the picture.
    psnr : float, optional
        Quality in dB: take the fewest colors that reach it.
    dither : {"floyd-steinberg", "edge-aware", "blue-noise", "bayer-2", "bayer-4", "bayer-8", "bayer-16"}, optional
        Mix colors so that areas keep the color of the image; by default each pixel gets the nearest color. "edge-aware"
        keeps text, drawings and flat areas clean.
    dither_strength : float, optional
        Fraction of the error that is handed on, in 0..1: less gives less grain, 1 keeps the mean best. By default 0.9,
        and 1 with a given `palette`, which may need strong mixtures.
    weights : (H, W) array, optional
        Weight >= 0 of each pixel in the search for the palette; 1 by default.
    method, init, effort, volume_power, rng
        As in `tessellate`. Pixels go to the nearest color whatever the `volume_power` that the palette is made with.

    Returns
    -------
    Quantized

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here, or `psnr` is not reached; the message names it.

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
    source = _Source(image, locked, weights, space, dither, dither_strength)
    if palette is not None:
        others = {"n_colors": n_colors, "locked": locked, "psnr": psnr, "weights": weights, **engine}
        check_alone("palette", [name for name, value in others.items() if value is not None])
        return source.mapped(palette)
    if psnr is None:
        if n_colors is None:
            raise TypeError("n_colors, psnr or palette must be given")
        if n_colors == "auto":
            n_colors, curve = source.elbow(engine)
            return source.quantized(n_colors, engine, curve)
        return source.quantized(n_colors, engine)
    quality = check_non_negative("psnr", psnr)
    if n_colors == "auto":
        raise ValueError("n_colors='auto' and psnr exclude each other")
    most = MAX_COLORS if n_colors is None else n_colors
    results = source.first_reaching(lambda result: result.psnr, quality, most, _DECIBEL, engine)
    if True not in results:
        best = results[False]
        raise ValueError(f"psnr={psnr} is not reached by {len(best.palette)} colors, only {best.psnr:.2f} dB")
    return results[True]


def quantize_to_size(
    image: Any,
    max_bytes: int,
    size: Callable[[Quantized], int],
    n_colors: int = 256,
    *,
    space: str = "rgb",
    locked: ArrayLike | None = None,
    dither: str | None = None,
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
    space, locked, dither, dither_strength, weights, method, init, effort, volume_power, rng
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
    source = _Source(image, locked, weights, space, dither, strength)
    results = source.first_reaching(size, max_bytes + 1, n_colors, _BYTES_A_PIXEL * source.n_pixels, engine)
    if False not in results:
        fewest = results[True]
        raise ValueError(
            f"max_bytes={max_bytes} must be at least {size(fewest)}, for the fewest colors, {len(fewest.palette)}"
        )
    found = results[False]
    if len(found.palette) == 1 < found.n_distinct:
        warnings.warn(f"max_bytes={max_bytes} leaves one color of {found.n_distinct}", UserWarning, stacklevel=2)
    return found


class _Source:
    """A picture that palettes of several sizes are tried on, and how they are found and used."""

    def __init__(
        self,
        image: Any,
        locked: ArrayLike | None,
        weights: ArrayLike | None,
        space: str,
        dither: str | None,
        dither_strength: float,
    ) -> None:
        array = check_image("image", image)
        seen = without_idle_alpha(array)
        self._shape, self._has_idle_alpha = array.shape, seen is not array
        self._samples = color_samples(seen)
        self._counted = self._samples if weights is None else self._samples.weighted(weights)
        self._locked, self._space = locked, space
        self._dither, self._strength = dither, dither_strength
        self.n_pixels = self._samples.inverse.size

    @property
    def least(self) -> int:
        """How many colors its palettes must have."""
        return fixed_colors(self._samples, self._locked)[2]

    def quantized(self, n_colors: int, engine: EngineOptions, curve: EnergyCurve | None = None) -> Quantized:
        """Find a palette and map the picture to it."""
        found = find_palette(self._counted, n_colors, space=self._space, locked=self._locked, **engine)
        return self.mapped(found.colors, found.tessellation, curve)

    def elbow(self, engine: EngineOptions) -> tuple[int, EnergyCurve]:
        """Pick the number of colors by the elbow of their energies."""
        options: dict[str, Any] = {name: value for name, value in engine.items() if name in ("volume_power", "rng")}
        n_colors, curve = auto_count(self._counted, space=self._space, **options)
        return max(n_colors, self.least), curve

    def mapped(
        self, palette: ArrayLike, tessellation: Tessellation | None = None, curve: EnergyCurve | None = None
    ) -> Quantized:
        """Map the picture to a palette."""
        colors, indices, energy = map_samples(self._samples, palette, self._space, self._dither, self._strength)
        if self._has_idle_alpha and not has_alpha(colors.shape[1]):
            colors = with_alpha(colors)
        n_channels = colors.shape[1]
        as_before = n_channels == 1 or self._shape[2:] == (n_channels,)
        shape = self._shape if as_before else (*self._shape[:2], n_channels)
        return Quantized(colors, indices, shape, energy, tessellation, self._samples.n_colors, curve)

    def first_reaching(
        self,
        value: Callable[[Quantized], float],
        target: float,
        n_colors: int,
        per_octave: float,
        engine: EngineOptions,
    ) -> dict[bool, Quantized]:
        """Return the result of the first size of palette whose value reaches the target, under True.

        Under False is that of one color less; either can be missing.

        Low effort tells where to look. Each trial is a search of its own, so that its result is what `quantize` gives
        for its size: from the generators of another trial it would end at more energy.
        """
        least = self.least
        check_room(n_colors, least)
        n = _FIRST_TRIAL
        for effort in dict.fromkeys(["fast", engine.get("effort", "balanced")]):
            results: dict[bool, Quantized] = {}

            def measure(n: int, effort: str = effort, results: dict[bool, Quantized] = results) -> float:
                result = self.quantized(n, {**engine, "effort": effort})
                reached = value(result)
                results[reached >= target] = result
                return reached

            n = first_reaching(measure, target, least, n_colors, first=n, per_octave=per_octave)
        return results
