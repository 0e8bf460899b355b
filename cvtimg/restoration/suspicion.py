"""What to leave out of a version that is known to hold additions, where the majority of versions cannot tell.

Where three versions know a pixel, the majority finds what was added to one of them (`agreement`). How often that
happens tells how often it happens elsewhere. There, a value is left out if it is more likely to be an addition, which
may have any color, than the estimated image plus noise. Without evidence of additions nothing is ever left out, however
poor the estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Floats, Versions

#: Shares of additions below this are chance.
_LEAST_SHARE = 1e-3
#: Two versions that disagree at more than this share differ all over: in exposure, or because they do not line up.
_MOST_OF_TWO = 0.2
#: At least this many pixels must be known to enough versions to measure the share.
_LEAST_JUDGED = 256
#: The square of what differs from noise of one standard deviation in so many bands that chance never explains it.
_NEVER = 20.0
#: Side, in pixels, of the windows in which it is measured how well an estimate explains what is around.
_AROUND = 5
#: Sides of a median that precedes all estimates.
_MEDIAN = 3


@dataclass(frozen=True, slots=True, eq=False)
class Suspicion:
    """How often versions hold additions."""

    shares: NDArray[np.float64]  # (S,): share of the pixels of each version that hold an addition; 0 without evidence
    noise: NDArray[np.float64]  # (S,): standard deviation of the noise of each version

    @classmethod
    def of(cls, versions: Versions, kept: Versions, noise: NDArray[np.float64]) -> Suspicion:
        """Measure how often the majority of `versions` has left each out of those `kept`."""
        judged = (versions.coverage >= 3)[:, :, None] & versions.known
        n_judged = np.count_nonzero(judged, axis=(0, 1))
        n_left_out = np.count_nonzero(judged & ~kept.known, axis=(0, 1))
        shares = n_left_out / np.maximum(n_judged, 1)
        if versions.n_versions == 2:
            n_judged, shares = _shares_of_two(versions, noise)
        evident = (shares > _LEAST_SHARE) & (n_judged >= _LEAST_JUDGED)
        return cls(np.where(evident, np.minimum(shares, 0.5), 0.0), noise)

    def __bool__(self) -> bool:
        return bool(self.shares.any())

    def kept(self, versions: Versions, estimate: Floats) -> Versions:
        """Leave out values of suspected versions that the estimate and its errors nearby do not explain."""
        known = versions.known.copy()
        n_bands = estimate.shape[2]
        span = max(float(np.ptp(estimate)), 1e-30)
        for version in np.flatnonzero(self.shares):
            seen, values = versions.known[:, :, version], versions.bands(int(version))
            squares = np.square(values - estimate).sum(axis=2)
            alone, confirmed = _compared(versions, int(version), self.noise)
            # Versions that disagree here: one of them holds an addition.
            share = np.where(alone, self.shares[version], 0.5)
            variance = self._variance(int(version), squares, seen, n_bands)
            likelier = np.log((1 - share) / share) + n_bands / 2 * np.log(
                np.maximum(span**2 / (2 * np.pi * variance), 1)
            )
            known[:, :, version] &= confirmed | (squares <= 2 * likelier * variance)
        return versions.knowing(known)

    def _variance(self, version: int, squares: Floats, seen: NDArray[np.bool_], n_bands: int) -> Floats:
        """(H, W) variance per band by which a version differs from the estimate nearby: noise, and errors of it."""
        from scipy.ndimage import uniform_filter

        least = np.float32(self.noise[version] ** 2)
        usual = np.where(seen, np.minimum(squares, _NEVER * least * n_bands), 0) / n_bands
        share = uniform_filter(seen.astype(np.float32), _AROUND, mode="constant")
        mean = uniform_filter(usual.astype(np.float32), _AROUND, mode="constant")
        return np.maximum(np.divide(mean, share, out=mean, where=share > 0), least)


def first_estimate(fused: Floats) -> Floats:
    """(H, W, C) median of near pixels, which additions to single pixels do not reach."""
    from scipy.ndimage import median_filter

    return median_filter(fused, (_MEDIAN, _MEDIAN, 1))


def _compared(
    versions: Versions, version: int, noise: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(H, W) where a version alone knows a pixel, and where another confirms what it shows."""
    confirmed = np.zeros(versions.known.shape[:2], np.bool_)
    own = versions.known[:, :, version]
    others = np.zeros_like(confirmed)
    for other in range(versions.n_versions):
        if other != version:
            both = own & versions.known[:, :, other]
            confirmed |= both & ~_disagree(versions, version, other, noise)
            others |= both
    return own & ~others, confirmed


def _disagree(versions: Versions, one: int, other: int, noise: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(H, W) where two versions differ by what noise never does."""
    apart = np.square(versions.bands(one) - versions.bands(other)).sum(axis=2)
    n_bands = np.count_nonzero(versions.version_of == one)
    variance = noise[one] ** 2 + noise[other] ** 2
    return apart > (_NEVER + 2 * n_bands) * variance


def _shares_of_two(versions: Versions, noise: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """(2,) pixels that both versions know, and (2,) the share of these at which they disagree, half of it for each."""
    both = versions.known.all(axis=2)
    n_both = max(int(np.count_nonzero(both)), 1)
    share = np.count_nonzero(both & _disagree(versions, 0, 1, noise)) / n_both
    each = share / 2 if share <= _MOST_OF_TWO else 0.0
    return np.full(2, n_both), np.full(2, each)
