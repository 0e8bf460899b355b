"""Alignment: each version is moved to the place of the first by a translation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Floats, Versions, fill

#: Steps of least squares: each reduces the error to a fifth or less.
_STEPS = 6
#: Images of less contrast than this, as a share of their values, have nothing to align.
_FLAT = 1e-5
#: Differences of this many medians count half.
_OUTLYING = 3.0
#: A shifted pixel is known if at least this share of what it is interpolated from is.
_KNOWN_FROM = 0.5
#: Blur, in pixels, that removes noise which would outvote the image.
_BLUR = 1.0


def align(versions: Versions) -> tuple[Versions, NDArray[np.float64]]:
    """Register versions and shift them to the place of the first; pixels that a shift uncovers are unknown."""
    # Masked phase correlation finds whole pixels. Fractions, which it cannot find, follow by least squares over the
    # pixels that both versions know, so that neither holes nor painted-over parts bias them. Return also (S, 2) pixels
    # by which each version was moved, down and to the right.
    # D. Padfield, IEEE Trans. Image Processing 21 (2012), doi 10.1109/TIP.2011.2181402, for the correlation; B. Lucas
    # and T. Kanade, IJCAI 1981, pp. 674-679, for the least squares.
    shifts = np.zeros((versions.n_versions, 2))
    pictures = [_grey(versions, version) for version in range(versions.n_versions)]
    values, known = versions.values.copy(), versions.known.copy()
    for version in range(1, versions.n_versions):
        shifts[version] = _shift_between(pictures[0], pictures[version], known[:, :, 0], versions.known[:, :, version])
        bands = versions.version_of == version
        values[:, :, bands], known[:, :, version] = _shifted(
            versions.bands(version), versions.known[:, :, version], shifts[version]
        )
    return versions.moved(values, known), shifts


def _grey(versions: Versions, version: int) -> Floats:
    """(H, W) mean of the bands of a version, with unknown pixels filled in."""
    weight = versions.known[:, :, version].astype(np.float32)
    return fill(versions.bands(version).mean(axis=2, keepdims=True), weight)[:, :, 0]


def _shift_between(
    fixed: Floats, moving: Floats, fixed_known: NDArray[np.bool_], moving_known: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(2,) shift that moves an image to the place of another."""
    from scipy.ndimage import gaussian_filter
    from skimage.registration import phase_cross_correlation

    fixed, moving = gaussian_filter(fixed, _BLUR), gaussian_filter(moving, _BLUR)
    if min(np.ptp(fixed), np.ptp(moving)) <= _FLAT * np.abs(fixed).max():
        return np.zeros(2)
    correlate: Any = phase_cross_correlation
    whole, _, _ = correlate(fixed, moving, reference_mask=fixed_known, moving_mask=moving_known)
    whole = np.asarray(whole, np.float64)
    shift = whole.copy()
    for _ in range(_STEPS):
        shift += _step(fixed, moving, fixed_known, moving_known, shift)
    return shift if np.abs(shift - whole).max() <= 1 else whole


def _step(
    fixed: Floats,
    moving: Floats,
    fixed_known: NDArray[np.bool_],
    moving_known: NDArray[np.bool_],
    shift: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(2,) correction of a shift: least squares over known pixels, with little weight where the images disagree."""
    from scipy.ndimage import shift as move

    moved = move(moving, shift, order=1, mode="nearest")
    known = fixed_known & (move(moving_known.astype(np.float32), shift, order=1) > _KNOWN_FROM)
    difference = (moved - fixed)[known].astype(np.float64)
    slopes = np.stack([slope[known] for slope in np.gradient((moved + fixed) / 2)], axis=1).astype(np.float64)
    usual = _OUTLYING * np.median(np.abs(difference)) if len(difference) else 0.0
    weights = 1 / (1 + (difference / usual) ** 2) if usual else np.ones(len(difference))
    step, *_ = np.linalg.lstsq(slopes.T @ (weights[:, None] * slopes), slopes.T @ (weights * difference))
    return np.clip(step, -1, 1)


def _shifted(bands: Floats, known: NDArray[np.bool_], shift: NDArray[np.float64]) -> tuple[Floats, NDArray[np.bool_]]:
    """(H, W, C) values of a version at their new places, and where they are known."""
    from scipy.ndimage import shift as move

    share = move(known.astype(np.float32), shift, order=1, cval=0)
    still_known = share >= _KNOWN_FROM
    whole = not np.any(shift % 1)
    filled = bands if whole else fill(bands, known.astype(np.float32))
    moved = move(filled, (*shift, 0), order=0 if whole else 3, mode="nearest")
    return np.where(still_known[:, :, None], moved, 0), still_known
