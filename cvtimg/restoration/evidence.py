"""What is known about an image from its versions: their values in place, and how far each is to be trusted where.

Those versions fit that show the same thing at the same place. Fine structure tells: what is left between two blurs,
free of the noise of single pixels and of slow changes of exposure. In windows where two versions have some, what they
differ by is compared with what there is, less noise: next to nothing where they show the same, as much where one is
some pixels off, and twice as much for another picture. And so do levels that are far apart. Exposure and white balance
are a gain and an offset for each band, to the first version, that most windows have.

Those that fit differ by noise alone, except where something was added to one of them (a cosmic ray, dust, a passer-by)
or painted over in it. There a version departs from what it is compared with by more than its noise: at a single pixel
by far, or on the mean of a small window by a little. Nothing is left out where there is no evidence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter, maximum_filter, median_filter, minimum_filter, uniform_filter

from cvtimg._shared.checks import check_choice, check_positive
from cvtimg._shared.choices import AlignName, SpaceName
from cvtimg._shared.messages import warn
from cvtimg._shared.progress import part
from cvtimg._shared.threads import in_stripes, side_by_side
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Indices
from cvtimg.restoration.alignment import MODELS, Alignment
from cvtimg.restoration.alignment import align as align_versions
from cvtimg.restoration.defects import Defects, without_defects
from cvtimg.restoration.noise import Noise, SharedNoise
from cvtimg.restoration.versions import Versions, fill, fuse, trust_in, usual_noise

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


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Versions with the weight of each."""

    given: Versions
    placed: Versions  # all that is known, in place; and what is left of it where versions disagree
    versions: Versions
    alignment: Alignment  # how each version was moved
    misfits: Floats  # (S,): misfit of each version, in place, with the one that most fit
    noise: Noise
    trust: Floats  # (S,): weight of each version, with mean 1
    suspicion: Suspicion | None  # how often versions hold additions; None if nothing else is to be left out
    channels: bool  # whether versions share segments but no colors
    aligned: bool  # whether versions were put in place
    defects: Defects  # impulses and stripes that were taken out of versions

    def variances(self, data: Versions) -> list[float]:
        """Variances of a value of weight 1, as far as known: of the noise, and of the disagreement of versions."""
        known = np.isfinite(self.noise.levels)
        variances = [float((self.trust * self.noise.levels**2)[known].mean())] if known.any() else []
        if not self.channels and (freedom := np.maximum(data.coverage - 1, 0).sum()):
            # Unlike that of the noise, which ignores what is rare, it includes what is painted over in some version.
            (mean, _), weights = fuse(data, self.trust), self.trust * data.known
            apart = sum(np.square(data.bands(s) - mean).sum(axis=2) * weights[:, :, s] for s in range(len(self.trust)))
            variances += [float(apart[data.coverage > 1].sum() / (freedom * mean.shape[2]))]
        return variances or [0.0]

    @property
    def noise_lines(self) -> Floats | None:
        """(C, 2) constant and slope of the variance of noise of weight 1 in each band; None where it is even."""
        if self.noise.lines is None:
            return None
        squares = np.mean(np.square(self.noise.bands), axis=0)
        return self.variances(self.placed)[0] * (squares / squares.mean())[:, None] * self.noise.lines


def prepare(
    given: Versions,
    weights: ArrayLike | None,
    *,
    align: bool | AlignName = False,
    hidden: str | None = None,
    level: float | None = None,
    space: SpaceName = "rgb",
    channels: bool = False,
    white: bool = True,
) -> Evidence:
    """Measure the noise of versions, put them in place, and leave out where they disagree; options as in `restore`."""
    rule = HIDDEN[check_choice("hidden", hidden or "none", HIDDEN)]
    model = check_choice("align", "auto" if align is True else align, ("auto", *MODELS)) if align else None
    level = None if level is None else check_positive("noise", level) * given.level(space)
    if model and given.n_versions == 1:
        warn(f"align={model!r} has nothing to align: there is one version")
    defects = Defects(np.zeros(given.n_versions), np.zeros((given.n_versions, 2)))
    if rule is not HIDDEN["none"] and not channels:
        given, defects = without_defects(given)
    with part(0, 0.4):
        placed, alignment = align_versions(given, model) if model else (given, Alignment.none(given.n_versions))
    if model and not channels:
        tones = exposures(placed)
        given, placed = side_by_side(partial(equalized, tones=tones), (given, placed))
    with part(0.4, 1):  # noise of what was given: interpolation smooths it
        noise_of = partial(Noise.of, level=level, white=white, in_place=model is None and not channels)
        noise = noise_of(given)
    versions, suspicion, apart = placed, None, np.full(given.n_versions, np.nan)
    if not channels:
        usual = usual_noise(placed, noise.levels)
        versions, apart = fitting(placed, usual, noise.shared, aligned=bool(model), hidden=hidden or "none")
        if (told := versions.known.any(axis=(0, 1))).sum() < placed.known.any(axis=(0, 1)).sum():
            noise = noise_of(replace(given, known=given.known & told))  # what others differ from is no noise
    with_noise = partial(replace, lines=noise.lines, whitening=noise.whitening(given.rounding))
    given, placed, versions = map(with_noise, (given, placed, versions))
    if not channels:
        usual = usual_noise(placed, noise.levels)
        versions = rule(versions, usual, moved=bool(model))
        suspicion = Suspicion.of(placed, versions, usual) if hidden == "outliers" else None
    trust = trust_in(given, weights, noise.levels)
    return Evidence(given, placed, versions, alignment, apart, noise, trust, suspicion, channels, bool(model), defects)


def that_tell(versions: Versions, *, quietly: bool = False) -> Versions:
    """Warn of versions that are copies of one before, or of one color where others are not, and leave them out."""
    # The noise of copies is not independent; what is of one color, as through a covered lens, seems to have none.
    reasons, known, seen = dict[int, str](), np.moveaxis(versions.known, 2, 0), dict[int, int]()

    def is_of_one_color(version: int, where: Bools) -> bool:
        values = versions.stack[version][where]
        return not (values != values[:1]).any()

    for number in np.flatnonzero(known.any(axis=(1, 2))).tolist():
        told = hash((versions.bands(number).tobytes(), known[number].tobytes()))
        if (first := seen.setdefault(told, number)) != number:
            reasons[number] = f"is a copy of images[{first}] and counts once"
        elif is_of_one_color(number, known[number]) and not all(
            is_of_one_color(other, known[number] & known[other]) for other in range(len(known))
        ):
            reasons[number] = "is of one color where others are not and is left out"
    if reasons and not quietly:
        warn("; ".join(f"images[{number}] {reason}" for number, reason in reasons.items()))
    is_left = ~np.isin(np.arange(len(known)), [*reasons])
    return replace(versions, known=versions.known & is_left) if reasons else versions


# --- which versions fit


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
    left = [power - rest for power, rest in zip(powers, noisy, strict=True)]
    loud = [np.append(0, power[np.isfinite(power)]) for power in left]
    least = [max(rest, _POWER * np.quantile(power, 0.75)) for power, rest in zip(loud, noisy, strict=True)]
    apart_by = np.zeros((n, n))
    for first, other in combinations(range(n), 2):
        both = structure[first][1] & structure[other][1]
        tells = (left[first] > least[first]) & (left[other] > least[other])
        tells &= np.isfinite(_means(structure[first][0], both))
        if not tells.any():
            continue
        ours, theirs = left[first], left[other]
        gain = np.median((theirs / ours)[tells])  # of a longer exposure
        with np.errstate(invalid="ignore"):
            tells &= np.abs(np.log(gain * ours / theirs)) < _ALIKE
        if (n_windows := np.count_nonzero(tells)) >= _FEW:
            apart = _means(np.square(structure[first][0] * np.float32(np.sqrt(gain)) - structure[other][0]), both)
            parts = 2 * (apart - gain * noisy[first] - noisy[other]) / (gain * ours + theirs)
            misfit = max(np.median(parts[tells]), 0)
            if n_windows >= _ENOUGH or misfit > 1:
                apart_by[first, other] = apart_by[other, first] = misfit
    return apart_by


def _apart_in_levels(versions: Versions, noise: Floats) -> Floats:
    """(S, S) misfit of the levels of versions, as of a dark frame or of a short exposure."""
    # Above `MOST_MISFIT` levels differ by more than a quarter of their variance and than the noise of both: leaving out
    # the other version costs less than taking it.
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
    known = versions.known[:, :, version]
    inner = uniform_filter(known.astype(np.float32), 3) > 0.5
    gray = fill(versions.bands(version).mean(axis=2, keepdims=True), known.astype(np.float32))[:, :, 0]
    return _between_blurs(gray), inner


def _between_blurs(image: Array) -> Array:
    """(H, W) structure of an image, without single outliers."""
    image = median_filter(image, 3)
    return gaussian_filter(image, 1) - gaussian_filter(image, 4)


def _means(values: Array, known: Bools) -> Floats:
    """(T,) mean of known values in each window; NaN where too few are known."""
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
    if len(numbers := np.flatnonzero(apart > MOST_MISFIT).tolist()):
        names = ", ".join(f"images[{number}]" for number in numbers)
        values = ", ".join(f"{apart[number]:.2f}" for number in numbers)
        is_left = hidden == "none"
        done = "may spoil the result" if is_left else ("is" if len(numbers) == 1 else "are") + " left out"
        why = "no alignment was found" if aligned else "align=True moves them into place, and to its levels"
        most = f"misfit {values}, at most {MOST_MISFIT}"
        warn(f"{names} cannot be laid over images[{reference}] and {done}: {most}; {why}")
        versions = replace(versions, known=versions.known & (is_left | (apart <= MOST_MISFIT)))
    return versions, apart


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
    first, *others = side_by_side(partial(_levels, placed), range(placed.n_versions))

    def fit(number: int) -> None:
        both = np.flatnonzero(np.isfinite(first + others[number]).all(axis=1))
        if len(both) >= _TOLD[0]:
            both = both[:: -(-len(both) // _TOLD[1])]
            lines = [*side_by_side(_line, [*zip(others[number][both].T, first[both].T, strict=True)])]
            if not any(line is None for line in lines):
                tones[number + 1] = lines

    list(side_by_side(fit, range(len(others))))
    return tones


def _levels(versions: Versions, version: int) -> Floats:
    """(T, C) means of the known pixels of windows; NaN where few are known or some are clipped."""
    values, known = versions.bands(version), versions.known[:, :, version]
    means = np.stack([*side_by_side(lambda band: _means(values[:, :, band], known), range(values.shape[2]))], axis=1)
    if versions.white is not None:
        for clipped, most in zip((values <= 0, values >= versions.white), _CLIPPED, strict=True):
            means[_means(np.any(clipped, axis=2), known) >= most] = np.nan
    return means


def _line(pairs: tuple[Floats, Floats]) -> tuple[float, float] | None:
    """Gain and offset from values to those wanted, most of which are on a line; None if they are on none."""
    from scipy.stats import theilslopes

    values, wanted = pairs
    if min(np.ptp(values), np.ptp(wanted)) == 0:
        return None
    # What is left of noise and of motion, in both, biases the slope of a regression of either on the other alike.
    slopes = [*side_by_side(lambda pair: theilslopes(*pair).slope, [(wanted, values), (values, wanted)])]
    gain = float(np.sqrt(max(slopes[0], 0) / slopes[1])) if slopes[1] > 0 else 0.0
    offset = float(np.median(wanted - gain * values))
    scale = 1.4826 * np.median(np.abs(gain * values + offset - wanted))
    return (gain, offset) if scale**2 < _LEFT * np.var(wanted) and 1 / _LARGEST < gain < _LARGEST else None


def equalized(versions: Versions, tones: Floats) -> Versions:
    """Bring versions to the levels of the first; what longer exposures show near white is unknown."""
    known, most = versions.known.copy(), (1 - _NEAR_WHITE) * (versions.white or np.inf)
    for version in np.flatnonzero((tones[:, :, 0] < _LONGER).any(axis=1)):
        mean = uniform_filter(versions.bands(int(version)), (5, 5, 0))
        known[:, :, version] &= (mean < most).all(axis=2)
    return replace(versions, known=known, tones=tones)


# --- which versions to leave out at a pixel


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
        slack = np.zeros(1, np.float32)
        if moved:  # the range of the pixels within 3 x 3; 0 where one is unknown
            slack = maximum_filter(reference, (3, 3, 1)) - minimum_filter(reference, (3, 3, 1))
            slack = _SLACK * np.nan_to_num(slack)
        apart = (self.apart(version, reference) for version in range(len(self.values)))
        return np.stack([self.departs(off - np.clip(off, -slack, slack), s, scales[s]) for s, off in enumerate(apart)])

    def departs(self, residual: Floats32, version: int, scales: Floats32) -> Bools:
        """(h, W) where a version departs by a residual, (h, W, C), by more than noise would."""
        # `scales` are (sides, C) standard deviations of the noise of the mean in windows of these sides.
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
            # What a band differs by nearby: noise, and errors of the estimate.
            least = np.float32(self.noise[version] ** 2)
            usual = np.where(own, np.minimum(squares, _RARE**2 * least * n_bands), 0) / n_bands
            known_near, mean = (uniform_filter(of.astype(np.float32), 5, mode="constant") for of in (own, usual))
            variance = np.maximum(np.divide(mean, known_near, out=mean, where=known_near > 0), least)
            room = np.log(np.maximum(span**2 / (2 * np.pi * variance), 1))
            likelier = np.log((1 - share) / share) + n_bands / 2 * room
            known[:, :, version] &= confirmed | (squares <= 2 * likelier * variance)
        return replace(versions, known=known)
