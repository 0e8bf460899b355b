"""Color quantization: a picture in the few colors that stand best for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._checks import check_count
from cvtimg.cvt import Tessellation, tessellate
from cvtimg.methods import Method
from cvtimg.points import assign, cell_energies, pack
from cvtimg.samples import ColorSamples, color_samples

#: Labels of pixels have at most 16 bits.
MAX_COLORS = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class Quantized:
    """A picture in few colors.

    Attributes
    ----------
    palette : (K, D) array of the picture's type
        Its colors, from dark to bright. K can be less than was asked for: a picture with few colors keeps them
        all, and generators that round to the same color are one color.
    indices : (H, W) uint8 array, or uint16 if K > 256
        For each pixel the index of the nearest color of the palette.
    shape : tuple of int
        Shape of the picture: (H, W) or (H, W, C).
    energy : float
        Sum over the pixels of the squared distance to their color of the palette, in squared color units.
    tessellation : Tessellation or None
        What the palette was rounded from; None where the picture had at most as many colors as were asked for.
    n_distinct : int
        Distinct colors of the picture before.
    """

    palette: NDArray[Any]
    indices: NDArray[Any]
    shape: tuple[int, ...]
    energy: float
    tessellation: Tessellation | None
    n_distinct: int

    def __post_init__(self) -> None:
        for array in (self.palette, self.indices):
            array.flags.writeable = False

    @property
    def image(self) -> NDArray[Any]:
        """The picture in its new colors, (H, W) or (H, W, C), of the type of the original."""
        pixels: NDArray[Any] = self.palette[self.indices]
        return pixels.reshape(self.shape)

    @property
    def mse(self) -> float:
        """Mean squared error of a sample, as in skimage.metrics.mean_squared_error."""
        return self.energy / float(np.prod(self.shape))

    @property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio in dB; the peak is 255, 65535, or 1 for floating point. Infinite if exact."""
        peak = np.iinfo(self.palette.dtype).max if self.palette.dtype.kind == "u" else 1.0
        return float(10 * np.log10(peak**2 / self.mse)) if self.energy else float("inf")


def quantize(
    image: Any,
    n_colors: int,
    *,
    method: str | Method | None = None,
    init: str | ArrayLike = "split",
    effort: str = "balanced",
    volume_power: float = 0,
    rng: int | np.random.Generator = 0,
) -> Quantized:
    """Find the colors that stand best for a picture, and give each pixel the nearest of them.

    The palette is rounded to the depth of the picture before the pixels are mapped to it. A picture that has at
    most `n_colors` colors comes back exactly.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        uint8, uint16 or floating point.
    n_colors : int
        Size of the palette, in 1..65536.
    method, init, effort, volume_power, rng
        As in `tessellate`. Pixels go to the nearest color whatever the `volume_power` that the palette is made with.

    Returns
    -------
    Quantized

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here; the message names it.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import quantize
    >>> picture = np.array([[10, 12, 200], [11, 202, 201]], dtype=np.uint8)
    >>> result = quantize(picture, 2)
    >>> result.image.tolist(), result.energy
    ([[11, 11, 201], [11, 201, 201]], 4.0)
    """
    check_count("n_colors", n_colors, MAX_COLORS, "the largest palette")
    samples = color_samples(image)
    shape = samples.inverse.shape + np.shape(image)[2:]
    if samples.n_colors <= n_colors:
        tessellation, palette = None, samples.colors
    else:
        tessellation = tessellate(
            samples, n_colors, method=method, init=init, effort=effort, volume_power=volume_power, rng=rng
        )
        palette = _to_depth(tessellation.generators, samples.colors.dtype)
    palette = _dark_to_bright(palette)
    nearest, energy = _map_to_palette(samples, palette)
    indices = nearest.astype(np.uint8 if len(palette) <= 256 else np.uint16)[samples.inverse]
    return Quantized(palette, indices, shape, energy, tessellation, samples.n_colors)


def _to_depth(generators: NDArray[np.float64], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Round to integers where the picture has integers; means are always within range."""
    return (np.rint(generators) if dtype.kind == "u" else generators).astype(dtype)


def _dark_to_bright(palette: NDArray[Any]) -> NDArray[Any]:
    """Distinct colors by the sum of their channels."""
    ordered = palette[np.lexsort((*palette.T[::-1], palette.sum(axis=1, dtype=np.float64)))]
    is_new = np.append(True, (ordered[1:] != ordered[:-1]).any(axis=1))
    distinct: NDArray[Any] = ordered[is_new]
    return distinct


def _map_to_palette(samples: ColorSamples, palette: NDArray[Any]) -> tuple[NDArray[np.int32], float]:
    """(M,) index of the nearest color of the palette to each sample, and the energy of that map."""
    points = pack(samples.colors, samples.density)
    inside = points.frame.inward(palette)
    labels = assign(points, inside)
    return labels[: points.n_points], points.frame.energy(cell_energies(points, inside, labels).sum())
