"""Images mapped to a palette: each pixel gets the nearest color."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg._shared.checks import check_choice, check_colors
from cvtimg._shared.choices import DitherName, SpaceName
from cvtimg._shared.messages import warn
from cvtimg._shared.pixels import array_of, psnr, says_alpha, white_among, with_mark
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.sums import take_rows
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Array, Bools, Bytes, Floats, ImageLike, Ints
from cvtimg.colors.places import CLEAR, agree, allowed_for, kinds_of, to_places, widen
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.colors.spaces import to_depth, to_space
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.engine.points import Points, assign, pack
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
from cvtimg.looks.rate import USUAL, Rate
from cvtimg.quantization import dithering
from cvtimg.quantization.looks import Below, map_for_eyes

#: Energies are added by parts of this many pixels, for the sake of memory.
_PIXELS_AT_ONCE = 1 << 18
#: Sizes of palettes of which indices of 1, 2, 4 and 8 bits are full.
_FULL = (2, 4, 16, 256)


class Storing(NamedTuple):
    """How pages and tiles hold their pixels: indices; or colors, with those that do not count clear; or colors."""

    indexed: bool
    clears: bool

    @classmethod
    def of(cls, palette: Array, *, left_out: bool, keeps_nodata: bool, indexed: bool) -> Storing:
        """Return how a type holds a palette; where pixels are left out they stay nodata, or become clear in 8 bits."""
        eight_bit = palette.dtype == np.uint8 and palette.shape[1] in (1, 3)
        fits = eight_bit and palette.shape[1] == 3 and len(palette) <= 256
        return cls(indexed and fits and not left_out, left_out and eight_bit and not keeps_nodata)


class Fidelity:
    """Figures of results that have an `energy` over `n_values` samples, and a `palette` of the type of the image."""

    __slots__ = ()

    @property
    def mse(self: Any) -> float:
        """Mean squared error per sample, alpha not counted, as in skimage.metrics.mean_squared_error."""
        return float(self.energy / self.n_values)

    @property
    def psnr(self: Any) -> float:
        """Peak signal-to-noise ratio in dB, infinite if exact.

        The peak is the white of the type; for floating point it is 1, or the range of a palette that leaves 0..1.
        """
        return float(psnr(self.mse, white_among(self.palette)))


@dataclass(frozen=True, slots=True, eq=False)
class Quantized(ReadOnly, Fidelity):
    """An image in few colors.

    Attributes
    ----------
    palette : (K, C) array of the type of the image
        The colors. A palette that was found has transparent colors first, then the others from dark to bright; it can
        have fewer colors than requested, because images with few colors keep all of them, and generators that round to
        the same color are merged.
    indices : (H, W) uint8 array, or uint16 if K > 256
        Index of the color of each pixel; 0 for pixels that do not count. None for an image that was written in tiles.
    shape : tuple of int
        Shape of the image: (H, W) or (H, W, C).
    energy : float
        Sum over the pixels of the squared difference to the original, in squared sRGB units, whatever the color space
        of the distances; with alpha, the mean of this over a black and over a white background.
    tessellation : Tessellation or None
        The tessellation that the palette was rounded from, in the coordinates of the color space; None if the palette
        was given, or the image has at most as many colors as requested.
    n_distinct : int
        Number of distinct colors of the original.
    curve : EnergyCurve or None
        The curve that picked the number of colors, if that was "auto".
    alpha : bool
        Whether the last channel is alpha.
    inside : (H, W) bool array or None
        Pixels that count: in the mask, finite and not masked; None for all.
    outside : (n, C) array or None
        Values of the pixels that do not count, which `image` keeps.
    quality, content_quality : float or None
        The `cvtimg.visual_quality` and the `cvtimg.content_quality` of the image, where these were asked for.
    n_left_out : int
        Number of pixels that do not count.
    exact : bool
        Whether the palette was found from all distinct colors. In tiles, beyond 2^22 colors, neighbors are merged, and
        `n_distinct` is the largest number held at a time; the energy is exact all the same.
    """

    palette: Array
    indices: Any
    shape: tuple[int, ...]
    energy: float
    tessellation: Tessellation | None
    n_distinct: int
    curve: EnergyCurve | None = None
    alpha: bool = False
    inside: Bools | None = None
    outside: Array | None = None
    quality: float | None = None
    content_quality: float | None = None
    n_left_out: int = 0
    exact: bool = True

    def _claims(self) -> Claims:
        if self.indices is not None:
            yield "indices are those of colors", np.asarray(self.indices) < len(self.palette)

    def __repr__(self) -> str:
        """Tell size, colors and error in one line."""
        shape = " x ".join(map(str, self.shape))
        error = "exact" if not self.energy else f"PSNR {self.psnr:.2f} dB"
        return f"Quantized({shape} {self.palette.dtype}, {len(self.palette)} of {self.n_distinct} colors, {error})"

    def _repr_png_(self) -> bytes:
        """Return the image as PNG, for notebooks; dark images of more than 8 bits are stretched."""
        from cvtimg.pictures.formats.encoding import encode_image
        from cvtimg.pictures.showing import natural_limits, shown

        pixels, palette = self.content
        if palette is not None:
            return encode_image(".png", pixels, palette=palette)
        bands = np.asarray(pixels).reshape(*pixels.shape[:2], -1)
        bands = bands if says_alpha(pixels) else bands[..., :3]
        seen = bands if self.inside is None else bands[self.inside]
        return encode_image(".png", shown(bands, natural_limits(seen)))

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the image, indexed where the format allows, as `cvtimg.write_image` does."""
        from cvtimg.pictures.files import write_image

        pixels, palette = self.content_in(Path(path).suffix)
        alpha = self.alpha if palette is None and pixels.ndim == 3 else None
        write_image(path, pixels, palette=palette, alpha=alpha, overwrite=overwrite)

    @property
    def image(self) -> Array:
        """The image in its new colors, (H, W) or (H, W, C), of the type of the original."""
        pixels = take_rows(self.palette, self.indices)
        if self.inside is not None and self.outside is not None:
            pixels[~self.inside] = self.outside
        return with_mark(pixels.reshape(self.shape), self.alpha)

    @property
    def n_values(self) -> int:
        """Number of samples that count: pixels times channels without alpha."""
        return (math.prod(self.shape[:2]) - self.n_left_out) * (self.palette.shape[1] - self.alpha)

    def stored(self, storing: Storing) -> Array:
        """Return the pixels as pages and tiles hold them."""
        if storing.indexed:
            return np.asarray(self.indices)
        if not storing.clears:
            return self.image
        inside = np.ones(self.indices.shape, np.bool_) if self.inside is None else self.inside
        colors = np.broadcast_to(self.palette, (len(self.palette), 3))[self.indices]
        return np.concatenate([colors * inside[..., None], inside[..., None] * np.uint8(255)], axis=2)

    @property
    def content(self) -> tuple[Array, Bytes | None]:
        """What `write_image` takes: indices and a palette of RGB or RGBA, or an image if no file has such a palette.

        Pixels that do not count become transparent if an indexed image has room for one more color.
        """
        n_colors = self.palette.shape[1] - self.alpha
        if n_colors not in (1, 3):  # bands
            return self.image, None
        hidden = self.inside is not None
        if len(self.palette) + hidden <= 256 and self.palette.dtype == np.uint8:
            colors = widen(self.palette, self.alpha, 3, self.alpha or hidden)
            if self.inside is None:
                return self.indices, colors
            clear = np.uint8(len(colors))
            return np.where(self.inside, self.indices, clear), np.append(colors, np.zeros((1, 4), np.uint8), axis=0)
        if n_colors == 1 and self.alpha:  # gray with alpha has no form of its own in files
            return with_mark(widen(self.palette, True, 3, True)[self.indices], True), None
        return self.image.reshape(*self.indices.shape, -1)[..., 0] if n_colors == 1 else self.image, None

    def content_in(self, suffix: str) -> tuple[Array, Bytes | None]:
        """Return what `write_image` takes for a suffix: gray stays so where no palette of RGB can stand for it."""
        return (self.image, None) if suffix.lower() in (".npy", ".pgm") else self.content


def map_to_palette(
    image: ImageLike | ColorSamples,
    palette: ArrayLike,
    *,
    alpha: bool | None = None,
    mask: ArrayLike | None = None,
    space: SpaceName = "rgb",
    dither: DitherName | None = None,
    dither_strength: float = 1.0,
) -> Quantized:
    """Give each pixel of an image the nearest color of a palette.

    Opaque pixels get opaque colors if the palette has any. Fully transparent pixels stay fully transparent: if the
    palette has no such color, one is put first; in a palette of 2, 4, 16 or 256 colors, after which indices would need
    more bits, it takes the place of a color that no pixel has, if there is one.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, Pillow image, or ColorSamples of one
        Of any integer or floating point type; see `color_samples`.
    palette : (K, C) array
        Colors in the units of the image, K <= 65536. Gray images can take RGB colors, opaque images colors with alpha,
        and vice versa.
    alpha : bool, optional
        Whether the last channel is alpha; by default if the image says so. See `quantize`.
    mask : (H, W) array, optional
        Pixels to map, where it is not 0; the others keep their value.
    space, dither
        As in `quantize`.
    dither_strength : float
        As in `quantize`; in full by default.

    Returns
    -------
    Quantized
        With the given palette; a warning tells if a transparent color was put into it.

    Examples
    --------
    >>> from cvtimg.quantization import map_to_palette
    >>> image = np.array([[10, 12, 200], [11, 202, 201]], dtype=np.uint8)
    >>> map_to_palette(image, [0, 128, 255]).image.tolist()
    [[0, 0, 255], [0, 255, 255]]
    """
    if isinstance(image, ColorSamples):
        return map_samples(image, palette, space, dither, dither_strength)
    samples = color_samples(image, alpha=alpha, mask=mask)
    return keep_outside(map_samples(samples, palette, space, dither, dither_strength), image)


def keep_outside(result: Quantized, image: ImageLike) -> Quantized:
    """Let the pixels that do not count keep the values that they have in an image."""
    if result.inside is None:
        return result
    outside = np.ma.getdata(array_of(image)).reshape(*result.indices.shape, -1)[~result.inside]
    n_channels = result.palette.shape[1]
    if outside.shape[1] != n_channels:  # the palette has other channels
        outside = np.zeros((len(outside), n_channels), result.palette.dtype)
    return replace(result, outside=outside.astype(result.palette.dtype))


def map_samples(
    samples: ColorSamples,
    palette: ArrayLike,
    space: SpaceName,
    dither: DitherName | None,
    dither_strength: float,
    rate: Rate = USUAL,
    tones: Array | None = None,
    below: Below | None = None,
) -> Quantized:
    """Map samples with the way back to their pixels; see `map_to_palette`, and `Palette` for the tones."""
    if dither is not None:
        check_choice("dither", dither, (*dithering.DITHERS, "compact"))
    colors = check_colors("palette", palette, samples.colors.dtype)
    samples, colors = agree(samples, colors)
    kinds = [kinds_of(some, samples.alpha) for some in (samples.colors, colors)]
    lacks_clear = bool((kinds[0] == CLEAR).any() and not (kinds[1] == CLEAR).any())
    if lacks_clear:
        colors = np.concatenate([np.zeros_like(colors[:1]), colors])
    if len(colors) > MAX_COLORS:
        raise ValueError(f"palette must have at most {MAX_COLORS} colors, not {len(colors)}")
    seen, ends = (samples, colors) if tones is None else _by_tone(samples, colors, tones)
    if dither is None or dither == "compact":
        labels = _map(seen, ends, "oklab" if dither else space)
    if dither == "compact":
        labels = map_for_eyes(seen, ends, labels, rate, dither_strength, below)
    elif dither is not None:
        labels = _dither(seen, ends, space, dither, dither_strength)
    energy = _energy(samples, colors, labels)
    if lacks_clear:
        colors, labels = _fitted(colors, labels)
    labels = labels.astype(np.uint8 if len(colors) <= 256 else np.uint16)
    indices = samples.at_pixels(labels) if dither is None else labels
    alpha, inside, n_out = samples.alpha, samples.inside, 0
    if inside is not None:
        indices[~inside] = 0
        n_out = int(np.count_nonzero(~inside))
    shape = (*indices.shape, colors.shape[1]) if colors.shape[1] > 1 else indices.shape
    return Quantized(
        colors, indices, shape, energy, None, samples.n_colors, alpha=alpha, inside=inside, n_left_out=n_out
    )


def _fitted(colors: Array, labels: Ints) -> tuple[Array, Ints]:
    """Let a transparent color that was put first replace one without pixels, if indices would need more bits."""
    # This is said in a warning, as the palette is no longer the one that was given.
    n_given = len(colors) - 1
    idle = np.flatnonzero(np.bincount(labels.ravel(), minlength=len(colors))[1:] == 0) + 1
    said = "palette has no transparent color: one is put first, for the transparent pixels"
    if n_given in _FULL and len(idle):
        said += f", in place of entry {idle[-1] - 1} (from 0), which no pixel has"
        colors, labels = np.delete(colors, idle[-1], axis=0), labels - (labels > idle[-1])
    warn(said)
    return colors, labels


def tones_of(colors: Array, alpha: bool) -> Array:
    """Return the (N,) lightness of colors in Oklab, in their units."""
    lightness = to_space(np.ascontiguousarray(colors[:, : colors.shape[1] - alpha]), "oklab")[:, :1]
    return to_depth(lightness, colors.dtype)[:, 0]


def _by_tone(samples: ColorSamples, palette: Array, tones: Array) -> tuple[ColorSamples, Array]:
    """Return samples and the colors of a palette as grays, with their alpha."""
    n_seen = palette.shape[1] - samples.alpha
    rows = np.column_stack([tones_of(samples.colors, samples.alpha), samples.colors[:, n_seen:]])
    return replace(samples, rows=rows), np.column_stack([tones, palette[:, n_seen:]])


def _map(samples: ColorSamples, palette: Array, space: SpaceName) -> Ints:
    """Return the (M,) index of the nearest color of each sample."""
    alpha = samples.alpha
    places, ends = to_places(samples.colors, space, alpha), to_places(palette, space, alpha)
    if alpha:
        return nearest_of_kind(places, kinds_of(samples.colors, True), ends, kinds_of(palette, True))
    return nearest(pack(places, samples.density), ends)


def _dither(samples: ColorSamples, palette: Array, space: SpaceName, method: DitherName, strength: float) -> Ints:
    """Return the (H, W) index of the color of each pixel."""
    alpha = samples.alpha
    places, ends = to_places(samples.colors, space, alpha), to_places(palette, space, alpha)
    kinds, allowed = kinds_of(samples.colors, alpha), allowed_for(kinds_of(palette, alpha))
    inverse, clear = samples.inverse, np.flatnonzero(kinds == CLEAR)
    if len(clear) > 1:  # transparent pixels are one piece, whatever their hidden colors
        seen = np.arange(len(kinds), dtype=np.int32)
        seen[clear] = clear[0]
        inverse = seen[inverse]
    return dithering.dither(places, inverse, ends, method, strength, kinds, allowed, samples.inside)


def _energy(samples: ColorSamples, palette: Array, labels: Ints) -> float:
    """Return the energy in sRGB of (M,) labels of the colors, or of (H, W) labels of the pixels that count."""
    places, ends = (to_places(colors, "rgb", samples.alpha) for colors in (samples.colors, palette))
    if labels.ndim == 1:
        steps = places.astype(np.float64) - ends[labels]
        return float((samples.density * np.einsum("nd,nd->n", steps, steps)).sum())
    inverse = samples.inverse
    if samples.inside is not None:
        inverse, labels = inverse[samples.inside][:, None], labels[samples.inside][:, None]

    def energy(rows: slice) -> float:
        steps = places[inverse[rows]].astype(np.float64) - ends[labels[rows]]
        return float(np.einsum("hwd,hwd->", steps, steps))

    n_rows = -(-_PIXELS_AT_ONCE // inverse.shape[1])
    return sum(in_stripes(energy, len(inverse), 32.0 * inverse.size, n_rows))


def nearest(points: Points, places: Array) -> Ints:
    """Return the (N,) index of the place of (K, D) nearest to each point, the lowest on a tie."""
    inside = points.frame.inward(places)
    if points.n_dims > 1:
        return assign(points, inside)[: points.n_points]
    # `assign` works in float32, which cannot separate thousands of gray levels.
    order = np.argsort(inside[:, 0], kind="stable")
    levels = inside[order, 0]
    which = np.searchsorted((levels[1:] + levels[:-1]) / 2, points.coordinate(0)[: points.n_points])
    return order[which].astype(np.int32)


def nearest_of_kind(places: Floats, kinds: Bytes, ends: Floats, kinds_of_ends: Bytes) -> Ints:
    """Return the (N,) index of the nearest of (K, D) places, among those that the kind of each may become."""
    labels = np.empty(len(places), np.int32)
    for kind, allowed in enumerate(allowed_for(kinds_of_ends)):
        some, choice = places[kinds == kind], np.flatnonzero(allowed)
        if len(some):
            labels[kinds == kind] = choice[nearest(pack(some, np.ones(len(some))), ends[choice])]
    return labels
