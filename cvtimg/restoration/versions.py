"""Versions of one picture, side by side: their values, what each knows, and how far each is to be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_image, check_masks, check_same, check_version_weights
from cvtimg.colors.places import has_alpha
from cvtimg.colors.spaces import to_space
from cvtimg.segmentation.averaging import Averaging, averaged

Floats = NDArray[np.float32]

#: Finer than this, as a share of the range, noise is that of rounding to 8 bits: no version counts for more.
_FINEST_NOISE = 1 / 256
#: So many differences of four pixels tell how large the noise is.
_ENOUGH_QUADS = 64


@dataclass(frozen=True, slots=True, eq=False)
class Versions:
    """Versions of one picture, stacked.

    Attributes
    ----------
    values : (H, W, D) float32 array
        All bands of all versions in the working color space, 0 where nothing is known.
    known : (H, W, S) bool array
        What each version knows.
    version_of : (D,) intp array
        The version to which each band belongs; its bands follow each other.
    dtypes : tuple of numpy.dtype
        Types of the versions.
    grey : bool
        Whether the first version came without an axis of channels.
    """

    values: Floats
    known: NDArray[np.bool_]
    version_of: NDArray[np.intp]
    dtypes: tuple[np.dtype[Any], ...]
    grey: bool

    @property
    def n_versions(self) -> int:
        """Number of versions, S."""
        return int(self.known.shape[2])

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the first version."""
        return self.dtypes[0]

    @property
    def coverage(self) -> NDArray[np.int32]:
        """(H, W) how many versions know each pixel."""
        counts: NDArray[np.int32] = self.known.sum(axis=2, dtype=np.int32)
        return counts

    def bands(self, version: int) -> Floats:
        """(H, W, C) values of one version."""
        return self.values[:, :, self.version_of == version]

    def weights(self, trust: NDArray[np.float64]) -> Floats:
        """(H, W, D) weight of each value: `trust`, (S,), where it is known, else 0."""
        return (self.known * trust.astype(np.float32))[:, :, self.version_of].astype(np.float32, copy=False)

    def only(self, version: int) -> Versions:
        """One version by itself."""
        bands = self.version_of == version
        return Versions(
            self.values[:, :, bands],
            self.known[:, :, [version]],
            np.zeros(np.count_nonzero(bands), np.intp),
            (self.dtypes[version],),
            self.grey,
        )

    def moved(self, values: Floats, known: NDArray[np.bool_]) -> Versions:
        """Other values at other places, of the same kind."""
        return replace(self, values=values, known=known)


def stack_versions(
    images: Sequence[Any],
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    space: str = "rgb",
    *,
    channels: bool = False,
) -> Versions:
    """Stack versions, finding out what each knows; the arguments are those of `restore`."""
    if not len(images):
        raise ValueError("images must have at least one version")
    read = [_read(number, image, nodata) for number, image in enumerate(images)]
    check_same("size", [known.shape for _, known in read])
    if not channels:
        check_same("bands", [values.shape[2] for values, _ in read])
        check_same("type", [str(values.dtype) for values, _ in read])
    given = check_masks(masks, len(read), read[0][1].shape)
    known = np.stack([seen & mask for (_, seen), mask in zip(read, given, strict=True)], axis=2)
    if not known.any():
        raise ValueError("no version knows any pixel: there is nothing to restore from")
    placed = [_place(values, known[:, :, version], space) for version, (values, _) in enumerate(read)]
    version_of = np.repeat(np.arange(len(placed)), [values.shape[2] for values in placed])
    dtypes = tuple(values.dtype for values, _ in read)
    grey = np.ndim(images[0]) == 2
    return Versions(np.concatenate(placed, axis=2), known, version_of, dtypes, grey)


def _read(number: int, image: Any, nodata: float | None) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """(H, W, C) values of a version, and where its own NaN, alpha and nodata leave them known."""
    array = np.asarray(image)
    known: NDArray[np.bool_] = np.ones(array.shape[:2], np.bool_)
    if array.dtype.kind == "f" and array.ndim in (2, 3):
        known &= ~np.isnan(array.reshape(*known.shape, -1)).any(axis=2)
        array = np.where(np.isnan(array), array.dtype.type(0), array)
    checked = check_image(f"images[{number}]", array)
    values = checked.reshape(*known.shape, -1)
    if has_alpha(values.shape[2]):
        known &= values[:, :, -1] > 0
        values = values[:, :, :-1]
    if nodata is not None:
        known &= (values != nodata).any(axis=2)
    return values, known


def _place(values: NDArray[Any], known: NDArray[np.bool_], space: str) -> Floats:
    """(H, W, C) places of the values in the color space, 0 where they are not known."""
    rows = np.where(known[:, :, None], values, 0).reshape(-1, values.shape[2])
    if rows.dtype.kind == "f" and space != "rgb":
        rows = np.clip(rows, 0, 1)  # noise leaves the gamut, on which the other spaces stand
    places = to_space(rows, space).reshape(values.shape)
    return np.where(known[:, :, None], places, 0).astype(np.float32)


def averaged_versions(versions: Versions, averaging: Averaging) -> Versions:
    """Average what each version knows, where it knows it."""
    values = np.empty_like(versions.values)
    for version in range(versions.n_versions):
        own = versions.version_of == version
        values[:, :, own] = averaged(versions.bands(version), averaging, versions.known[:, :, version])
    return versions.moved(values, versions.known)


def noise_of(versions: Versions) -> NDArray[np.float64]:
    """(S,) standard deviation of the noise of each version, a mean over its bands; NaN where it knows too little.

    The median of the differences across the diagonals of four known pixels, as in D. Donoho and I. Johnstone,
    Biometrika 81 (1994), doi 10.1093/biomet/81.3.425: a picture's edges leave most of them to the noise.
    """
    noise = np.full(versions.n_versions, np.nan)
    for version in range(versions.n_versions):
        known, values = versions.known[:, :, version], versions.bands(version)
        quads = known[1:, 1:] & known[1:, :-1] & known[:-1, 1:] & known[:-1, :-1]
        if np.count_nonzero(quads) < _ENOUGH_QUADS:
            continue
        twists = (values[1:, 1:] - values[1:, :-1] - values[:-1, 1:] + values[:-1, :-1])[quads]
        sigmas = np.median(np.abs(twists), axis=0) / (2 * 0.6745)
        noise[version] = np.sqrt(np.mean(np.square(sigmas, dtype=np.float64)))
    return noise


def disagreement(versions: Versions, trust: NDArray[np.float64]) -> float:
    """Variance, at weight 1, of versions about their mean, where more than one knows a pixel; NaN where none does.

    Unlike the noise, whose estimate leaves out what is rare, it has in it what is painted over in some version.
    """
    n_bands = np.count_nonzero(versions.version_of == 0)
    mean, _ = fuse(versions, trust)
    apart = np.zeros(versions.known.shape[:2])
    for version in range(versions.n_versions):
        squares = np.square(versions.bands(version) - mean).sum(axis=2)
        apart += trust[version] * np.where(versions.known[:, :, version], squares, 0)
    freedom = np.maximum(versions.coverage - 1, 0).sum() * n_bands
    return float(apart[versions.coverage > 1].sum() / freedom) if freedom else np.nan


def trust_in(versions: Versions, weights: ArrayLike | None, noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """(S,) weight of each version, with mean 1: those given, or the inverse variance of its noise."""
    if weights is not None:
        trust = check_version_weights(weights, versions.n_versions)
    else:
        finest = _FINEST_NOISE * (float(np.ptp(versions.values)) or 1.0)
        # A version that knows too little to tell is taken for as noisy as the others.
        usual = np.nanmedian(noise) if np.isfinite(noise).any() else finest
        trust = 1 / np.maximum(np.where(np.isnan(noise), usual, noise), finest) ** 2
    shares: NDArray[np.float64] = trust / trust.mean()
    return shares


def fuse(versions: Versions, trust: NDArray[np.float64], blur: float = 0.0) -> tuple[Floats, Floats]:
    """Weighted mean of what is known of each pixel, (H, W, C), and the (H, W) weight behind it.

    With a blur, in pixels, what is known nearby counts too. What no version knows is filled from nearby in any case.
    """
    from scipy.ndimage import gaussian_filter

    n_bands = np.count_nonzero(versions.version_of == 0)
    weight: Floats = (versions.known * trust.astype(np.float32)).sum(axis=2)
    total = np.zeros((*weight.shape, n_bands), np.float32)
    for version in range(versions.n_versions):
        total += np.float32(trust[version]) * versions.bands(version)
    if blur:
        return fill(gaussian_filter(total, (blur, blur, 0)), gaussian_filter(weight, blur)), weight
    return fill(total, weight), weight


def fill(total: Floats, weight: Floats) -> Floats:
    """Divide weighted sums, (H, W, C), by their weights, (H, W), and fill where there is none (normalized convolution).

    H. Knutsson and C.-F. Westin, CVPR 1993, doi 10.1109/CVPR.1993.341081.
    """
    from scipy.ndimage import gaussian_filter

    filled = np.divide(total, weight[:, :, None], out=np.zeros_like(total), where=weight[:, :, None] > 0)
    missing = weight <= 0
    sigma = 1.0
    while missing.any():
        near = gaussian_filter(weight, sigma)
        reached = missing & (near > 1e-6 * weight.max())
        spread = gaussian_filter(total, (sigma, sigma, 0))
        filled[reached] = spread[reached] / near[reached, None]
        missing &= ~reached
        sigma *= 2
    return filled
