"""An image, or the part of it inside a mask, as values in a color space: what is segmented.

Values do not depend on the type of the image: white is 255 in every space, as in an 8-bit image, and evenly spaced
samples are converted to their levels first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_partial_image
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import peak
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.colors.spaces import SPACES, from_space, to_space
from cvtimg.segmentation.levels import to_levels


@dataclass(frozen=True, slots=True, eq=False)
class PictureValues:
    """Values of the pixels inside a mask.

    Attributes
    ----------
    inside : (H, W) bool array
        The n pixels that count.
    samples : ColorSamples
        Distinct colors of these pixels, as of one row (1, n): their levels in "rgb", their values in other spaces.
    scale, offset : float
        Values are scale times the colors of `samples`. In "rgb", the offset is the sample at level 0.
    space : str
        The color space.
    dtype : numpy.dtype
        Type of the image.
    """

    inside: NDArray[np.bool_]
    samples: ColorSamples
    scale: float
    offset: float
    space: SpaceName
    dtype: np.dtype[Any]

    @property
    def unit(self) -> float:
        """The value of 1 in the units of the image or, in another space, of that space."""
        return unit_of(self.space, self.dtype)

    def field(self) -> NDArray[np.float32]:
        """(H, W, D) values about their `center`; 0 outside the mask."""
        places = (self.samples.colors * self.scale - self.center).astype(np.float32)
        return self.to_pixels(places[self.samples.inverse[0]])

    @property
    def center(self) -> NDArray[np.float64]:
        """(D,) mean of the values."""
        mean: NDArray[np.float64] = self.samples.density @ self.samples.colors / self.samples.density.sum()
        return mean * self.scale

    def to_pixels(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Put (n, ...) rows at the pixels that they belong to: (H, W, ...), 0 outside the mask."""
        shape = (*self.inside.shape, *rows.shape[1:])
        if len(rows) == self.inside.size:
            return rows.reshape(shape)
        pixels = np.zeros(shape, rows.dtype)
        pixels[self.inside] = rows
        return pixels

    def to_picture(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert (K, D) values to (K, C) colors in the units of the image."""
        if self.space == "rgb":
            return values / self.unit + self.offset
        colors: NDArray[np.float64] = from_space(values / self.unit, self.space, np.dtype(np.float64))
        return colors * peak(self.dtype)


def unit_of(space: SpaceName, dtype: np.dtype[Any]) -> float:
    """Return the value of 1 in the units of images of this type or, in another space, of that space."""
    return 255 / (peak(dtype) if space == "rgb" else SPACES[space].white)


def picture_values(image: Any, space: SpaceName, mask: ArrayLike | None) -> PictureValues:
    """Convert an image to a color space; pixels with NaN or infinity in any band are outside the mask."""
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
