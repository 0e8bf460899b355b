"""Which versions fit: those that show the same thing at the same place, whatever noise and gaps they have.

Fine structure tells: what is left between two blurs, free of the noise of single pixels and of slow changes of
exposure. In windows where two versions have some, what they differ by is compared with what there is, less noise: next
to nothing where they show the same, as much where one is some pixels off, and twice as much for another picture.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Floats, Versions, fill

#: Blurs, in pixels, between which structure lies.
_FINE, _COARSE = 1.0, 4.0
#: Side of the windows in which versions are compared, in pixels.
_SIDE = 16
#: Windows tell something if they have this part of the upper quartile of power, more than this times that of noise, and
#: this share of known pixels; and if there are this many of them.
_LEAST_POWER, _OVER_NOISE, _LEAST_KNOWN, _LEAST_WINDOWS = 0.25, 1.0, 0.3, 100
#: And if both versions have like power there, to within this logarithm: where one is painted over, they have not.
_ALIKE = 0.5
#: A version fits another if in the median of these windows, what they differ by is below this part of what there is.
MOST_MISFIT = 0.25


def misfits(versions: Versions, noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """(S, S) misfit of each version with each other, 0 where nothing tells; `noise`, (S,), is that of versions."""
    n = versions.n_versions
    structure = [_structure(versions, version) for version in range(n)]
    powers = [_means(np.square(values), known) for values, known in structure]
    n_bands = np.bincount(versions.version_of)
    noisy = _noise_left() * noise**2 / n_bands
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
            if np.count_nonzero(tells) >= _LEAST_WINDOWS:
                apart = _means(np.square(structure[one][0] * np.float32(np.sqrt(gain)) - structure[other][0]), both)
                parts = 2 * (apart - gain * noisy[one] - noisy[other]) / (gain * ours + theirs)
                found[one, other] = found[other, one] = max(np.median(parts[tells]), 0)
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
    from scipy.ndimage import gaussian_filter, median_filter

    white = median_filter(np.random.default_rng(0).standard_normal((256, 256)), 3)
    return float(np.var(gaussian_filter(white, _FINE) - gaussian_filter(white, _COARSE)))
