"""What JPEG has rounded away: noise whose spectrum follows from the quantization tables of a file.

Quiet blocks, where noise is measured, do not show it, because their coefficients are rounded to zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Doubles = NDArray[np.float64]

#: Side of the blocks of JPEG, and how it makes bands of its luma and chroma.
_SIDE = 8
_BANDS = np.array([[1, 0, 1.402], [1, -0.344136, -0.714136], [1, 1.772, 0]])
#: Interpolation of chroma of half the size.
_BETWEEN = np.array([1, 3, 3, 1]) / 4
#: Shares of coefficients that are not rounded to zero are taken to be between these: few that are say no more.
_SURE = 1e-4, 0.999


@dataclass(frozen=True, slots=True, eq=False)
class Rounding:
    """How the components of a JPEG file are rounded."""

    steps: tuple[_Doubles, ...]  # (8, 8) each: by vertical and horizontal frequency
    sizes: tuple[tuple[int, int], ...]  # pixels down and to the right of the image for one of the component

    @classmethod
    def of(cls, image: Any) -> Rounding | None:
        """Return that of a Pillow image of a JPEG file, or of an array that has `quantization` and `layer` as one."""
        tables, layers = getattr(image, "quantization", None), getattr(image, "layer", ())
        if not tables or len(layers) not in (1, 3):
            return None
        most = [max(layer[axis] for layer in layers) for axis in (2, 1)]
        sizes = tuple((most[0] // layer[2], most[1] // layer[1]) for layer in layers)
        steps = tuple(np.array(tables[layer[3]], np.float64).reshape(_SIDE, _SIDE) for layer in layers)
        return cls(steps, sizes) if {size for pair in sizes for size in pair} <= {1, 2} else None

    def autocovariance(self, values: NDArray[Any], lags: int) -> _Doubles | None:
        """(2 L + 1, 2 L + 1, C, C) autocovariance of what was rounded away of (H, W, C) values; None of other bands."""
        n_bands = values.shape[2]
        if n_bands != len(self.steps) or min(values.shape[:2]) < 2 * _SIDE:
            return None
        mix = _BANDS if n_bands == 3 else np.ones((1, 1))
        found = np.zeros((2 * lags + 1, 2 * lags + 1, n_bands, n_bands))
        components = values.astype(np.float32) @ np.linalg.inv(mix).T.astype(np.float32)
        for number, (steps, size) in enumerate(zip(self.steps, self.sizes, strict=True)):
            variances = _lost(_zeros(components[:, :, number], size, steps), steps)
            down, right = (_reach(one, lags) for one in size)
            near = np.einsum("uv,ud,ve->de", variances, down, right) / _SIDE**2
            found += near[:, :, None, None] * np.outer(mix[:, number], mix[:, number])
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Compressed:
    """An array that was a JPEG file, with its tables as Pillow has them."""

    array: NDArray[Any]
    quantization: dict[int, Sequence[int]]
    layer: Sequence[Sequence[int]]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.array, dtype, copy=copy)


def with_tables(image: NDArray[Any], path: str | PathLike[str]) -> Any:
    """Return an image that was read from a file, with its tables if it is a JPEG file of such bands."""
    from PIL import Image

    try:
        with Image.open(path) as file:
            rounding = Rounding.of(file)
            tables: Any = file
            return Compressed(image, tables.quantization, tables.layer) if rounding else image
    except (OSError, Image.DecompressionBombError):
        return image


def _zeros(component: NDArray[Any], size: tuple[int, int], steps: _Doubles) -> _Doubles:
    """(8, 8) share of the coefficients of the blocks of a component that are rounded to zero."""
    from scipy.fft import dctn

    height, width = (side // (_SIDE * step) for side, step in zip(component.shape, size, strict=True))
    whole = component[: height * _SIDE * size[0], : width * _SIDE * size[1]]
    small = whole.reshape(height * _SIDE, size[0], width * _SIDE, size[1]).mean(axis=(1, 3))
    blocks = small.reshape(height, _SIDE, width, _SIDE)
    coefficients = dctn(blocks, axes=(1, 3), norm="ortho")
    return np.asarray((np.abs(coefficients) < steps[:, None] / 2).mean(axis=(0, 2)))


def _lost(zeros: _Doubles, steps: _Doubles) -> _Doubles:
    """(8, 8) variance of what rounding to steps takes from coefficients, a share of which are rounded to zero."""
    # What is lost is uniform but there, where coefficients are taken to follow a Laplace distribution. Smooth blocks
    # have lost less than that, but their filters remove all in any case.
    from scipy.special import gammainc

    beyond = -np.log(np.clip(1 - zeros, *_SURE))
    inside = 2 * gammainc(3, beyond) / beyond**2 / -np.expm1(-beyond) * (steps / 2) ** 2
    return zeros * inside + (1 - zeros) * steps**2 / 12


def _reach(size: int, lags: int) -> _Doubles:
    """(8, 2 L + 1) products of cosines with themselves so many pixels away, summed, of a component of some size."""
    from scipy.fft import idct

    waves = idct(np.eye(_SIDE), axis=0, norm="ortho").T
    products = [np.correlate(wave, wave, "full") for wave in waves]
    if size == 2:
        between = np.convolve(_BETWEEN, _BETWEEN) / 2
        spread = np.zeros((_SIDE, 2 * len(products[0]) - 1))
        spread[:, ::2] = products
        products = [np.convolve(one, between, "same") for one in spread]
    middle = len(products[0]) // 2
    return np.array([one[middle - lags : middle + lags + 1] for one in products])
