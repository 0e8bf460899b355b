"""How versions in place compare: which fit each other, whatever noise and gaps they have, and their exposures.

Those fit that show the same thing at the same place. Fine structure tells: what is left between two blurs, free of the
noise of single pixels and of slow changes of exposure. In windows where two versions have some, what they differ by is
compared with what there is, less noise: next to nothing where they show the same, as much where one is some pixels off,
and twice as much for another picture. And so do levels that are far apart.

Exposure and white balance are a gain and an offset for each band, to the first version, that most windows have.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from cvtimg._shared.messages import warn
from cvtimg._shared.threads import side_by_side
from cvtimg._shared.types import Array, Bools, Floats, Floats32
from cvtimg.restoration.noise import SharedNoise
from cvtimg.restoration.versions import Versions, fill

#: A version fits another if in the median of windows, what they differ by is below this part of what there is.
MOST_MISFIT = 0.25
#: Side, in pixels, of windows that are compared, and the share of these that is known at least.
_SIDE, _KNOWN = 16, 0.3
#: Part of the upper quartile of power that they have at least, and the logarithm by which the power of both may differ:
#: where one is painted over, it does by more.
_POWER, _ALIKE = 0.25, 0.5
#: Windows that are enough; or fewer, which tell another image from a misfit of 1 on.
_ENOUGH, _FEW = 100, 20
#: Windows whose means tell the exposure: their least and largest number.
_TOLD = (32, 1000)
#: Share of the pixels of a window that are clipped at black and at white, which bias its mean.
_CLIPPED = (0.3, 0.03)
#: Part of the variance of the first version that a line leaves, and the gain, at most.
_LEFT, _LARGEST = 0.1, 4.0
#: Gain below which a version is a longer exposure, which knows nothing within the other part of the range from white.
_LONGER, _NEAR_WHITE = 0.95, 1 / 16
#: Side, in pixels, of the noise that is drawn.
_DRAWN = 256


def misfits(versions: Versions, noise: Floats, shared: SharedNoise | None = None) -> Floats:
    """(S, S) misfit of each version with each other, 0 where nothing tells; `noise`, (S,), is that of versions."""
    n = versions.n_versions
    structure = [*side_by_side(partial(_structure, versions), range(n))]
    powers = [_means(np.square(values), known) for values, known in structure]
    shared = shared or SharedNoise.white(np.eye(versions.stack[0].shape[2]))
    # What is left of such noise, of a picture of its own, in the structure of the mean band.
    spread, lags = np.zeros((_DRAWN, _DRAWN)), len(shared.autocovariance) // 2
    spread[: 2 * lags + 1, : 2 * lags + 1] = shared.autocovariance.mean(axis=(2, 3))
    drawn = np.fft.fft2(np.random.default_rng(0).standard_normal(spread.shape)) * np.sqrt(np.abs(np.fft.fft2(spread)))
    noisy = noise**2 * np.var(_between_blurs(np.fft.ifft2(drawn).real)) / np.diag(shared.bands).mean()
    apart_by = np.zeros((n, n))
    for first, other in combinations(range(n), 2):
        both = structure[first][1] & structure[other][1]
        tells = np.isfinite(_means(structure[first][0], both))
        for power, rest in ((powers[first], noisy[first]), (powers[other], noisy[other])):
            seen = power[np.isfinite(power)]
            least = _POWER * max(np.quantile(seen, 0.75) - rest, 0) if len(seen) else 0.0
            tells &= (power - rest > least) & (power > 2 * rest)
        if not tells.any():
            continue
        ours, theirs = (powers[s] - noisy[s] for s in (first, other))
        gain = np.median((theirs / ours)[tells])  # of a longer exposure
        with np.errstate(invalid="ignore"):
            tells &= np.abs(np.log(gain * ours / theirs)) < _ALIKE
        if (n_windows := np.count_nonzero(tells)) >= _FEW:
            apart = _means(np.square(structure[first][0] * np.float32(np.sqrt(gain)) - structure[other][0]), both)
            parts = 2 * (apart - gain * noisy[first] - noisy[other]) / (gain * ours + theirs)
            part = max(np.median(parts[tells]), 0)
            if n_windows >= _ENOUGH or part > 1:
                apart_by[first, other] = apart_by[other, first] = part
    return apart_by


def _apart_in_levels(versions: Versions, noise: Floats) -> Floats:
    """(S, S) misfit of the levels of versions, as of a dark frame or of a short exposure.

    Above `MOST_MISFIT` levels differ by more than a quarter of their variance and than the noise of both: leaving out
    the other version costs less than taking it.
    """
    n = versions.n_versions
    # Of windows that are cut off, too, unlike those that tell an exposure: a covered lens is all black.
    levels = [_means(versions.bands(s).mean(axis=2), versions.known[:, :, s]) for s in range(n)]
    apart = np.zeros((n, n))
    for first, other in combinations(range(n), 2):
        seen = np.isfinite(levels[first] + levels[other])
        if np.count_nonzero(seen) >= _FEW:
            ours, theirs = levels[first][seen], levels[other][seen]
            least = float(np.square(noise[[first, other]]).sum()) / MOST_MISFIT
            spread = max((np.var(ours) + np.var(theirs)) / 2, least, np.finfo(np.float64).tiny)
            apart[first, other] = apart[other, first] = np.median(np.square(ours - theirs)) / spread
    return apart


def _structure(versions: Versions, version: int) -> tuple[Floats32, Bools]:
    """(H, W) fine structure of the mean of the bands, and where it is known."""
    from scipy.ndimage import uniform_filter

    known = versions.known[:, :, version]
    inner = uniform_filter(known.astype(np.float32), 3) > 0.5
    gray = fill(versions.bands(version).mean(axis=2, keepdims=True), known.astype(np.float32))[:, :, 0]
    return _between_blurs(gray), inner


def _between_blurs(image: Array) -> Array:
    """(H, W) structure of an image, without single outliers."""
    from scipy.ndimage import gaussian_filter, median_filter

    image = median_filter(image, 3)
    return gaussian_filter(image, 1) - gaussian_filter(image, 4)


def _means(values: Array, known: Bools) -> Floats:
    """(T,) mean of known values in each window; NaN where too few are known."""
    from scipy.ndimage import uniform_filter

    windows = (slice(_SIDE // 4, None, _SIDE // 2),) * 2
    share = uniform_filter(known.astype(np.float64), _SIDE)[windows].ravel()
    sums = uniform_filter(np.where(known, values, 0).astype(np.float64), _SIDE)[windows].ravel()
    return np.divide(sums, share, out=np.full(share.shape, np.nan), where=share >= _KNOWN)


def fitting(
    versions: Versions, noise: Floats, shared: SharedNoise | None, *, aligned: bool, hidden: str
) -> tuple[Versions, Floats]:
    """Warn of versions that do not fit the one that most fit, the first of these, and leave them out if asked for."""
    # Where motion is hidden, they must fit the first. Return also the (S,) misfit with that one.
    reference, apart = misfits_of_most(versions, noise, shared, first=hidden == "motion")
    is_out = apart > MOST_MISFIT
    if not is_out.any():
        return versions, apart
    numbers = np.flatnonzero(is_out).tolist()
    names = ", ".join(f"images[{number}]" for number in numbers)
    values = ", ".join(f"{apart[number]:.2f}" for number in numbers)
    leaves_out = hidden != "none"
    done = ("is" if len(numbers) == 1 else "are") + " left out" if leaves_out else "may spoil the result"
    why = "no alignment was found" if aligned else "align=True moves them into place, and to its levels"
    warn(f"{names} cannot be laid over images[{reference}] and {done}: misfit {values}, at most {MOST_MISFIT}; {why}")
    return (replace(versions, known=versions.known & ~is_out) if leaves_out else versions), apart


def misfits_of_most(
    versions: Versions, noise: Floats, shared: SharedNoise | None = None, *, first: bool = False
) -> tuple[int, Floats]:
    """Return the version that most fit, or the first, and the (S,) misfits with it."""
    apart = np.maximum(misfits(versions, noise, shared), _apart_in_levels(versions, noise))
    reference = 0 if first else int(np.argmax((apart <= MOST_MISFIT).sum(axis=1)))
    return reference, apart[reference]


# --- exposure


def exposures(placed: Versions) -> Floats:
    """(S, C, 2) gain and offset of each version in place that bring it to the levels of the first."""
    tones = np.tile([1.0, 0.0], (placed.n_versions, placed.stack[0].shape[2], 1))
    first = _levels(placed, 0)
    for version in range(1, placed.n_versions):
        other = _levels(placed, version)
        both = np.flatnonzero(np.isfinite(first + other).all(axis=1))
        if len(both) >= _TOLD[0]:
            both = both[:: -(-len(both) // _TOLD[1])]
            lines = [*side_by_side(_line, [*zip(other[both].T, first[both].T, strict=True)])]
            if not any(line is None for line in lines):
                tones[version] = lines
    return tones


def _levels(versions: Versions, version: int) -> Floats:
    """(T, C) means of the known pixels of windows; NaN where few are known or some are clipped."""
    values, known = versions.bands(version), versions.known[:, :, version]
    means = np.stack([_means(band, known) for band in np.moveaxis(values, 2, 0)], axis=1)
    if versions.white is not None:
        for clipped, most in zip((values <= 0, values >= versions.white), _CLIPPED, strict=True):
            means[_means(np.any(clipped, axis=2), known) >= most] = np.nan
    return means


def _line(pairs: tuple[Floats, Floats]) -> tuple[float, float] | None:
    """Gain and offset from values to those wanted, most of which are on a line; None if they are on none."""
    from scipy.stats import theilslopes

    values, wanted = pairs
    # What is left of noise and of motion, in both, biases the slope of a regression of either on the other alike.
    slopes = [theilslopes(*pair).slope for pair in ((wanted, values), (values, wanted))]
    gain = float(np.sqrt(max(slopes[0], 0) / slopes[1])) if slopes[1] > 0 else 0.0
    offset = float(np.median(wanted - gain * values))
    scale = 1.4826 * np.median(np.abs(gain * values + offset - wanted))
    return (gain, offset) if scale**2 < _LEFT * np.var(wanted) and 1 / _LARGEST < gain < _LARGEST else None


def equalized(versions: Versions, tones: Floats) -> Versions:
    """Bring versions to the levels of the first; what longer exposures show near white is unknown."""
    from scipy.ndimage import uniform_filter

    known, most = versions.known.copy(), (1 - _NEAR_WHITE) * (versions.white or np.inf)
    for version in np.flatnonzero((tones[:, :, 0] < _LONGER).any(axis=1)):
        mean = uniform_filter(versions.bands(int(version)), (5, 5, 0))
        known[:, :, version] &= (mean < most).all(axis=2)
    return replace(versions, known=known, tones=tones)
