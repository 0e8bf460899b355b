"""Which versions to leave out at a pixel: what was added to one of them, or what hides an object in it.

Versions of one picture differ by noise alone, except where something was added to one of them (a cosmic ray, dust, a
passer-by) or painted over in it. There a version departs from what it is compared with by more than its noise: at a
single pixel by far, or on the mean of a small window by a little. Everything is measured against the noise, so nothing
is left out where there is no evidence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cvtimg._shared.threads import in_stripes, side_by_side
from cvtimg._shared.types import Bools, Floats, Floats32, Indices
from cvtimg.restoration.versions import Versions

#: Sides of the windows on whose mean a version may depart; 1 is the pixel itself.
_SIDES = (1, 3, 5)
#: Standard deviations of a Gaussian that one of 100,000 pixels exceeds.
_RARE = 4.3
#: Share of known pixels from which on a window is judged; and of those about a pixel that depart, with which it does.
_FULL, _MANY = 0.3, 0.6
#: Side of windows of which a larger share departs where something moved; and the part of the range of the pixels about
#: by which versions that were moved may differ.
_MOVED, _SLACK = (7, 0.2), 0.5
#: Share of additions below which they are chance, and pixels that enough versions know, to measure it.
_SHARE, _JUDGED = 1e-3, 256


def without_outliers(versions: Versions, noise: Floats, *, moved: bool = False) -> Versions:
    """Leave out each version where it departs from the median of all, which the majority decides."""
    # Versions that were `moved` show what is finer than the pixels differently, each at its place: where the median
    # varies from pixel to pixel, so may they.
    # Only pixels that three or more versions know can be judged. Where all depart, as where two versions stand against
    # two, nothing is left out. `noise`, (S,), is the standard deviation of the noise of each version, > 0.
    if versions.n_versions < 3 or versions.coverage.max() < 3:
        return versions
    sample = _sample(versions)
    # The median departs from a quiet version where the noise of most others does, together.
    others = np.sort([np.delete(noise, version) for version in range(len(noise))], axis=1)
    together = 1 / np.sqrt(np.sum(others[:, -((len(noise) + 1) // 2) :] ** -2.0, axis=1))
    scales = _scales(sample, sample.median, sample.known.sum(axis=0) >= 3, np.maximum(noise, together))

    def kept(part: _Part) -> Bools:
        departing = part.departing(part.median, scales, moved=moved) & (part.known.sum(axis=0) >= 3)
        return part.known & ~(departing & (part.known & ~departing).any(axis=0))

    return _in_bands(versions, kept)


def without_motion(versions: Versions, noise: Floats, *, moved: bool = False) -> Versions:
    """Leave out each version where it departs from the first, as it does where something moved by itself."""
    from scipy.ndimage import uniform_filter

    sample, (side, some) = _sample(versions), _MOVED
    scales = _scales(sample, sample.values[0], sample.known[0], np.hypot(noise, noise[0]))

    def kept(part: _Part) -> Bools:
        departing = part.departing(part.values[0], scales, moved=moved) & part.known[0]
        # What moves agrees with what is behind it at some pixels, by chance.
        share = uniform_filter(departing.astype(np.float32), (0, side, side), mode="constant")
        return part.known & ~(departing | (share > some))

    return _in_bands(versions, kept)


def without_background(versions: Versions, noise: Floats, *, moved: bool = False) -> Versions:
    """Leave out each version that shows the background where another shows something else."""
    # Everything that any version shows is then kept, even if others hide it: the union of all. The background is the
    # most frequent color: the mean of the fullest of boxes, as many for each channel.
    boxes, known = 16, np.moveaxis(versions.known, 2, 0)
    rows = np.concatenate([versions.bands(s)[inside] for s, inside in enumerate(known)])
    low, high = rows.min(axis=0), rows.max(axis=0)
    places = np.minimum((rows - low) * (boxes / np.maximum(high - low, 1e-30)), boxes - 1).astype(np.int64)[:, :3]
    number = places @ boxes ** np.arange(places.shape[1])
    background = rows[number == np.bincount(number).argmax()].mean(axis=0)
    scales = np.repeat((noise[:, None] / _SIDES)[:, :, None], len(background), axis=2).astype(np.float32)

    def kept(part: _Part) -> Bools:
        shown = np.stack([part.departs(part.values[s] - background, s, scales[s]) for s in range(len(scales))])
        return part.known & (shown | ~(part.known & shown).any(axis=0))

    return _in_bands(versions, kept)


#: The registry: names for `hidden` and ``--hidden``; none keeps all that is known.
HIDDEN: dict[str, Callable[..., Versions]] = {
    "outliers": without_outliers,
    "background": without_background,
    "motion": without_motion,
    "none": lambda versions, noise, *, moved=False: versions,
}


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Some rows of all versions: (S, h, W, C) values, and (S, h, W) which of them are known."""

    values: Floats32
    known: Bools
    versions: Versions

    @classmethod
    def of(cls, versions: Versions, rows: slice | Indices) -> _Part:
        """Take some rows."""
        values = np.stack([versions.bands(version, rows) for version in range(versions.n_versions)])
        return cls(values, np.moveaxis(versions.known[rows], 2, 0), versions)

    def apart(self, version: int, reference: Floats32) -> Floats32:
        """(h, W, C) departure of a version from a reference, in units in which noise is even."""
        return (self.values[version] - reference) / np.sqrt(self.versions.noisiness(reference))[:, :, None]

    @property
    def is_cut_off(self) -> Bools:
        """(h, W) where a version is clipped, so that it differs by less than noise, or in some bands alone."""
        if self.versions.white is None:
            return np.zeros(self.known.shape[1:], np.bool_)
        ends = ((self.values <= 0) | (self.values >= self.versions.white)).any(axis=3)
        return np.asarray((ends & self.known).any(axis=0))

    @property
    def median(self) -> Floats32:
        """(h, W, C) median of what is known of each pixel; NaN where nothing is."""
        ordered = np.sort(np.where(self.known[..., None], self.values, np.float32(np.nan)), axis=0)
        count = self.known.sum(axis=0)[None, :, :, None]
        low, high = np.maximum((count - 1) // 2, 0), np.minimum(count // 2, len(ordered) - 1)
        return (np.take_along_axis(ordered, low, 0) + np.take_along_axis(ordered, high, 0))[0] / 2

    def departing(self, reference: Floats32, scales: Floats32, *, moved: bool) -> Bools:
        """(S, h, W) where each version departs from a reference, (h, W, C)."""
        from scipy.ndimage import maximum_filter, minimum_filter

        slack = np.zeros(1, np.float32)
        if moved:  # the range of the pixels within 3 x 3; 0 where one is unknown
            slack = maximum_filter(reference, (3, 3, 1)) - minimum_filter(reference, (3, 3, 1))
            slack = _SLACK * np.nan_to_num(slack)
        apart = (self.apart(version, reference) for version in range(len(self.values)))
        return np.stack([self.departs(off - np.clip(off, -slack, slack), s, scales[s]) for s, off in enumerate(apart)])

    def departs(self, residual: Floats32, version: int, scales: Floats32) -> Bools:
        """(h, W) where a version departs by a residual, (h, W, C), by more than noise would."""
        # `scales` are (sides, C) standard deviations of the noise of the mean in windows of these sides.
        from scipy.ndimage import uniform_filter
        from scipy.stats import chi2, norm

        known = self.known[version] & np.isfinite(residual[..., 0])
        residual = self.versions.even(np.where(known[..., None], residual, np.float32(0)), self.is_cut_off)
        rare = chi2.isf(norm.sf(_RARE), residual.shape[2])
        alone = np.square(residual / scales[0]).sum(axis=2)
        departing = alone > rare
        for side, scale in zip(_SIDES[1:], scales[1:], strict=True):
            share = uniform_filter(known.astype(np.float32), side, mode="constant")
            sums = uniform_filter(residual, (side, side, 0), mode="constant")
            mean = np.divide(sums, share[..., None], out=sums, where=share[..., None] > 0)
            # Beside what was added the mean departs too: the pixel itself must be likelier with it than without.
            likelier = np.square((residual - mean) / scales[0]).sum(axis=2) < alone
            departing |= (share * np.square(mean / scale).sum(axis=2) > rare) & likelier & (share >= _FULL)
        # A pixel among those that depart is taken to depart too: noise alone has brought it back.
        around = uniform_filter(departing.astype(np.float32), 3, mode="constant")
        departing |= around > _MANY * uniform_filter(known.astype(np.float32), 3, mode="constant")
        return departing & known


def _in_bands(versions: Versions, kept: Callable[[_Part], Bools], most: int = 1 << 18) -> Versions:
    """Judge bands of rows, of about `most` values, each with the rows around it that windows reach."""
    height, width = versions.known.shape[:2]
    halo, step = max(_SIDES) // 2 + 1 + _MOVED[0] // 2, max(1, most // (width * versions.n_versions))
    known = versions.known.copy()

    def judge(rows: slice) -> None:
        above = max(rows.start - halo, 0)
        part = kept(_Part.of(versions, slice(above, rows.stop + halo)))
        known[rows] = np.moveaxis(part[:, rows.start - above : rows.stop - above], 0, 2)

    in_stripes(judge, height, work=256.0 * known.size, n=step)
    return replace(versions, known=known)


def _sample(versions: Versions, most: int = 1 << 20, rows: int = 32) -> _Part:
    """Return rows that tell the usual departure: all, or bands of a large picture."""
    height, width = versions.known.shape[:2]
    tops = np.linspace(0, height - rows, max(most // (width * versions.n_versions * rows), 1)).astype(np.intp)
    return _Part.of(versions, np.unique(np.clip(tops[:, None] + np.arange(rows), 0, height - 1)))


def _scales(part: _Part, reference: Floats32, judged: Bools, noise: Floats) -> Floats32:
    """(S, sides, C) standard deviations by which the means of versions in windows depart from a reference anyway."""
    # That is its noise, or more where versions differ all over: in exposure, or because they do not line up. About the
    # median of three or more versions, .88 of the noise is left.
    from scipy.ndimage import uniform_filter

    is_cut_off = part.is_cut_off

    def scale(version: int) -> Floats32:
        seen = judged & part.known[version] & ~is_cut_off
        residual = np.where(part.known[version][..., None], part.apart(version, reference), np.float32(0))
        residual = part.versions.even(np.nan_to_num(residual), is_cut_off)
        means = [uniform_filter(residual, (side, side, 0))[seen] for side in _SIDES]
        usual = [np.median(np.abs(mean), axis=0) / (0.6745 * 0.88) if len(mean) else mean.sum(axis=0) for mean in means]
        return np.maximum((noise[version] / _SIDES)[:, None], usual).astype(np.float32)

    return np.stack([*side_by_side(scale, range(len(part.values)))])


# --- where the majority of versions cannot tell
# Where three versions know a pixel, the majority finds what was added to one of them. How often that happens tells how
# often it happens elsewhere. There, a value is left out if it is more likely to be an addition, which may have any
# color, than the estimated image plus noise. Without evidence of additions nothing is left out, however poor the
# estimate.


@dataclass(frozen=True, slots=True, eq=False)
class Suspicion:
    """How often versions hold additions."""

    shares: Floats  # (S,): share of the pixels of each version that hold an addition; 0 without evidence
    noise: Floats  # (S,): standard deviation of the noise of each version

    @classmethod
    def of(cls, versions: Versions, kept: Versions, noise: Floats) -> Suspicion | None:
        """Measure how often the majority of `versions` has left each out of those `kept`; None if never."""
        judged = (versions.coverage >= 3)[:, :, None] & versions.known
        n_judged = np.count_nonzero(judged, axis=(0, 1))
        shares = np.count_nonzero(judged & ~kept.known, axis=(0, 1)) / np.maximum(n_judged, 1)
        evident = (shares > _SHARE) & (n_judged >= _JUDGED)
        return cls(np.where(evident, np.minimum(shares, 0.5), 0.0), noise) if evident.any() else None

    def first_kept(self, versions: Versions, fused: Floats32) -> Versions:
        """Leave out what the median of near pixels does not explain, which additions to single pixels do not reach."""
        from scipy.ndimage import median_filter

        return self.kept(versions, median_filter(fused, (3, 3, 1)))

    def kept(self, versions: Versions, estimate: Floats32) -> Versions:
        """Leave out values of suspected versions that the estimate and its errors nearby do not explain."""
        known, span = versions.known.copy(), max(float(np.ptp(estimate)), 1e-30)
        n_bands = estimate.shape[2]
        for version in np.flatnonzero(self.shares):
            values, own = versions.bands(int(version)), versions.known[:, :, version]
            is_cut_off = np.asarray(versions.cut_off(int(version)).any(axis=2))
            confirmed = np.zeros_like(own)
            for other in (number for number in range(versions.n_versions) if number != version):
                apart = np.square(versions.even(values - versions.bands(other), is_cut_off)).sum(axis=2)
                apart /= versions.noisiness(values)
                variance = self.noise[version] ** 2 + self.noise[other] ** 2
                confirmed |= versions.known[:, :, other] & (apart <= (_RARE**2 + 2 * n_bands) * variance)
            # Of versions that disagree here, one holds an addition.
            share = np.where(versions.coverage == 1, self.shares[version], 0.5)
            squares = np.square(versions.even(values - estimate, is_cut_off)).sum(axis=2) / versions.noisiness(estimate)
            variance = self._variance(int(version), squares, own, n_bands)
            room = np.log(np.maximum(span**2 / (2 * np.pi * variance), 1))
            likelier = np.log((1 - share) / share) + n_bands / 2 * room
            known[:, :, version] &= confirmed | (squares <= 2 * likelier * variance)
        return replace(versions, known=known)

    def _variance(self, version: int, squares: Floats32, seen: Bools, n_bands: int, around: int = 5) -> Floats32:
        """(H, W) variance per band by which a version differs from the estimate nearby: noise, and errors of it."""
        from scipy.ndimage import uniform_filter

        least = np.float32(self.noise[version] ** 2)
        usual = np.where(seen, np.minimum(squares, _RARE**2 * least * n_bands), 0) / n_bands
        share = uniform_filter(seen.astype(np.float32), around, mode="constant")
        mean = uniform_filter(usual.astype(np.float32), around, mode="constant")
        return np.maximum(np.divide(mean, share, out=mean, where=share > 0), least)
