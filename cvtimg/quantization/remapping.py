"""Images mapped to a palette: each pixel gets the nearest color."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_colors
from cvtimg.colors.fidelity import psnr
from cvtimg.colors.places import CLEAR, agree, allowed_for, has_alpha, kinds_of, to_places
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.colors.spaces import peak
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.engine.points import Points, assign, cell_energies, pack
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
from cvtimg.quantization import dithering

#: Labels of pixels have at most 16 bits.
MAX_COLORS = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Quantized:
    """A picture in few colors.

    Attributes
    ----------
    palette : (K, C) array of the picture's type
        Its colors. Where they were found and not given: those with transparency first, then from dark to bright; K
        can be less than was asked for, as a picture with few colors keeps them all, and generators that round to the
        same color are one color.
    indices : (H, W) uint8 array, or uint16 if K > 256
        For each pixel the index of its color.
    shape : tuple of int
        Shape of the picture: (H, W) or (H, W, C).
    energy : float
        Sum over the pixels of the squared difference to the picture, in squared sRGB units, whatever the space of
        the distances; where there is alpha, the mean of what is seen over black and over white.
    tessellation : Tessellation or None
        What the palette was rounded from, in the coordinates of the color space; None where the palette was given,
        or the picture had at most as many colors as were asked for.
    n_distinct : int
        Distinct colors of the picture before.
    curve : EnergyCurve or None
        What picked the number of colors, where it was "auto".
    """

    palette: NDArray[Any]
    indices: NDArray[Any]
    shape: tuple[int, ...]
    energy: float
    tessellation: Tessellation | None
    n_distinct: int
    curve: EnergyCurve | None = None

    def __post_init__(self) -> None:
        for array in (self.palette, self.indices):
            array.flags.writeable = False

    def __repr__(self) -> str:
        """Tell size, colors and error in one line."""
        shape = " x ".join(map(str, self.shape))
        error = "exact" if not self.energy else f"PSNR {self.psnr:.2f} dB"
        return f"Quantized({shape} {self.palette.dtype}, {len(self.palette)} of {self.n_distinct} colors, {error})"

    def _repr_png_(self) -> bytes | None:
        """Return the image as PNG, for notebooks; None if a PNG cannot hold it."""
        from cvtimg.pictures.formats.encoding import encode_image

        pixels, palette = self.content
        if pixels.dtype not in (np.uint8, np.uint16) or self.palette.shape[1] > 4:
            return None
        return encode_image(".png", pixels, palette=palette)

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the image, indexed where the format allows, as `cvtimg.write_image` does."""
        from cvtimg.pictures.files import write_image

        pixels, palette = self.content
        write_image(path, pixels, palette=palette, overwrite=overwrite)

    @property
    def image(self) -> NDArray[Any]:
        """The picture in its new colors, (H, W) or (H, W, C), of the type of the original."""
        pixels: NDArray[Any] = self.palette[self.indices]
        return pixels.reshape(self.shape)

    @property
    def mse(self) -> float:
        """Mean squared error of a sample, alpha apart, as in skimage.metrics.mean_squared_error."""
        n_channels = self.palette.shape[1]
        return float(self.energy / (self.indices.size * (n_channels - has_alpha(n_channels))))

    @property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio in dB; the peak is 255, 65535, or 1 for floating point. Infinite if exact."""
        return float(psnr(self.mse, peak(self.palette.dtype)))

    @property
    def content(self) -> tuple[NDArray[Any], NDArray[np.uint8] | None]:
        """What `write_image` takes: indices and a palette of RGB or RGBA, or the picture where no file has such."""
        n_channels = self.palette.shape[1]
        # Grey with alpha has no form in files of its own.
        channels = {1: [0, 0, 0], 2: [0, 0, 0, 1]}.get(n_channels, slice(None))
        if len(self.palette) <= 256 and self.palette.dtype == np.uint8 and n_channels <= 4:
            return self.indices, self.palette[:, channels]
        if n_channels == 1:
            return self.image.reshape(self.indices.shape), None
        return self.palette[:, channels][self.indices], None


def map_to_palette(
    picture: Any,
    palette: ArrayLike,
    *,
    space: str = "rgb",
    dither: str | None = None,
    dither_strength: float = 1.0,
) -> Quantized:
    """Give each pixel of an image the nearest color of a palette.

    Opaque pixels get opaque colors if the palette has any. Fully transparent pixels stay fully transparent: if the
    palette has no such color, one is appended.

    Parameters
    ----------
    picture : (H, W) or (H, W, C) array, Pillow image, or ColorSamples of one
        uint8, uint16 or floating point. Of two or four channels the last is alpha.
    palette : (K, C) array
        In the units of the picture, K <= 65536. Grey pictures take colors too, opaque ones colors with alpha, and the
        other way round.
    space : {"rgb", "linear", "lab", "oklab"}
        Where distances are measured.
    dither : {"floyd-steinberg", "edge-aware", "blue-noise", "bayer-2", "bayer-4", "bayer-8", "bayer-16"}, optional
        Mix colors so that areas keep the color of the image; by default each pixel gets the nearest color.
    dither_strength : float
        Fraction of the error that is handed on, in 0..1: less gives less grain, 1 keeps the mean best.

    Returns
    -------
    Quantized
        With the palette as it was given.

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here; the message names it.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.quantization import map_to_palette
    >>> picture = np.array([[10, 12, 200], [11, 202, 201]], dtype=np.uint8)
    >>> map_to_palette(picture, [0, 128, 255]).image.tolist()
    [[0, 0, 255], [0, 255, 255]]
    """
    samples = picture if isinstance(picture, ColorSamples) else color_samples(picture)
    colors, indices, energy = map_samples(samples, palette, space, dither, dither_strength)
    shape = (*indices.shape, colors.shape[1]) if colors.shape[1] > 1 else indices.shape
    return Quantized(colors, indices, shape, energy, None, samples.n_colors)


def map_samples(
    samples: ColorSamples, palette: ArrayLike, space: str, dither: str | None, dither_strength: float
) -> tuple[NDArray[Any], NDArray[Any], float]:
    """Return the palette, the (H, W) index of the color of each pixel, and the energy; see `map_to_palette`."""
    colors = check_colors("palette", palette, samples.colors.dtype)
    samples, colors = agree(samples, colors)
    if (kinds_of(samples.colors) == CLEAR).any() and not (kinds_of(colors) == CLEAR).any():
        colors = np.concatenate([colors, np.zeros_like(colors[:1])])
    if len(colors) > MAX_COLORS:
        raise ValueError(f"palette has {len(colors)} colors and must have at most {MAX_COLORS}")
    dtype = np.uint8 if len(colors) <= 256 else np.uint16
    if dither is None:
        labels, energy = _map(samples, colors, space)
        return colors, labels.astype(dtype)[samples.inverse], energy
    labels, energy = _dither(samples, colors, space, dither, dither_strength)
    return colors, labels.astype(dtype), energy


def _map(samples: ColorSamples, palette: NDArray[Any], space: str) -> tuple[NDArray[np.int32], float]:
    """(M,) index of the color of the palette for each sample, and the energy of that map in sRGB."""
    kinds, places, ends = kinds_of(samples.colors), to_places(samples.colors, space), to_places(palette, space)
    points = pack(places, samples.density)
    if has_alpha(samples.colors.shape[1]):
        labels = nearest_of_kind(places, kinds, ends, kinds_of(palette))
    else:
        labels = nearest(points, ends)
    if space != "rgb":
        points, ends = pack(to_places(samples.colors, "rgb"), samples.density), to_places(palette, "rgb")
    return labels, _energy(points, ends, labels)


def _dither(
    samples: ColorSamples, palette: NDArray[Any], space: str, method: str, strength: float
) -> tuple[NDArray[np.int32], float]:
    """(H, W) index of the color of the palette for each pixel, and the energy of that map in sRGB."""
    labels = dithering.dither(
        to_places(samples.colors, space),
        samples.inverse,
        to_places(palette, space),
        method=method,
        strength=strength,
        kinds=kinds_of(samples.colors),
        allowed=allowed_for(kinds_of(palette)),
    )
    places, ends = to_places(samples.colors, "rgb"), to_places(palette, "rgb")
    return labels, dithering.energy_of(places, samples.inverse, ends, labels)


def _energy(points: Points, places: NDArray[Any], labels: NDArray[np.int32]) -> float:
    """Sum of density times squared distance from (N,) points to the places that their labels name."""
    padded = np.append(labels, np.zeros(len(points.density) - len(labels), np.int32))
    # Rounded as the points are, so that a color that is in the palette has no error.
    inside = points.frame.inward(places).astype(np.float32).astype(np.float64)
    return points.frame.energy(cell_energies(points, inside, padded).sum())


def nearest(points: Points, places: NDArray[Any]) -> NDArray[np.int32]:
    """(N,) index of the nearest of (K, D) places to each point, the lowest on a tie."""
    inside = points.frame.inward(places)
    if points.n_dims > 1:
        return assign(points, inside)[: points.n_points]
    # `assign` works in float32, which cannot separate thousands of grey levels.
    order = np.argsort(inside[:, 0], kind="stable")
    levels = inside[order, 0]
    which = np.searchsorted((levels[1:] + levels[:-1]) / 2, points.coordinate(0)[: points.n_points])
    return order[which].astype(np.int32)


def nearest_of_kind(
    places: NDArray[np.float64],
    kinds: NDArray[np.uint8],
    ends: NDArray[np.float64],
    kinds_of_ends: NDArray[np.uint8],
) -> NDArray[np.int32]:
    """(N,) index of the nearest of (K, D) places to each, of those that its kind may become."""
    labels = np.empty(len(places), np.int32)
    for kind, allowed in enumerate(allowed_for(kinds_of_ends)):
        some, choice = places[kinds == kind], np.flatnonzero(allowed)
        if len(some):
            labels[kinds == kind] = choice[nearest(pack(some, np.ones(len(some))), ends[choice])]
    return labels
