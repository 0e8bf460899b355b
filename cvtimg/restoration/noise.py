"""How noisy each version is: measured in each alone, and where several know a pixel, by what they differ by.

A version alone cannot tell noise from texture, so it is measured in quiet blocks or, where pixels are missing one by
one, by differences across the diagonals of four adjacent pixels. Both are too large where texture is everywhere. The
difference of two versions has no texture in it. It is too large where they do not line up or differ in exposure. The
lower of the two is taken.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.quiet import levels_of, looks_at
from cvtimg.restoration.versions import Floats, Versions
from cvtimg.segmentation.noise import lower_variance, scattered_noise

_Doubles = NDArray[np.float64]
_Bools = NDArray[np.bool_]

#: Fewer blocks, or pixels, tell nothing.
_ENOUGH_PIXELS = 64
#: Values nearer to an end than this many standard deviations have lost noise by clipping.
_FROM_ENDS = 1.25
#: Side of the windows whose mean tells how far values are from an end.
_AROUND = 5
#: About this many pixels of a version are measured, in strips of so many rows.
_MEASURED, _STRIP = 1 << 22, 256
#: About this many pixels of two versions are compared.
_SAMPLED = 1 << 20
#: Versions whose difference has less than this part of the variance of their noise are copies of one noisy image.
_COPIES = 0.0025
#: Part of the least variance of a difference that is noise of either version.
_SURELY = 0.1
#: Relative errors of the variance of a difference; of how much noisier one version is than another, each measured
#: alone; and of the noise of a version alone, which may be texture for the most part.
_SUMS, _STEPS, _OWN = 0.02, 0.25, 0.5


def mean_noise(noise_by_band: list[_Doubles]) -> _Doubles:
    """(S,) root mean squares of the noise in the bands of each version."""
    return np.array([np.sqrt(np.mean(np.square(sigmas))) for sigmas in noise_by_band])


def noise_of_bands(versions: Versions, *, alike: bool = True) -> list[_Doubles]:
    """(C,) standard deviation of the noise in each band, of each version; NaN where too little is known."""
    # Versions are as they came: interpolation would smooth their noise. Those that are `alike` differ by noise.
    alone = _alone(versions)
    return list(_by_differences(versions, np.stack(alone))) if alike and versions.n_versions > 1 else alone


def _alone(versions: Versions) -> list[_Doubles]:
    """(C,) noise in each band, of each version by itself; all measured in one way, so that they compare."""
    found = [np.full(np.count_nonzero(versions.version_of == s), np.nan) for s in range(versions.n_versions)]
    numbers = np.flatnonzero(versions.known.any(axis=(0, 1))).tolist()
    for number in numbers:
        found[number] = levels_of(next(iter(looks_at(versions.only(number), in_place=False))))
    if not any(np.isnan(found[number]).any() for number in numbers):
        return found
    # Where pixels are missing one by one, or most are cut off, no patch is whole.
    rows, white = _strips(*versions.known.shape[:2]), versions.white
    known = np.moveaxis(versions.known[rows], 2, 0)
    return [_off_the_ends(versions.bands(s, rows), seen, white) for s, seen in enumerate(known)]


def _strips(height: int, width: int) -> slice | NDArray[np.intp]:
    """Rows of an image, or of strips all over a large one."""
    n_strips = max(_MEASURED // (_STRIP * width), 1)
    if n_strips * _STRIP >= height:
        return slice(None)
    firsts = np.linspace(0, height - _STRIP, n_strips).astype(np.intp)
    return np.asarray(np.add.outer(firsts, np.arange(_STRIP)).ravel())


def _off_the_ends(values: Floats, known: _Bools, white: float | None) -> _Doubles:
    """(C,) noise in each band, measured where clipping took none of it away, if there is enough of that."""
    from scipy.ndimage import uniform_filter

    found: _Doubles = scattered_noise(values, known)
    if white is None:
        return found
    share = uniform_filter(known.astype(np.float32), _AROUND)
    for band, sigma in enumerate(found):
        if not np.isnan(sigma):
            mean = uniform_filter(values[:, :, band], _AROUND) / np.maximum(share, 1e-3)
            inside = known & (mean >= _FROM_ENDS * sigma) & (mean <= white - _FROM_ENDS * sigma)
            again = float(scattered_noise(values[:, :, band : band + 1], inside)[0])
            found[band] = sigma if np.isnan(again) else again
    return found


def _by_differences(versions: Versions, alone: _Doubles) -> _Doubles:
    """(S, C) noise: variances that explain what versions differ by, and are no larger than those of each `alone`."""
    n, squares = versions.n_versions, np.maximum(alone**2, 1e-30)
    if not np.isfinite(squares).all():
        return alone
    pairs = sorted({(min(a, b), max(a, b)) for a in range(n) for b in ((a + 1) % n, (a + 2) % n) if a != b})
    told = [_variance_between(versions, *pair, alone) for pair in pairs]
    compared = [(pair, variance) for pair, variance in zip(pairs, told, strict=True) if variance is not None]
    noise = alone.copy()
    for band, own in enumerate(squares.T):
        variances = np.array([variance[band] for _, variance in compared])
        if len(variances) and variances.min() > _COPIES * own.min():
            sums = np.array([[number in pair for number in range(n)] for pair, _ in compared], np.float64)
            steps, next_own = np.eye(n) - np.roll(np.eye(n), 1, axis=1), np.roll(own, -1)
            rows = np.concatenate([sums, steps, np.eye(n)])
            values = np.concatenate([variances, own - next_own, own])
            errors = np.concatenate([_SUMS * variances, _STEPS * np.maximum(own, next_own), _OWN * own])
            found = np.linalg.lstsq(rows / errors[:, None], values / errors)[0]
            noise[:, band] = np.sqrt(np.clip(found, np.minimum(_SURELY * variances.min(), own), own))
    return noise


def _variance_between(versions: Versions, one: int, other: int, alone: _Doubles) -> _Doubles | None:
    """(C,) variance of the difference of two versions where both know a pixel; None if there are few."""
    step = max(1, versions.known[:, :, 0].size // _SAMPLED)
    rows = slice(None, None, step)
    both = versions.known[rows, :, one] & versions.known[rows, :, other]
    if np.count_nonzero(both) < _ENOUGH_PIXELS:
        return None
    left, right = versions.bands(one, rows)[both], versions.bands(other, rows)[both]
    found = np.empty(left.shape[1])
    for band in range(len(found)):
        apart, mean = left[:, band] - right[:, band], (left[:, band] + right[:, band]) / 2
        if versions.white is not None:
            margin = _FROM_ENDS * np.nan_to_num(np.fmax(alone[one, band], alone[other, band]))
            inside = (mean >= margin) & (mean <= versions.white - margin)
            apart = apart[inside] if np.count_nonzero(inside) >= _ENOUGH_PIXELS else apart
        found[band] = lower_variance(apart)
    return found
