"""An image, or the part of it inside a mask, as values in a color space: what is segmented.

Values do not depend on the type of the image: white is 255 in every space, as in an 8-bit image, and evenly spaced
samples are converted to their levels first, the smallest whole numbers that distinguish them. White of floating point
that leaves 0..1 is the range that most of it uses. An 8-bit image keeps its levels whatever type holds it: 16-bit
integers 257 times as large, or floating point in 0..1. Results computed from the levels are then identical to the last
bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from cvtimg._shared.checks import check_partial_image, check_that
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import peak, usual_range, white_among
from cvtimg._shared.types import Array, Bools, Floats, Floats32, ImageLike, Ints
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.colors.spaces import SPACES, from_space, to_space
from cvtimg.segmentation.local_means import in_even_light

#: Part of the size of values in which float32 has 256 levels, as 8 bits have; more refuses more images.
_LOST = float(256 * np.finfo(np.float32).eps)
#: White of integers that floating point may stand for, which is 1 if it is from 0 to 1; the last, the most levels.
_WHITES = (1, 255, 65535)


@dataclass(frozen=True, slots=True, eq=False)
class PictureValues:
    """Values of the pixels inside a mask."""

    inside: Bools  # (H, W): the n pixels that count
    #: Distinct colors of these pixels, as of one row (1, n): their levels in "rgb", their values in other spaces
    samples: ColorSamples
    scale: float  # values are scale times the colors of `samples`
    spacing: Spacing  # of the samples whose levels, in "rgb", those colors are
    space: SpaceName  # the color space
    dtype: np.dtype[np.generic]  # type of the image
    unit: float  # the value of 1 in the units of the image or, in another space, of that space

    def field(self) -> Floats32:
        """(H, W, D) values about their `center`; 0 outside the mask."""
        places = (self.samples.colors * self.scale - self.center).astype(np.float32)
        return at_pixels(self.samples.at_pixels(places)[0], self.inside)

    def of_colors(self, colors: Array, center: Floats) -> Floats32:
        """(N, D) values of (N, C) colors of an image without an offset, about their center."""
        scale = self.scale
        if self.space != "rgb":
            colors, scale = to_space(colors.astype(np.float64) / peak(self.dtype), self.space), self.unit
        return (colors * np.float64(scale) - center).astype(np.float32)

    @property
    def center(self) -> Floats:
        """(D,) mean of the values."""
        # Not by BLAS, whose bits depend on the processor.
        sums: Floats = np.einsum("n,nd->d", self.samples.density, self.samples.colors)
        return sums / self.samples.density.sum() * self.scale

    @property
    def variance(self) -> float:
        """Sum of the variances of the values in each dimension."""
        squares = np.square(self.samples.colors * self.scale - self.center)
        return float(np.einsum("n,nd->", self.samples.density, squares) / self.samples.density.sum())

    def in_even_light(self, field: Floats32, n_segments: int) -> Floats32:
        """(H, W, D) values about their mean, where the light on a number of segments is even; 0 outside the mask."""
        black = self.center + (self.spacing.first * self.unit if self.space == "rgb" else 0)
        light = (field + np.maximum(black, -field.min(axis=(0, 1)))).astype(np.float32)
        even = in_even_light(light, self.inside, n_segments, 0)
        even[self.inside] -= even[self.inside].mean(axis=0)
        return even

    def to_picture(self, values: Floats) -> Floats:
        """Convert (K, D) values to (K, C) colors in the units of the image."""
        if self.space == "rgb":
            return self.spacing.within(values / self.unit + self.spacing.first)
        return np.asarray(from_space(values / self.unit, self.space, np.dtype(np.float64)) * peak(self.dtype))


def at_pixels(rows: Array, inside: Bools) -> Array:
    """Put (n, ...) rows at the n pixels `inside`, (H, W), that they belong to: (H, W, ...), 0 elsewhere."""
    if len(rows) == inside.size:
        return rows.reshape(*inside.shape, *rows.shape[1:])
    pixels = np.zeros((*inside.shape, *rows.shape[1:]), rows.dtype)
    pixels[inside] = rows
    return pixels


def pixels_of(image: Array, inside: Bools) -> Array:
    """(n, ...) rows of the n pixels `inside`, (H, W), of an (H, W, ...) image."""
    return image.reshape(-1, *image.shape[2:]) if inside.all() else image[inside]


def from_nearest(pixels: Array, known: Bools) -> Array:
    """Give each pixel, (H, W), that is not known what the nearest known one has."""
    return pixels[tuple(ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True))]


def picture_values(image: ImageLike, space: SpaceName, mask: ArrayLike | None) -> PictureValues:
    """Convert an image to a color space; pixels with NaN or infinity in any band are outside the mask."""
    array, inside = check_partial_image("image", image, mask)
    rows = pixels_of(array, inside)
    _check_together(rows)
    levels, spacing = to_levels(rows)
    return values_of(color_samples(levels[None]), inside, space, array.dtype, spacing)


def _check_together(samples: Array) -> None:
    """Refuse floating point of which a few values are so far from the others that float32 cannot hold these."""
    if samples.dtype.kind != "f":
        return
    low, high, most = float(samples.min()), float(samples.max()), usual_range(samples)
    if not 0 < most < _LOST * (high - low):  # before what takes longer
        return
    middle, mean = float(np.median(samples)), float(samples.mean(dtype=np.float64))
    # Values are held as parts of the range from the least one, and about their mean.
    values = f"image in {low:g}..{high:g}, most of it within {most:.3g},"
    are_held = most >= _LOST * max(middle - low, abs(mean - middle))
    check_that(values, are_held, "not have values so far from the others; a mask or nodata leaves them out")


@dataclass(frozen=True, slots=True)
class Spacing:
    """Samples are ``(offset + step * levels) / white``, and where rounding leads out of their limits, these."""

    offset: float = 0.0
    step: float = 1.0
    white: float = 1.0
    low: float = -np.inf
    high: float = np.inf

    @property
    def first(self) -> float:
        """The sample at level 0."""
        return self.offset / self.white

    def samples(self, levels: Array) -> Floats:
        """Scale levels back to samples."""
        return self.within((self.offset + self.step * levels.astype(np.float64)) / self.white)

    def within(self, samples: Floats) -> Floats:
        """Bring samples that rounding has led out of the limits back to them."""
        return np.clip(samples, self.low, self.high)


def values_of(
    samples: ColorSamples, inside: Bools, space: SpaceName, dtype: np.dtype[np.generic], spacing: Spacing = Spacing()
) -> PictureValues:
    """Return the values of distinct colors, which are levels of samples in the units of the image."""
    if space == "rgb":
        white = white_among(spacing.samples(samples.colors)) if dtype.kind == "f" else peak(dtype)
        scale = spacing.step * 255 / (spacing.white * white)
        return PictureValues(inside, samples, scale, spacing, space, dtype, 255 / white)
    unit = 255 / SPACES[space].white
    places = to_space(spacing.samples(samples.colors) / peak(dtype), space) * unit
    return PictureValues(inside, replace(samples, rows=places), 1.0, spacing, space, dtype, unit)


def to_levels(samples: Array) -> tuple[Array, Spacing]:
    """Find the levels of finite samples: integers or floating point, of any shape, at least one.

    Levels are whole numbers from 0 if samples are evenly spaced, otherwise numbers from 0 to 1.
    """
    low, high = samples.min().item(), samples.max().item()
    limits = float(low), float(high)
    if low == high:
        return np.zeros(samples.shape, np.uint8), Spacing(limits[0], 1.0, 1.0, *limits)
    if samples.dtype.kind in "iu" and high - low < 1 << 63:  # within int64
        steps = samples if low == 0 else (samples.astype(np.int64) if low < 0 else samples) - low
        some = steps[:: len(steps) // 256 + 1]  # from everywhere: a corner may be of one color
        step = 1 if np.gcd.reduce(some, axis=None) == 1 else int(np.gcd.reduce(steps, axis=None))
        if high - low <= _WHITES[-1] * step:
            dtype = np.uint8 if high - low <= 255 * step else np.uint16
            whole = (steps if step == 1 else steps // step).astype(dtype, copy=False)
            return whole, Spacing(limits[0], float(step), 1.0, *limits)
    span = float(high) - float(low)
    shares = (samples.astype(np.float64) - low) / span
    for white in _WHITES if samples.dtype.kind == "f" else ():
        n_steps = span * white  # floating point that integers up to this white became when 1 was made of it
        levels = np.rint(shares * n_steps)
        rounding = 4 * float(np.finfo(samples.dtype).eps) * max(abs(low), abs(high)) * white
        if levels.max() <= _WHITES[-1] and np.abs(levels - shares * n_steps).max() <= rounding < 0.05:
            whole, spacing = to_levels(levels.astype(np.uint16))
            offset = limits[0] * white
            if abs(offset - round(offset)) <= rounding:  # these integers themselves
                offset = float(round(offset))
                limits = offset / white, (offset + levels.max().item()) / white
            return whole, Spacing(offset, spacing.step, float(white), *limits)
    return shares.astype(np.float32), Spacing(limits[0], span, 1.0, *limits)


def in_whole_numbers(image: Array, inside: Bools) -> Array:
    """Return an (H, W, C) image as the integers of 8 or 16 bits that floating point in 0..1 was made of, if it was."""
    if image.dtype.kind != "f":
        return image
    levels, spacing = to_levels(image[inside])
    numbers = spacing.offset + spacing.step * levels
    if spacing.white == 1 or spacing.offset % 1 or numbers.min() < 0 or numbers.max() > spacing.white:
        return image
    whole = np.zeros(image.shape, np.uint8 if spacing.white == 255 else np.uint16)
    whole[inside] = numbers
    return whole


def dark_to_bright(generators: Floats, masses: Floats) -> Ints:
    """(K,) new labels from 1 by the sum of the bands; 0 for segments without pixels."""
    order = np.lexsort((*generators.T[::-1], generators.sum(axis=1)))
    order = order[masses[order] > 0]
    labels = np.zeros(len(generators), np.int32)
    labels[order] = np.arange(1, len(order) + 1)
    return labels
