"""A picture, or the part of it inside a mask, as values in a color space: what is segmented.

Values do not depend on the type of the picture: white is 255 in every space, as in a picture of 8 bits, and evenly
spaced samples are brought to their levels first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_partial_image
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.colors.spaces import SPACES, from_space, peak, to_space
from cvtimg.segmentation.levels import to_levels


@dataclass(frozen=True, slots=True, eq=False)
class PictureValues:
    """Values of the pixels inside a mask.

    Attributes
    ----------
    inside : (H, W) bool array
        Pixels that count, n of them.
    samples : ColorSamples
        Of these pixels, in a row (1, n): the levels of distinct colors in "rgb", their values in other spaces.
    scale, offset : float
        Values are scale times the colors of `samples`. In "rgb" the offset is what level 0 is in the picture.
    space : str
        The color space.
    dtype : numpy.dtype
        Of the picture.
    """

    inside: NDArray[np.bool_]
    samples: ColorSamples
    scale: float
    offset: float
    space: str
    dtype: np.dtype[Any]

    @property
    def unit(self) -> float:
        """What 1 in the units of the picture, or of the other space, is in values."""
        return unit_of(self.space, self.dtype)

    def field(self) -> NDArray[np.float32]:
        """(H, W, D) values less their `center`; 0 outside."""
        places = (self.samples.colors * self.scale - self.center).astype(np.float32)
        return self.spread(places[self.samples.inverse[0]])

    @property
    def center(self) -> NDArray[np.float64]:
        """(D,) mean value."""
        mean: NDArray[np.float64] = self.samples.density @ self.samples.colors / self.samples.density.sum()
        return mean * self.scale

    def spread(self, rows: NDArray[Any]) -> NDArray[Any]:
        """(H, W, ...) what (n, ...) rows have for each pixel; 0 outside."""
        shape = (*self.inside.shape, *rows.shape[1:])
        if len(rows) == self.inside.size:
            return rows.reshape(shape)
        picture = np.zeros(shape, rows.dtype)
        picture[self.inside] = rows
        return picture

    def to_picture(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(K, C) colors in the units of the picture, of (K, D) values."""
        if self.space == "rgb":
            return values / self.unit + self.offset
        colors: NDArray[np.float64] = from_space(values / self.unit, self.space, np.dtype(np.float64))
        return colors * peak(self.dtype)


def unit_of(space: str, dtype: np.dtype[Any]) -> float:
    """Return what 1 in the units of pictures of this type, or of the other space, is in values."""
    return 255 / (peak(dtype) if space == "rgb" else SPACES[space].white)


def picture_values(image: Any, space: str, mask: ArrayLike | None) -> PictureValues:
    """Bring a picture to a color space; pixels with NaN or infinity in any band are outside, as those of the mask."""
    array, inside = check_partial_image("image", image, mask)
    rows = array.reshape(inside.size, -1) if inside.all() else array[inside]
    found = to_levels(rows)
    samples = color_samples(found.levels[None])
    scale = found.step * 255 / peak(array.dtype)
    if space != "rgb":
        colors = np.clip(found.offset + found.step * samples.colors.astype(np.float64), rows.min(), rows.max())
        places = to_space(colors / peak(array.dtype), space) * unit_of(space, array.dtype)
        samples, scale = replace(samples, rows=places), 1.0
    return PictureValues(inside, samples, scale, found.offset, space, array.dtype)
