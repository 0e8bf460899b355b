"""Versions of one picture, stacked: values, pixels that each knows, weights, and what JPEG has rounded away of them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image
from PIL.JpegImagePlugin import samplings
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from cvtimg._shared.checks import check_image, check_in_range, check_shape, check_that, check_weights
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import array_of, peak, usual_range, white_of
from cvtimg._shared.types import Array, Bools, Floats, Floats32, ImageLike, Indices, Ints
from cvtimg.colors.places import has_alpha
from cvtimg.colors.spaces import to_space

#: Pixels along the side of the blocks of JPEG, and of what is compressed again at most: time grows with it.
_SIDE, _LARGEST = 8, 512
#: What is rounded for the second time loses less: this factor of its variance was lost the first time.
_FIRST_TIME = 1.3
#: Largest floating point, and one by the least: powers of more are beyond what float32 holds.
_OF_FLOATS = 1e17


@dataclass(frozen=True, slots=True, eq=False)
class Rounding:
    """How a JPEG file is rounded."""

    # What was rounded away is noise that a file of the same tables makes again, once its blocks lie elsewhere. Quiet
    # blocks, where noise is measured, do not show it, because their coefficients are rounded to zero.

    tables: list[list[int]]  # of luma, and of chroma if there is any
    subsampling: int  # as Pillow has it

    @classmethod
    def of(cls, image: ImageLike) -> Rounding | None:
        """Return that of a Pillow image of a JPEG file, which has `quantization` and `layer`; None of others."""
        tables = getattr(image, "quantization", None)
        layers: Sequence[Sequence[int]] = getattr(image, "layer", ())
        sides: Any = tuple(side for layer in layers for side in layer[1:3])
        if not tables or (len(layers) != 1 and sides not in samplings):
            return None
        return cls([tables[layer[3]] for layer in layers[:2]], samplings.get(sides, -1))

    def lost(self, values: Array) -> Floats | None:
        """(H, W, C) noise like what was rounded away of values, of no more than the middle of them; None of others."""
        n_bands = values.shape[2]  # one, of gray, has the table of luma
        fits = n_bands == 1 or (n_bands == 3 and len(self.tables) == 2)
        if values.dtype != np.uint8 or not fits or min(values.shape[:2]) < 2 * _SIDE:
            return None
        # Its blocks begin in the middle of those of the file.
        firsts = [max(side - _LARGEST, _SIDE) // (2 * _SIDE) * _SIDE + _SIDE // 2 for side in values.shape[:2]]
        part = values[tuple(slice(first, first + _LARGEST) for first in firsts)]
        file = BytesIO()
        Image.fromarray(part.squeeze()).save(file, "JPEG", qtables=self.tables[:n_bands], subsampling=self.subsampling)
        with Image.open(file) as again:
            return np.asarray(np.sqrt(_FIRST_TIME) * (np.asarray(again, np.float64).reshape(part.shape) - part))


@dataclass(frozen=True, slots=True, eq=False)
class Clipped:
    """What clipping at the ends of an integer type does to noisy values; arrays of the shape of the true ones."""

    added: Floats32  # what it adds to their mean
    slope: Floats32  # how much the mean of clipped values follows the true one: 1 far from the ends, 1/2 at an end
    variance: Floats32  # variance that is left, as a share of that of the noise

    @classmethod
    def of(cls, true: Floats32, sigma: Floats32, white: float, ends: tuple[bool, ...] = (True, True)) -> Clipped:
        """Clip values to 0..white, or at one of these ends, with Gaussian noise of standard deviations `sigma` > 0."""
        inside = np.clip(true, 0, white)
        added, slope, variance = np.zeros_like(inside), np.ones_like(inside), np.ones_like(inside)
        for is_clipped, sign, apart in zip(ends, (1, -1), (inside, white - inside), strict=True):
            if is_clipped:
                away = apart / sigma
                beyond, density = ndtr(-away), np.exp(-(away**2) / 2) / np.float32(np.sqrt(2 * np.pi))
                more = density - away * beyond
                added += sign * sigma * more
                slope -= beyond
                variance += (away**2 + 1) * (1 - beyond) + away * density - (away + more) ** 2 - 1
        return cls(added, slope, np.maximum(variance, np.float32(1e-6)))


@dataclass(frozen=True, slots=True, eq=False)
class Versions:
    """Versions of one picture, stacked."""

    #: (H, W, C) each: values in the working color space, in the smallest type at hand, for many versions take much
    #: memory; of any value where unknown
    stack: tuple[Array, ...]
    known: Bools  # (H, W, S): which pixels each version knows
    dtypes: tuple[np.dtype[Any], ...]  # types of the versions
    grey: bool  # whether the first version came without an axis of channels
    white: float | None = None  # where values end, at which noise may have been clipped; None if they have no ends
    roundings: tuple[Rounding | None, ...] = ()  # of versions that were JPEG files; none if empty
    tones: Floats | None = None  # (S, C, 2): gain and offset to the exposure of the first
    lines: Floats | None = None  # (C, 2): constant and slope of how noise follows the level; None if even
    alpha: Array | None = None  # (H, W): that all versions have; None if there is none, or it differs
    whitening: Floats | None = None  # (C, C): gives bands noise that they do not share; None if they share none

    @property
    def n_versions(self) -> int:
        """Number of versions, S."""
        return int(self.known.shape[2])

    @property
    def coverage(self) -> Ints:
        """(H, W) number of versions that know each pixel."""
        return sum(np.moveaxis(self.known, 2, 0), np.zeros(self.known.shape[:2], np.int32))

    def bands(self, version: int, rows: Any = slice(None)) -> Floats32:
        """(H, W, C) values of one version, or some rows of it; 0 where unknown."""
        values, known = self.stack[version][rows].astype(np.float32), self.known[rows, :, version]
        if self.tones is not None:
            gains, offsets = self.tones[version].T.astype(np.float32)
            values = values * gains + offsets
        np.copyto(values, 0, where=~known[:, :, None])
        return values

    def distinct(self) -> tuple[Versions, Indices]:
        """Versions of the bands that differ from each other and show anything; and (C,) which of them each band is."""
        # It is -1 of bands that have one value in each version. If all have, they are returned as they are, and so are
        # versions of different bands, as channels may be.
        n_bands = self.stack[0].shape[2]
        if any(values.shape[2] != n_bands for values in self.stack):
            return self, np.arange(n_bands)
        numbers, places = dict[bytes, int](), np.full(n_bands, -1)
        for band in range(n_bands):
            inside = [values[:, :, band][self.known[:, :, s]] for s, values in enumerate(self.stack)]
            if any(np.ptp(values) > 0 for values in inside if len(values)):
                told = b"".join(values[:, :, band].tobytes() for values in self.stack)  # 0 where unknown
                places[band] = numbers.setdefault(told, len(numbers))
        if len(numbers) in (0, n_bands):
            return self, np.arange(n_bands)
        chosen = [places.tolist().index(number) for number in range(len(numbers))]
        stack, tones = tuple(values[:, :, chosen] for values in self.stack), self.tones
        tones, lines = (None if array is None else array[..., chosen, :] for array in (tones, self.lines))
        return replace(self, stack=stack, tones=tones, lines=lines), places

    def with_all(self, image: Floats32, places: Indices) -> Floats32:
        """(H, W, C) image of all bands from one of those that are `distinct`; others have the value that they have."""
        first = next(s for s in range(self.n_versions) if self.known[:, :, s].any())
        of_one_value = self.stack[first][self.known[:, :, first]][0]
        return np.where(places >= 0, image[:, :, places], of_one_value).astype(np.float32)

    def cut_off(self, version: int) -> Bools:
        """(H, W, C) values of a version at an end of its levels, where clipping may have taken noise away."""
        values, white = self.stack[version], self.white
        seen = values[self.known[:, :, version]] if white is None else np.array([0, white])
        low, high = seen.min(initial=np.inf), seen.max(initial=-np.inf)
        return np.asarray((values <= low) | (values >= high))

    def noisiness(self, levels: Floats32) -> Floats32:
        """(H, W) variance of noise at levels, (H, W, C), as a multiple of the usual one."""
        if self.lines is None:
            return np.ones(levels.shape[:2], np.float32)
        constant, slope = self.lines.T.astype(np.float32)
        return np.maximum((constant + slope * levels).mean(axis=2), np.float32(0.1))

    def even(self, apart: Floats32, is_cut_off: Bools) -> Floats32:
        """(H, W, C) departures in bands that share no noise; where values are cut off, as noise at most."""
        if self.whitening is None:
            return apart
        least = np.float32(np.linalg.svd(self.whitening)[1].min())
        return np.where(is_cut_off[:, :, None], least * apart, apart @ self.whitening.astype(np.float32))

    @property
    def rounding(self) -> float:
        """Standard deviation that no noise is taken to be below: a level of 8 bits, of the range that is used."""
        # Hot pixels, and numbers that stand for no data, are not in that range.
        span = max(float(values.max()) for values in self.stack) - min(float(values.min()) for values in self.stack)
        return (min(span, 2 * usual_range(*self.stack) or span) or 1.0) / 256

    def level(self, space: SpaceName) -> float:
        """Return an 8-bit level in the units of the first version's color space, which `space` names."""
        white = np.array([[white_of(self.dtypes[0])]], self.dtypes[0])
        return float(to_space(white, space)[0, 0]) / 255

    @property
    def unseen(self) -> float:
        """Standard deviation up to which noise is none: twice that of rounding to the integers of the first version."""
        return 2 / np.sqrt(12) if self.white is not None else 2 / np.sqrt(12) * self.rounding / 256


def stack_versions(
    images: Sequence[Any],
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    space: SpaceName = "rgb",
    *,
    channels: bool = False,
    alpha: bool | None = None,
    any_size: bool = False,
) -> Versions:
    """Stack versions and find which pixels each knows; the arguments are those of `restore`."""
    # Versions of `any_size` get that of the first, from their upper left corners: what is moved later has room.
    if hasattr(images, "mode") or (isinstance(images, np.ndarray) and images.ndim < 4):
        size = array_of(images).shape
        raise TypeError(f"images of shape {size} must be a list of versions: [image] for one, list(images) for a stack")
    check_that("images", len(images) > 0, "have at least one version")
    masks = [None] * len(images) if masks is None else masks
    if len(masks) != len(images):
        raise ValueError(f"masks has {len(masks)} masks and must have {len(images)}, one for each version, or None")
    read = [_read(number, images[number], mask, nodata, alpha) for number, mask in enumerate(masks)]
    if not any_size:
        _check_same("size", [known.shape for _, known in read])
    if not channels:
        _check_same("bands", [values.shape[2] for values, _ in read])
        _check_same("type", [str(values.dtype) for values, _ in read])
    fitted = [_fitted(values, seen, read[0][1].shape) for values, seen in read]
    known = np.stack([seen for _, seen in fitted], axis=2)
    check_that("images", bool(known.any()), "have at least one known pixel; no version knows any pixel")
    placed = [_place(values, seen, space) for values, seen in fitted]
    dtypes = tuple(values.dtype for values, _ in read)
    grey = array_of(images[0]).ndim == 2
    white = peak(dtypes[0]) if space == "rgb" and dtypes[0].kind in "iu" else None
    roundings = tuple(map(Rounding.of, images)) if space == "rgb" else ()
    opacity = None
    if alpha is not False and all(has_alpha(np.atleast_3d(array_of(image)).shape[2]) for image in images):
        opacity, *others = (np.asarray(array_of(image))[:, :, -1] for image in images)
        opacity = opacity if all(np.array_equal(opacity, other) for other in others) else None
    return Versions(tuple(placed), known, dtypes, grey, white, roundings, alpha=opacity)


def _check_same(what: str, found: Sequence[object]) -> None:
    for number, other in enumerate(found):
        if other != found[0]:
            raise ValueError(f"images[{number}] has {what} {other} and images[0] has {found[0]}; they must be the same")


def _fitted(values: Array, known: Bools, size: tuple[int, ...]) -> tuple[Array, Bools]:
    """Cut or add rows and columns at the lower right so that (H, W, C) values have a size; what is added is unknown."""
    if known.shape == size:
        return values, known
    values, known = values[: size[0], : size[1]], known[: size[0], : size[1]]
    more = [(0, wanted - has) for wanted, has in zip(size, known.shape, strict=True)]
    return np.pad(values, [*more, (0, 0)]), np.pad(known, more)


def _read(
    number: int, image: ImageLike, mask: ArrayLike | None, nodata: float | None, alpha: bool | None
) -> tuple[Array, Bools]:
    """(H, W, C) values of a version, and where they are known by its masks, NaN, alpha and nodata."""
    array = array_of(image)
    missing = np.isnan(array) if array.dtype.kind == "f" else np.zeros(array.shape, np.bool_)
    if isinstance(image, np.ma.MaskedArray):
        missing |= np.ma.getmaskarray(image)
    values = check_image(f"images[{number}]", np.where(missing, array.dtype.type(0), array) if missing.any() else array)
    values = values.reshape(*values.shape[:2], -1)
    known = np.logical_not(missing.reshape(values.shape).any(axis=2))
    if alpha is not False and has_alpha(values.shape[2]):
        known &= values[:, :, -1] > 0
        values = values[:, :, :-1]
    if nodata is not None:
        known &= (values != nodata).any(axis=2)
    if mask is not None:
        inside = np.asarray(mask) != 0
        check_shape(f"masks[{number}]", inside.shape, inside.shape == known.shape, f"{known.shape}, as the version")
        known &= inside
    if values.dtype.kind == "f" and known.any():
        size = float(np.abs(values[known]).max())
        within = size == 0 or 1 / _OF_FLOATS < size < _OF_FLOATS
        what = f"images[{number}] of values up to {size:g}"
        check_that(what, within, f"have a size of {1 / _OF_FLOATS:g} to {_OF_FLOATS:g}")
    return values, known


def _place(values: Array, known: Bools, space: SpaceName) -> Array:
    """(H, W, C) places of the values in the color space; 0 where unknown."""
    if space == "rgb":
        places = values if values.dtype.itemsize <= 2 else values.astype(np.float32)
    else:
        rows = values.reshape(-1, values.shape[2])
        if rows.dtype.kind == "f":
            rows = np.clip(rows, 0, 1)  # noise leaves the gamut, which these spaces need
        places = to_space(rows, space).reshape(values.shape).astype(np.float32)
    return places if known.all() else np.where(known[:, :, None], places, places.dtype.type(0))


def usual_noise(versions: Versions, noise: Floats) -> Floats:
    """Replace unknown noise by that of the others, and noise below that of rounding by this."""
    usual = np.nanmedian(noise) if np.isfinite(noise).any() else versions.rounding
    return np.maximum(np.where(np.isnan(noise), usual, noise), versions.rounding)


def trust_in(versions: Versions, weights: ArrayLike | None, noise: Floats) -> Floats:
    """(S,) weight of each version, with mean 1: the given one, or the inverse variance of its noise."""
    trust = 1 / usual_noise(versions, noise) ** 2
    if weights is not None:
        trust = check_weights("weights", weights, trust.shape, "version")
        check_in_range("weights", trust.tolist(), trust.min() > 0, "finite and > 0")
    return trust / trust.mean()


def fuse(
    versions: Versions, trust: Floats, sigma: float = 0.0, some: Sequence[int] | None = None
) -> tuple[Floats32, Floats32]:
    """Weighted mean of the known values of each pixel, (H, W, C), and the (H, W) weight behind it."""
    # With a blur by sigma pixels, known values nearby count too. Unknown pixels are filled from nearby in any case. Of
    # versions that are channels, `some` have the same bands.
    some = range(versions.n_versions) if some is None else some
    weight = np.zeros(versions.known.shape[:2], np.float32)
    total = np.zeros(versions.stack[some[0]].shape, np.float32)
    for version in some:
        weight += np.float32(trust[version]) * versions.known[:, :, version]
        total += np.float32(trust[version]) * versions.bands(version)
    total, near = (gaussian_filter(sums, sigma, axes=(0, 1)) if sigma else sums for sums in (total, weight))
    return fill(total, near), weight


def fill(total: Floats32, weight: Floats32) -> Floats32:
    """Divide weighted sums, (H, W, C), by their weights, (H, W), and fill pixels without weight from nearby."""
    # This is normalized convolution.
    # H. Knutsson and C.-F. Westin, CVPR 1993, doi 10.1109/CVPR.1993.341081.
    filled = np.divide(total, weight[:, :, None], out=np.zeros_like(total), where=weight[:, :, None] > 0)
    missing = weight <= 0
    sigma = 1.0
    while missing.any() and not missing.all():
        near = gaussian_filter(weight, sigma, axes=(0, 1))
        reached = missing & (near > 1e-6 * weight.max())
        filled[reached] = gaussian_filter(total, sigma, axes=(0, 1))[reached] / near[reached, None]
        missing &= ~reached
        sigma *= 2
    return filled


def with_tables(image: Array, path: str | PathLike[str]) -> Any:
    """Return an image as read from a file; of a JPEG file, as a Pillow image that has its tables."""
    with suppress(OSError, Image.DecompressionBombError), Image.open(path) as file:
        tables: Any = file
        if Rounding.of(tables):
            picture: Any = Image.fromarray(image)
            picture.quantization, picture.layer = tables.quantization, tables.layer
            return picture
    return image
