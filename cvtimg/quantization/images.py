"""Color quantization: the palette that represents an image with the least error, and the image in its colors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg._shared.checks import check_alpha, check_keywords
from cvtimg._shared.choices import DitherName, GoalName, SpaceName
from cvtimg._shared.messages import warn
from cvtimg._shared.pixels import are_shades, array_of, narrowed, peak
from cvtimg._shared.types import Array, ImageLike
from cvtimg.colors.places import CLEAR, kinds_of, with_alpha, without_idle_alpha
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.elbow.curves import EnergyCurve, auto_count
from cvtimg.looks.similarity import Qualities
from cvtimg.pictures.formats.encoding import as_stored, encode_image
from cvtimg.pictures.formats.metadata import Metadata
from cvtimg.pictures.formats.png import roughness
from cvtimg.quantization.driver import QuantizeOptions, Source, judged, quantized
from cvtimg.quantization.looks import MAX_ENTRIES, visible
from cvtimg.quantization.palette_search import EngineOptions, Palette, fixed_colors, keeping_main_colors
from cvtimg.quantization.remapping import Quantized, keep_outside, map_samples

#: Side of the pieces by which an image is judged, and how many of them are beside each other; at least, if few will do.
_PIECE, _N_PIECES, _FEW_PIECES = 64, 11, 5
#: Least share of pixels of the color of the one to their left in drawings: they have .5 to 1, photographs 0 to .2.
_DRAWN = 0.3
#: Greatest mean size, in levels, of what filters leave of an image that may be small as it is; of photographs 3 to 10.
_SMOOTH = 1.5


def quantize(
    image: ImageLike,
    n_colors: int | Literal["auto"] | None = None,
    *,
    alpha: bool | None = None,
    mask: ArrayLike | None = None,
    space: SpaceName = "rgb",
    palette: ArrayLike | None = None,
    ramp: bool = False,
    locked: ArrayLike | None = None,
    color_bits: int | Sequence[int] | None = None,
    psnr: float | None = None,
    max_bytes: int | None = None,
    dither: DitherName | None = None,
    dither_strength: float | None = None,
    weights: ArrayLike | None = None,
    goal: GoalName = "error",
    quality: float | tuple[float, float] | None = None,
    **engine: Unpack[EngineOptions],
) -> Quantized:
    """Find the palette that represents an image with the least error, and give each pixel its nearest color.

    The palette is rounded to the depth of the image before the pixels are mapped to it. Images with at most `n_colors`
    colors are reproduced exactly. This is `find_palette` followed by `map_to_palette`.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Any integer or floating point type and byte order; white is the largest integer of the type, or 1 for floats.
        Integers of wide types that would be nearly black, but fit in 8 or 16 bits, are taken as those for eyes and in
        other spaces than "rgb".
        Also masked arrays, and objects with ``__array__`` or the DLPack protocol.
    n_colors : int or "auto", optional
        Size of the palette, in 1..65536. This includes the locked colors and, if there are fully transparent pixels,
        the transparent color. "auto" uses the elbow of the energy curve, which the result then contains (see
        `EnergyCurve.elbow`), or as many more as keep the main colors of an image in color. With `psnr` or `max_bytes`
        it may be omitted, and is the maximum size.
    alpha : bool, optional
        Whether the last channel is alpha. Then colors count as far as they are visible, opaque pixels stay opaque, and
        fully transparent pixels stay so. By default that of a Pillow image with alpha, and of an array that
        `cvtimg.read_image` read from such a file. All channels of other arrays are bands that count the same; for
        uint8 arrays of four channels, which may be RGBA, a warning asks for `alpha`.
    mask : (H, W) array, optional
        Pixels to quantize, where it is not 0. The others, and pixels that are not finite or masked in a masked array,
        have no influence, keep their value in the result, and become transparent in indexed files.
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
    locked : (L, C) array, optional
        Colors that the palette must contain, in the units of the image.
    color_bits : int or three ints, optional
        Bits per channel of the hardware that shows the colors, in 1..8, such as 5 or (5, 6, 5): the palette has only
        colors that it can show; see `find_palette`.
    psnr : float, optional
        Use the fewest colors that reach this quality in dB.
    max_bytes : int, optional
        Use the most colors, up to `n_colors` or 256, whose .png (.npy, if no .png holds the samples) has at most this
        size. With ``goal="eyes"`` the colors stay, as far as bits can be saved in other ways; `quality` is then the
        most that is aimed at.
    dither : {"floyd-steinberg", "edge-aware", "blue-noise", "bayer", "compact"}
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
        default, found in Oklab, and ``dither="compact"``; without `quality` it aims at 85, or at one point less than
        the colors reach if that is less.
    quality : float or (float, float), optional
        The smallest file whose `cvtimg.content_quality` is at least this, in 0..100: 80 is hard to tell from the
        original, 70 is good. Where the colors do not reach it, the best that they reach, with a warning; of a range,
        the upper end is wanted, and less than the lower end is an error. It implies ``goal="eyes"``; see Notes.
    method, init, effort, volume_power, rng, callback
        As in `tessellate`. Pixels are mapped to their nearest color, whatever the `volume_power`. With `psnr` or
        "auto", `callback` is called in each of several searches; an exception that it raises ends them all.

    Returns
    -------
    Quantized

    Raises
    ------
    ValueError
        Also if `psnr`, `max_bytes` or the lower end of `quality` cannot be reached.

    Notes
    -----
    The quality follows from the price of bits in "compact", and once that would show as streaks, which the measure does
    not see, from fewer colors and less diffusion.

    Examples
    --------
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
        n_colors, psnr=psnr, max_bytes=max_bytes, palette=palette, locked=locked, color_bits=color_bits, ramp=ramp,
        space=space, dither=dither, dither_strength=dither_strength, goal=goal, quality=quality, engine=engine,
    ).aimed()  # fmt: skip
    how.check(weights=weights)
    seen = as_seen(image) if how.space != "rgb" else image
    result: Quantized = quantized(PictureSource(seen, alpha, mask, weights), how)
    return result


def as_seen(image: Any) -> Any:
    """Return an image whose white is that of its type, where this can be; warn where that leaves it nearly black."""
    array = image if isinstance(image, np.ndarray) else array_of(image)
    narrow = narrowed(array)
    if narrow.size and not are_shades(narrow):
        white, most = peak(narrow.dtype), float(narrow.max())
        if 0 < most <= white and narrow.min() >= 0:
            warn(f"the image is nearly black to eyes: it reaches {most:g}, and white is {white:g}")
    return image if narrow is array else narrow


class PictureSource(Source):
    """An image in memory: the `Source` of `quantize`; of a file, also what to keep of that."""

    def __init__(
        self,
        image: ImageLike,
        alpha: bool | None,
        mask: ArrayLike | None,
        weights: ArrayLike | None,
        suffix: str = "",
        metadata: Metadata | None = None,
        smallest: bool = False,
    ) -> None:
        array = array_of(image)
        n_channels = array.shape[2] if array.ndim == 3 else 1
        has_alpha = check_alpha(alpha, image, n_channels)
        if alpha is None and not has_alpha and n_channels == 4 and array.dtype == np.uint8:
            warn("image has 4 channels that all count: give alpha=True if the last is alpha, else alpha=False")
        seen = without_idle_alpha(array) if has_alpha else array
        self._image, self._shape, self._has_idle_alpha = image, array.shape, seen is not array
        self._has_gaps = array.dtype.kind == "f" and not np.isfinite(seen).all()
        self.images = [np.where(np.isfinite(seen), seen, seen.dtype.type(0)) if self._has_gaps else seen]
        # A masked array is passed on whole, with its mask.
        given = seen if self._has_idle_alpha else image
        self._samples = color_samples(given, alpha=has_alpha and not self._has_idle_alpha, mask=mask)
        self.counted = [self._samples if weights is None else self._samples.weighted(weights)]
        self.n_pixels = self._samples.inverse.size
        in_png = array.dtype in (np.uint8, np.uint16) and n_channels in (1, 3, 4)
        self._suffix, self._metadata = suffix or (".png" if in_png else ".npy"), metadata
        self._smallest = smallest and suffix == ".png"
        self._sizes: dict[Quantized, int] = {}

    def sample(self, small: bool) -> PictureSource:
        """Return pieces from all over an image, one beside the other, or itself if it is small."""
        few = max(math.isqrt(self.n_pixels) // (2 * _PIECE), _FEW_PIECES)  # a quarter of the pixels
        n = min(few, _N_PIECES) if small else _N_PIECES
        if self.n_pixels <= 2 * (n * _PIECE) ** 2 or min(self._shape[:2]) < _PIECE:
            return self
        inside = None if self._samples.inside is None else _pieces(self._samples.inside, n)
        return PictureSource(_pieces(self.images[0], n), self._samples.alpha, inside, None)

    @cached_property
    def _qualities(self) -> Qualities:
        return Qualities(self.images[0])

    def quality(self, result: Quantized) -> float:
        """Return the quality of the content of a result."""
        return self._qualities.content(self._without_gaps(result))

    def visual_quality(self, result: Quantized) -> float:
        """Return the visual quality of a result."""
        return self._qualities.whole(self._without_gaps(result))

    def _without_gaps(self, result: Quantized) -> Array:
        """Return the image of a result where pixels without data, which cannot differ, are as in the original."""
        image = result.image
        return np.where(np.isfinite(image), image, self.images[0]) if self._has_gaps else image

    def size(self, result: Quantized) -> int:
        """Return the bytes of its file, which are counted once: the smallest of a flat picture takes long."""
        if result not in self._sizes:
            stored = self._content(result)
            pixels = as_stored(stored.pop("images")[0], self._suffix)[0]
            self._sizes[result] = len(encode_image(self._suffix, pixels, **stored))
        return self._sizes[result]

    def stored(self, result: Quantized) -> dict[str, Any]:
        """Return what a file of it holds."""
        n_colors = len(result.palette) + (result.inside is not None)
        if self._suffix == ".gif" and n_colors > MAX_ENTRIES:
            raise ValueError(f".gif holds images of at most {MAX_ENTRIES} colors, and this one has {n_colors}")
        found = self._content(result)
        pixels, notes = as_stored(found["images"][0], self._suffix)
        for note in notes:
            warn(note)
        return {**found, "images": [pixels]}

    def _content(self, result: Quantized) -> dict[str, Any]:
        """Return what is written; where nodata is kept, it is not indexed."""
        (pixels, palette), metadata = result.content_in(self._suffix), self._metadata
        if metadata and metadata.nodata is not None:
            if (result.palette == metadata.nodata).all(axis=1).any():  # a color would become nodata
                metadata = replace(metadata, nodata=None)
            else:
                pixels, palette = result.image, None
                pixels = pixels[..., 0] if pixels.ndim == 3 and result.palette.shape[1] == 1 else pixels
        alpha = result.alpha if palette is None and pixels.ndim == 3 else None
        found = {"images": [pixels], "palette": palette, "alpha": alpha, "metadata": metadata}
        return {**found, "smallest": True} if self._smallest else found

    @property
    def is_drawn(self) -> bool:
        """Whether pixels have the color of the one to their left as often as in drawings, and not in photographs."""
        kinds = kinds_of(self._samples.colors, self._samples.alpha)
        labels = np.where(kinds == CLEAR, -1, np.arange(len(kinds)))[self._samples.inverse]
        return labels.shape[1] > 1 and np.mean(labels[:, 1:] == labels[:, :-1]) >= _DRAWN

    @property
    def seen(self) -> Sequence[ColorSamples]:
        """Its samples, of which those count less in photographs that texture hides: 1 to 2 % fewer bytes."""
        given = self.counted[0] is not self._samples
        return self.counted if given or self.is_drawn else [self._samples.weighted(visible(self._samples))]

    def exact(self, how: QuantizeOptions) -> Quantized | None:
        """Return the image in all its colors, where a file may hold these in few bytes, as it holds gradients."""
        own = self._samples.colors
        fits = self._smallest and own.dtype == np.uint8 and own.shape[1] in (1, 3, 4) and len(own) <= MAX_COLORS
        fits = fits and self._samples.inside is None
        if not fits or roughness(self.images[0].reshape(*self._shape[:2], -1)) > _SMOOTH:
            return None
        return self.mapped([Palette(own, None)], replace(how, dither=None))

    def elbow(self, how: QuantizeOptions) -> tuple[int, EnergyCurve]:
        """Pick the number of colors by the elbow of their energies, and as many more as keep the main colors."""
        taken = ("volume_power", "rng", "callback")
        options: dict[str, Any] = {name: value for name, value in how.engine.items() if name in taken}
        n_colors, curve = auto_count(self.counted[0], space=how.space, **options)
        n_colors = keeping_main_colors(self.counted[0], curve, n_colors, how.space)
        return max(n_colors, fixed_colors(self._samples, how.locked)[2]), curve

    def kept(self, palette: Array, how: QuantizeOptions) -> Quantized | None:
        """Return the image in its own palette, if that is small enough and has all its colors."""
        if not isinstance(how.n_colors, int) or how.locked is not None or how.color_bits is not None:
            return None
        own = self._samples.colors
        if len(palette) > how.n_colors or palette.dtype != own.dtype or palette.shape[1:] != (*self._shape, 1)[2:3]:
            return None
        result = self.mapped([Palette(palette, None)], how)
        if result.energy or len(result.palette) > len(palette):
            return None
        return judged(self, result) if how.goal == "eyes" else result

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


def _pieces(image: Array, n: int) -> Array:
    """Return n x n pieces that are spread evenly, by M. Roberts' R2 sequence."""
    shares = np.outer(np.arange(1, n * n + 1), [0.7548776662466927, 0.5698402909980532]) % 1
    corners = (shares * (np.array(image.shape[:2]) - _PIECE)).astype(int)
    pieces = [image[y : y + _PIECE, x : x + _PIECE] for y, x in corners]
    return np.concatenate([np.concatenate(pieces[i::n], axis=1) for i in range(n)])
