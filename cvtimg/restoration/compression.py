"""What JPEG has rounded away: noise that a file of the same tables makes again, once its blocks lie elsewhere.

Quiet blocks, where noise is measured, do not show it, because their coefficients are rounded to zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

#: Subsampling as Pillow has it, by the pixels to the right and down of the image for one of chroma.
_SUBSAMPLINGS = {(1, 1): 0, (2, 1): 1, (2, 2): 2}
#: Side of the blocks of JPEG, and the largest of what is compressed again.
_SIDE, _LARGEST = 8, 512
#: What is rounded for the second time loses less: so many times its variance was lost the first time.
_FIRST_TIME = 1.3


def with_tables(image: NDArray[Any], path: str | PathLike[str]) -> Any:
    """Return an image as read from a file; of a JPEG file of such bands, as a Pillow image that has its tables."""
    try:
        with Image.open(path) as file:
            tables: Any = file
            if Rounding.of(file) is None:
                return image
            found: Any = Image.fromarray(image)
            found.quantization, found.layer = tables.quantization, tables.layer
            return found
    except (OSError, Image.DecompressionBombError):
        return image


@dataclass(frozen=True, slots=True, eq=False)
class Rounding:
    """How a JPEG file is rounded."""

    tables: list[list[int]]  # of luma, and of chroma if there is any
    subsampling: int

    @classmethod
    def of(cls, image: Any) -> Rounding | None:
        """Return that of a Pillow image of a JPEG file, which has `quantization` and `layer`; None of others."""
        tables = getattr(image, "quantization", None)
        layers: Sequence[Sequence[int]] = getattr(image, "layer", ())
        if not tables or len(layers) not in (1, 3):
            return None
        subsampling = _SUBSAMPLINGS.get((layers[0][1] // layers[-1][1], layers[0][2] // layers[-1][2]))
        return None if subsampling is None else cls([tables[layer[3]] for layer in layers[:2]], subsampling)

    def lost(self, values: NDArray[Any]) -> NDArray[np.float64] | None:
        """(H, W, C) noise like what was rounded away of values, of no more than the middle of them; None of others."""
        n_bands = 1 if len(self.tables) == 1 else 3
        if values.dtype != np.uint8 or values.shape[2] != n_bands or min(values.shape[:2]) < 2 * _SIDE:
            return None
        # Its blocks begin in the middle of those of the file.
        firsts = [max(side - _LARGEST, _SIDE) // (2 * _SIDE) * _SIDE + _SIDE // 2 for side in values.shape[:2]]
        part = values[tuple(slice(first, first + _LARGEST) for first in firsts)]
        file = BytesIO()
        about: dict[str, Any] = {} if n_bands == 1 else {"subsampling": self.subsampling}
        Image.fromarray(part.squeeze()).save(file, "JPEG", qtables=self.tables, **about)
        with Image.open(file) as again:
            return np.asarray(np.sqrt(_FIRST_TIME) * (np.asarray(again, np.float64).reshape(part.shape) - part))
