"""What is known about an image from its versions: their values in place, and how far each is to be trusted where."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg.restoration.agreement import HIDDEN
from cvtimg.restoration.alignment import Alignment
from cvtimg.restoration.alignment import align as align_versions
from cvtimg.restoration.exposure import equalized, exposures
from cvtimg.restoration.levels import bend_of
from cvtimg.restoration.noise import mean_noise, noise_of_bands
from cvtimg.restoration.spectrum import LAGS, SharedNoise, shared_noise
from cvtimg.restoration.suspicion import Suspicion
from cvtimg.restoration.versions import Floats, Versions, disagreement, fill, trust_in, usual_noise

# --- which versions fit: those that show the same thing at the same place, whatever noise and gaps they have
# Fine structure tells: what is left between two blurs, free of the noise of single pixels and of slow changes of
# exposure. In windows where two versions have some, what they differ by is compared with what there is, less noise:
# next to nothing where they show the same, as much where one is some pixels off, and twice as much for another picture.

#: Blurs, in pixels, between which structure lies.
_FINE, _COARSE = 1.0, 4.0
#: Side of the windows in which versions are compared, in pixels.
_SIDE = 16
#: Windows tell something if they have this part of the upper quartile of power, more than this times that of noise, and
#: this share of known pixels; and if there are this many of them.
_LEAST_POWER, _OVER_NOISE, _LEAST_KNOWN, _LEAST_WINDOWS = 0.25, 1.0, 0.3, 100
#: This many windows tell of another image, if the misfit is above this.
_FEW_WINDOWS, _ANOTHER = 20, 1.0
#: And if both versions have like power there, to within this logarithm: where one is painted over, they have not.
_ALIKE = 0.5
#: A version fits another if in the median of these windows, what they differ by is below this part of what there is.
MOST_MISFIT = 0.25


def misfits(versions: Versions, noise: NDArray[np.float64], shared: SharedNoise | None = None) -> NDArray[np.float64]:
    """(S, S) misfit of each version with each other, 0 where nothing tells; `noise`, (S,), is that of versions."""
    n = versions.n_versions
    structure = [_structure(versions, version) for version in range(n)]
    powers = [_means(np.square(values), known) for values, known in structure]
    n_bands = np.bincount(versions.version_of)
    noisy = noise**2 * (_shared_left(shared) if shared else _noise_left() / n_bands)
    found = np.zeros((n, n))
    for one in range(n):
        for other in range(one):
            both = structure[one][1] & structure[other][1]
            tells = np.isfinite(_means(structure[one][0], both))
            for power, rest in ((powers[one], noisy[one]), (powers[other], noisy[other])):
                seen = power[np.isfinite(power)]
                least = _LEAST_POWER * max(np.quantile(seen, 0.75) - rest, 0) if len(seen) else 0.0
                tells &= (power - rest > least) & (power > (1 + _OVER_NOISE) * rest)
            if not tells.any():
                continue
            ours, theirs = (powers[s] - noisy[s] for s in (one, other))
            gain = np.median((theirs / ours)[tells])  # of a longer exposure
            with np.errstate(invalid="ignore"):
                tells &= np.abs(np.log(gain * ours / theirs)) < _ALIKE
            n_windows = np.count_nonzero(tells)
            if n_windows >= _FEW_WINDOWS:
                apart = _means(np.square(structure[one][0] * np.float32(np.sqrt(gain)) - structure[other][0]), both)
                parts = 2 * (apart - gain * noisy[one] - noisy[other]) / (gain * ours + theirs)
                part = max(np.median(parts[tells]), 0)
                if n_windows >= _LEAST_WINDOWS or part > _ANOTHER:
                    found[one, other] = found[other, one] = part
    return found


def _structure(versions: Versions, version: int) -> tuple[Floats, NDArray[np.bool_]]:
    """(H, W) fine structure of the mean of the bands, without single outliers, and where it is known."""
    from scipy.ndimage import gaussian_filter, median_filter, uniform_filter

    known = versions.known[:, :, version]
    inner = uniform_filter(known.astype(np.float32), 3) > 0.5
    gray = fill(versions.bands(version).mean(axis=2, keepdims=True), known.astype(np.float32))[:, :, 0]
    gray = median_filter(gray, 3)
    return gaussian_filter(gray, _FINE) - gaussian_filter(gray, _COARSE), inner


def _means(values: Floats, known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(T,) mean of known values in each window; NaN where too few are known."""
    from scipy.ndimage import uniform_filter

    windows = (slice(_SIDE // 4, None, _SIDE // 2),) * 2
    share = uniform_filter(known.astype(np.float64), _SIDE)[windows].ravel()
    sums = uniform_filter(np.where(known, values, 0).astype(np.float64), _SIDE)[windows].ravel()
    return np.divide(sums, share, out=np.full(share.shape, np.nan), where=share >= _LEAST_KNOWN)


@cache
def _noise_left() -> float:
    """Variance that is left in the structure of white noise of variance 1."""
    return _left_of(np.random.default_rng(0).standard_normal((256, 256)))


def _shared_left(shared: SharedNoise) -> float:
    """Part of the variance of bands of shared noise that is left in the structure of their mean."""
    mean = np.zeros((256, 256))
    lags = len(shared.autocovariance) // 2
    mean[: 2 * lags + 1, : 2 * lags + 1] = shared.autocovariance.mean(axis=(2, 3))
    power = np.abs(np.fft.fft2(mean))
    white = np.fft.fft2(np.random.default_rng(0).standard_normal(mean.shape))
    return _left_of(np.fft.ifft2(white * np.sqrt(power)).real) / shared.variance


def _left_of(noise: NDArray[np.float64]) -> float:
    """Variance that is left in the structure of noise."""
    from scipy.ndimage import gaussian_filter, median_filter

    smooth = median_filter(noise, 3)
    return float(np.var(gaussian_filter(smooth, _FINE) - gaussian_filter(smooth, _COARSE)))


# --- evidence

#: Rounding with less than this part of the variance of noise is in what was measured.
_LITTLE = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Versions with the weight of each."""

    given: Versions
    placed: Versions  # all that is known, in place; and what is left of it where versions disagree
    versions: Versions
    alignment: Alignment  # how each version was moved
    misfits: NDArray[np.float64]  # (S,): misfit of each version, in place, with the one that most fit
    #: (S,): standard deviation of the noise of each version, NaN where too little is known; by band; and its weight
    noise: NDArray[np.float64]
    noise_by_band: list[NDArray[np.float64]]  # (C,) of each version
    trust: NDArray[np.float64]
    shared: SharedNoise | None  # what pixels share of the noise of weight 1; None if it is white
    suspicion: Suspicion | None  # how often versions hold additions; None if nothing else is to be left out
    channels: bool  # whether versions share segments but no colors
    aligned: bool  # whether versions were put in place
    unit: float  # noise, in levels, for noise of one where versions are bent
    is_noisy: bool  # whether any version has noise that can be seen, or that was given

    def variances(self, data: Versions, gain: float = 1.0) -> list[float]:
        """Variances of a value of weight 1, as far as known: of the noise, and of the disagreement of versions."""
        # The data are the versions, averaged so that this part of the variance of the noise, `gain`, is left.
        known = np.isfinite(self.noise)
        found = [float((self.trust * self.noise**2)[known].mean()) * gain] if known.any() else []
        apart = np.nan if self.channels else disagreement(data, self.trust)
        if np.isfinite(apart):
            found.append(apart)
        return found or [0.0]


def prepare(
    given: Versions,
    weights: ArrayLike | None,
    *,
    align: str | None,
    hidden: str,
    channels: bool,
    level: float | None,
    white: bool,
) -> Evidence:
    """Measure the noise of versions, put them in place, and leave out where they disagree; options as in `restore`."""
    # Noise is measured before any interpolation, which smooths it; `level` is its standard deviation, if given.
    if align and given.n_versions == 1:
        warnings.warn(f"align={align!r} has nothing to align: there is one version", UserWarning, stacklevel=3)
    placed, alignment = align_versions(given, align) if align else (given, Alignment.none(given.n_versions))
    if align and not channels:
        tones = exposures(placed)
        given, placed = (equalized(one, tones) for one in (given, placed))
    noise_by_band = noise_of_bands(given, alike=not channels)
    noise, bend, unit = mean_noise(noise_by_band), None, 1.0
    is_seen = noise > given.unseen  # False where it is unknown
    if not white and is_seen.all():
        bend = bend_of(given, in_place=align is None)
    if bend:
        unit = bend.unit(given.bands(0))
        given, placed = (replace(one, bend=bend) for one in (given, placed))
        noise_by_band = noise_of_bands(given, alike=not channels)
        noise = mean_noise(noise_by_band)
    shared = None if white else shared_noise(given, in_place=align is None)
    if not white and (align or given.n_versions == 1):  # what versions in place differ by has it already
        shared = _with_rounding(shared, given, noise, unit)
    if level is not None:
        noise = np.full_like(noise, level / unit)
    elif shared:
        usual = np.sqrt(np.nanmean(noise**2)) if np.isfinite(noise).any() else 1.0
        noise = np.sqrt(shared.variance) * (noise / usual if usual else np.ones_like(noise))
    if shared:  # the level of white noise tells little of its bands
        noise_by_band = [np.sqrt(np.diag(shared.bands))] * given.n_versions
    is_noisy = bool(is_seen.any()) or shared is not None or level is not None
    trust = trust_in(given, weights, noise)
    versions, suspicion, apart = placed, None, np.full(given.n_versions, np.nan)
    if not channels:
        usual = usual_noise(placed, noise)
        fitting, apart = _fitting(placed, usual, shared, aligned=bool(align), hidden=hidden)
        versions = HIDDEN[hidden](fitting, usual, moved=bool(align))
        suspicion = (Suspicion.of(placed, versions, usual) or None) if hidden == "outliers" else None
    known = (alignment, apart, noise, noise_by_band, trust, shared, suspicion)
    return Evidence(given, placed, versions, *known, channels, bool(align), unit, is_noisy)


def _with_rounding(
    shared: SharedNoise | None, versions: Versions, noise: NDArray[np.float64], unit: float
) -> SharedNoise | None:
    """Add to noise what versions have lost as JPEG files, a mean over them, unless that is little."""
    pairs = zip(versions.roundings, versions.stack, strict=False)
    found = [rounding.autocovariance(values, LAGS) for rounding, values in pairs if rounding]
    lost = [one for one in found if one is not None]
    if not lost:
        return shared
    total = np.sum(lost, axis=0) / (versions.n_versions * unit**2)
    white = float(np.nanmean(noise**2)) if np.isfinite(noise).any() else 0.0
    if SharedNoise(total).variance < _LITTLE * (shared.variance if shared else white):
        return shared
    if shared:
        return SharedNoise(total + shared.autocovariance)
    total[LAGS, LAGS] += white * np.eye(total.shape[2])
    return SharedNoise(total)


def without_copies(versions: Versions) -> Versions:
    """Warn of versions that are copies of one before, and leave them out: their noise is not independent."""
    copies, known = [], versions.known.copy()
    sums = [versions.bands(number).sum(dtype=np.float64) for number in range(versions.n_versions)]
    for one, other in combinations(range(versions.n_versions), 2):
        same = sums[one] == sums[other] and np.array_equal(versions.known[:, :, one], versions.known[:, :, other])
        if same and known[:, :, other].any() and np.array_equal(versions.bands(one), versions.bands(other)):
            copies.append(f"images[{other}] is a copy of images[{one}]")
            known[:, :, other] = False
    if copies:
        warnings.warn(f"{', '.join(copies)} and counts once", UserWarning, stacklevel=3)
    return versions.knowing(known) if copies else versions


def _fitting(
    versions: Versions, noise: NDArray[np.float64], shared: SharedNoise | None, *, aligned: bool, hidden: str
) -> tuple[Versions, NDArray[np.float64]]:
    """Warn of versions that do not fit the one that most fit, the first of these, and leave them out if asked for."""
    # Where motion is hidden, they must fit the first.
    # Return also the (S,) misfit with that one.
    apart = misfits(versions, noise, shared)
    reference = 0 if hidden == "motion" else int(np.argmax((apart <= MOST_MISFIT).sum(axis=1)))
    is_out = apart[reference] > MOST_MISFIT
    if not is_out.any():
        return versions, apart[reference]
    numbers = np.flatnonzero(is_out).tolist()
    names = ", ".join(f"images[{number}]" for number in numbers)
    values = ", ".join(f"{apart[reference, number]:.2f}" for number in numbers)
    leaves_out = hidden != "none"
    done = ("is" if len(numbers) == 1 else "are") + " left out" if leaves_out else "may spoil the result"
    why = "no alignment was found" if aligned else "align=True moves them into place"
    warnings.warn(
        f"{names} cannot be laid over images[{reference}] and {done}: misfit {values}, at most {MOST_MISFIT}; {why}",
        UserWarning,
        stacklevel=4,
    )
    return (versions.knowing(versions.known & ~is_out) if leaves_out else versions), apart[reference]
