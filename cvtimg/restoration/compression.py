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


class Compressed(np.ndarray[Any, np.dtype[Any]]):
    """An array that was a JPEG file, with its tables as Pillow has them."""

    quantization: dict[int, Sequence[int]]
    layer: Sequence[Sequence[int]]


def with_tables(image: NDArray[Any], path: str | PathLike[str]) -> NDArray[Any]:
    """Return an image that was read from a file, with its tables if it is a JPEG file of such bands."""
    from PIL import Image

    try:
        with Image.open(path) as file:
            tables: Any = file
            if Rounding.of(file) is None:
                return image
            found = image.view(Compressed)
            found.quantization, found.layer = tables.quantization, tables.layer
            return found
    except (OSError, Image.DecompressionBombError):
        return image


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

    def lost(self, values: NDArray[Any], side: int = 256) -> _Doubles | None:
        """(side, side, C) noise like what was rounded away of (H, W, C) values; None of other bands."""
        from scipy.fft import idctn
        from scipy.ndimage import zoom

        if values.shape[2] != len(self.steps) or min(values.shape[:2]) < 2 * _SIDE:
            return None
        mix = _BANDS if len(self.steps) == 3 else np.ones((1, 1))
        components = values.astype(np.float32) @ np.linalg.inv(mix).T.astype(np.float32)
        rng, found = np.random.default_rng(0), []
        for component, steps, size in zip(np.moveaxis(components, 2, 0), self.steps, self.sizes, strict=True):
            n_blocks = side // _SIDE // size[0], side // _SIDE // size[1]
            noise = rng.standard_normal((n_blocks[0], _SIDE, n_blocks[1], _SIDE))
            noise *= np.sqrt(_lost(_zeros(component, size, steps), steps))[:, None]
            small = idctn(noise, axes=(1, 3), norm="ortho").reshape(n_blocks[0] * _SIDE, -1)
            found.append(zoom(small, size, order=1, mode="grid-wrap", grid_mode=True))
        return np.asarray(np.stack(found, axis=2) @ mix.T)


def _zeros(component: NDArray[Any], size: tuple[int, int], steps: _Doubles) -> _Doubles:
    """(8, 8) share of the coefficients of the blocks of a component that are rounded to zero."""
    from scipy.fft import dctn

    height, width = (side // (_SIDE * step) for side, step in zip(component.shape, size, strict=True))
    whole = component[: height * _SIDE * size[0], : width * _SIDE * size[1]]
    blocks = whole.reshape(height, _SIDE, size[0], width, _SIDE, size[1]).mean(axis=(2, 5))
    coefficients = dctn(blocks, axes=(1, 3), norm="ortho")
    return np.asarray((np.abs(coefficients) < steps[:, None] / 2).mean(axis=(0, 2)))


def _lost(zeros: _Doubles, steps: _Doubles) -> _Doubles:
    """(8, 8) variance of what rounding to steps takes from coefficients, a share of which are rounded to zero."""
    # What is lost is uniform but there, where coefficients are taken to follow a Laplace distribution. Smooth blocks
    # have lost less than that, but their filters remove all in any case. Few that are not zero say no more.
    from scipy.special import gammainc

    beyond = -np.log(np.clip(1 - zeros, 1e-4, 0.999))
    inside = 2 * gammainc(3, beyond) / beyond**2 / -np.expm1(-beyond) * (steps / 2) ** 2
    return np.asarray(zeros * inside + (1 - zeros) * steps**2 / 12)
