"""What noise versions have: its level, how that follows the level of the picture, and what near pixels share of it.

Texture and edges show in the part of a patch that is even about its center and in the odd part alike. The two parts of
noise, which is alike all over, know nothing of each other. So patches with a quiet odd part tell what noise is in even
parts, and the other way round: to choose by one and to measure in the other takes no noise away, and is our own. In
doubt there is less noise. The level is that of the least eigenvalues of the covariance of patches: G. Chen, F. Zhu, P.
A. Heng, ICCV 2015, doi 10.1109/ICCV.2015.62.
That is noise in every direction of bands. White noise that bands share has more along some axes, and the same power in
all waves, where texture has less the finer they are; so what texture adds is told apart, and that is our own, too.
Where pixels are missing one by one, only patches of few pixels are whole. What versions in place differ by has no
texture in it; it tells how noise follows the level of the picture, and what bands and near pixels share.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import dct
from scipy.ndimage import uniform_filter

from cvtimg._shared.progress import each
from cvtimg._shared.threads import side_by_side
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Indices
from cvtimg.restoration.versions import Clipped, Versions, fill

#: Sides of patches, of which the largest is taken that has enough for chance not to make their covariance: this number
#: for each of their values. The last number is that of the pixels that are looked at, about.
_SIDES, _PER_VALUE, _MOST = (8, 4, 3, 2), 10, 1 << 20
#: Shares of patches that are quiet, of many and of few; fewer than 80 for each band tell nothing. Along an axis,
#: others have at most 3 times their power: the rest is texture. Shares between which those lie that tell how it grows.
_QUIET, _OF_FEW, _FEWEST, _AGAIN, _GROWING = 0.1, 0.25, 80, 3.0, (0.2, 0.5)
#: Share of values at an end of the levels from which on a patch is cut off; a block; and, where most patches have a
#: smaller one, but all have some, one that tells what bands share.
_CUT_OFF = (0.02, 0.1, 0.2)
#: Classes of levels, in each of which noise is measured, and the chance with which even noise is taken to follow them.
_CLASSES, _CHANCE = 8, 1e-3
#: Blocks whose spectra tell what near pixels share: their side, which has room for a window and the lags, up to the
#: last; and shares of them, from quiet to loud, that end groups.
_BLOCK, _GROUPS, _LAGS = 16, (0.03, 0.1, 0.25), 6
#: Texture is, in each of the rings of frequencies (12 for a cycle per pixel), three times what grows from the first to
#: the third group by more than chance; and all that bands have in common, if that is such a part of what is not white
#: and does not fall as many times to twice, and again to three times, the frequency below, as grain of .6 pixels does.
_RINGS, _TIMES, _GROWS, _COMMON = 12, 3.0, 1.1, 0.9
#: Noise is shared where it has twice the power of white noise from this frequency on, below which texture
#: prevails, and this part of the range of levels, for a picture may have less of its own.
_POWER, _HIGH, _GRAIN = 2.0, 0.2, 0.01


@dataclass(frozen=True, slots=True, eq=False)
class SharedNoise:
    """Noise with one autocovariance everywhere; whitening patches by it makes it that for which the filters are."""

    #: (2 L + 1, 2 L + 1, C, C): covariance of the bands of a pixel with those of another, by their distance
    autocovariance: Floats

    @classmethod
    def of(cls, noise: Floats) -> SharedNoise:
        """Measure (H, W, C) noise that goes on at its other end."""
        waves = np.fft.rfft2(noise, axes=(0, 1))
        powers = np.einsum("xyi,xyj->xyij", waves, waves.conj()) / noise[:, :, 0].size
        return cls(_near(powers, noise.shape[:2]))

    @classmethod
    def white(cls, covariance: Floats) -> SharedNoise:
        """Noise of which pixels share nothing, and the bands of a pixel what their covariance, (C, C), tells."""
        return cls(np.pad(covariance[None, None], ((_LAGS, _LAGS), (_LAGS, _LAGS), (0, 0), (0, 0))))

    @property
    def bands(self) -> Floats:
        """(C, C) covariance of the bands of a pixel."""
        return np.asarray(self.autocovariance[_LAGS, _LAGS])

    @property
    def neighbors(self) -> float:
        """Correlation of pixels next to each other in a row."""
        return float(np.trace(self.autocovariance[_LAGS, _LAGS + 1]) / np.trace(self.bands))

    def along(self, matrix: Floats) -> SharedNoise:
        """Noise of bands times a matrix, (C, D)."""
        return SharedNoise(matrix.T @ self.autocovariance @ matrix)


def _near(powers: Floats, sides: tuple[int, ...]) -> Floats:
    """(2 L + 1, 2 L + 1, C, C) autocovariance of what has powers, (X, Y, C, C), of waves over sides of pixels."""
    lags = np.ix_(*(np.arange(-_LAGS, _LAGS + 1),) * 2)
    return np.asarray(np.fft.irfft2(powers, sides, axes=(0, 1))[lags])


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """The noise of versions."""

    bands: list[Floats]  # (C,) of each version: standard deviation in each band; NaN where unknown
    shared: SharedNoise | None = None  # what pixels share of the noise of weight 1; None if it is white
    lines: Floats | None = None  # (C, 2): relative variance by level, as constant and slope; None if it is even
    is_seen: bool = True  # whether any version has noise that can be seen, or that was given

    @property
    def levels(self) -> Floats:
        """(S,) standard deviations in each version, root mean square over bands."""
        return np.array([np.sqrt(np.mean(np.square(sigmas))) for sigmas in self.bands])

    def whitening(self, least: float) -> Floats | None:
        """(C, C) matrix after which bands share no noise of a pixel, with as much in all; None if they share none."""
        # `least` is a standard deviation that noise is not taken to be below, in any direction.
        if self.shared is None or not _is_shared(self.shared.bands):
            return None
        squares, axes = np.linalg.eigh(self.shared.bands)
        squares = np.maximum(squares, least**2)
        return np.asarray((axes * np.sqrt(squares.mean() / squares)) @ axes.T)

    @classmethod
    def of(cls, versions: Versions, *, level: float | None = None, white: bool = True, in_place: bool = True) -> Noise:
        """Measure the noise of versions, where it is not given; `white`: even and not shared."""
        # Versions are as they came: interpolation would smooth their noise.
        versions, _ = versions.distinct()
        squares, shared = _covariances(versions, in_place=in_place), None
        bands = [np.sqrt(np.diag(covariance)) for covariance in squares]
        levels = cls(bands).levels
        is_seen, told = levels > versions.unseen, levels[levels > 0]
        variance = float(np.mean(told**2)) if len(told) else 0.0
        ratios = levels / np.sqrt(variance) if variance else np.ones_like(levels)
        across = _mean_of(squares, ratios)
        if not white:
            if is_seen.all() and (line := lines_of(versions, in_place=in_place, across=across)):
                versions = replace(versions, lines=line[0])
                bands = [np.sqrt(line[1]) * ratio for ratio in ratios]
                if _is_shared(across):
                    across = _mean_of(_covariances(versions, in_place=in_place), ratios)
            shared = shared_noise(versions, in_place=in_place)
            pairs = [*zip(versions.roundings, versions.stack, strict=False)]
            lost = [lost for rounding, values in pairs if rounding and (lost := rounding.lost(values)) is not None]
            # What JPEG files have lost is noise, too; what versions in place differ by has it already. The nearer it is
            # to what is seen in power, the more of that it is: noise about as large as the steps has been rounded.
            if lost and (not in_place or versions.n_versions == 1):
                rounded = np.sum([SharedNoise.of(part).autocovariance for part in lost], axis=0) / len(levels)
                seen = (shared or SharedNoise.white(variance * np.eye(lost[0].shape[2]))).autocovariance
                less, more = sorted(float(np.trace(noise[_LAGS, _LAGS])) + 1e-30 for noise in (seen, rounded))
                shared = SharedNoise((seen + rounded) * ((more + less * (1 - less / more)) / (more + less)))
        if _is_shared(across) and (shared is None or np.trace(shared.bands) < np.trace(across)):
            shared = SharedNoise.white(across)  # else texture would give it neighbors
            bands = [np.sqrt(np.diag(across)) * ratio for ratio in ratios]
        elif shared:  # the level of white noise tells little of its bands, and of versions whose difference has it
            bands = [np.sqrt(np.diag(shared.bands)) * (1 if in_place else ratio) for ratio in ratios]
        _Look.of.cache_clear()
        if level is not None:
            bands = [np.full(len(covariance), level) for covariance in bands]
        return cls(bands, shared, versions.lines, bool(is_seen.any()) or shared is not None or level is not None)


def _mean_of(squares: list[Floats], ratios: Floats) -> Floats:
    """(C, C) mean covariance of versions, (C, C) each, whose noise has ratios, (S,)."""
    told = [covariance / ratio**2 for covariance, ratio in zip(squares, ratios, strict=True) if ratio > 0]
    are_alike = len({covariance.shape for covariance in squares}) == 1  # channels may have other bands
    return np.asarray(np.mean(told, axis=0) if told and are_alike else np.zeros_like(squares[0]))


def _is_shared(covariance: Floats) -> bool:
    """Tell whether bands share noise of a covariance, (C, C)."""
    return bool(np.tril(covariance, -1).any())


# --- what noise shows in


@dataclass(frozen=True, eq=False)
class _Look:
    """What noise is measured in."""

    values: Floats32  # (H, W, C): noise, even if its lines are known, and the image unless versions were subtracted
    image: Floats32  # (H, W, C): the image
    lost: Floats32  # (H, W): share of the bands that are cut off; infinite where nothing is known
    has_texture: bool  # False where versions were subtracted
    white: float | None  # where values end, if pixels are missing, so that few patches are whole

    @staticmethod
    @lru_cache(maxsize=1)  # all that is measured of a single version has the same
    def of(versions: Versions, *numbers: int) -> _Look:
        """Take one version, or what two of them differ by."""
        bands = [versions.bands(number) for number in numbers]
        image = bands[0] if len(bands) == 1 else np.mean(bands, axis=0)
        values = image if len(bands) == 1 else np.subtract(*bands) * np.float32(np.sqrt(0.5))
        lost = np.max([versions.cut_off(number).mean(axis=2, dtype=np.float32) for number in numbers], axis=0)
        known = np.asarray(versions.known[:, :, numbers].all(axis=2))
        lost[~known] = np.inf
        if len(bands) == 1 and not known.all():  # for what a few holes may be in
            values = image = fill(np.where(known[:, :, None], image, np.float32(0)), known.astype(np.float32))
        if versions.lines is not None:
            spread = np.sqrt(versions.noisiness(uniform_filter(image, (5, 5, 0))))[:, :, None]
            values = np.divide(values, spread, dtype=np.float32)
        white = versions.white if versions.lines is None and np.isinf(lost).any() else None
        return _Look(values, image, lost, len(bands) == 1, white)

    def patches(self, *sides: int, per_value: int = _PER_VALUE, most: float = 0.0) -> tuple[Floats, Floats] | None:
        """(N, side, side, C) patches of the first side of which enough are whole, and their levels, (N, C)."""
        parts = self.values, self.image, self.lost
        for side in sides or _SIDES:
            if min(self.lost.shape) >= side:
                some = slice(None, None, int(np.ceil(side * np.sqrt(self.lost.size / _MOST))))
                values, image, lost = (sliding_window_view(part, (side, side), (0, 1))[some, some] for part in parts)
                holes, cut_off = np.isinf(lost).mean(axis=(2, 3)), max(_CUT_OFF[side > _SIDES[0]], most)
                share = (np.minimum(lost, 1) if most else lost).mean(axis=(2, 3))
                if self.white and not sides and side < _SIDES[0]:  # too few are not cut off, by chance
                    cut_off = _CUT_OFF[int(np.median(np.append(share[share <= _CUT_OFF[1]], 0)) > cut_off)]
                inside, enough = share <= cut_off, max(per_value * values[0, 0].size, _FEWEST)
                if np.count_nonzero(inside) >= max(enough, (most > 0) * inside.size / 2):
                    patches = np.moveaxis(values[inside], 1, 3).astype(np.float64)
                    patches /= np.sqrt(1 - holes[inside])[:, None, None, None]  # which are filled without noise
                    bands = [image[:, :, band] for band in range(image.shape[2])]
                    return patches, np.stack([*side_by_side(partial(_means_of, inside), bands)], axis=1)
        return None

    @cached_property
    def levels(self) -> Floats:
        """(C,) standard deviation of the noise in each band; NaN where too little is known or all is cut off."""
        measured = self.patches()
        levels = np.full(self.values.shape[2], np.nan) if measured is None else _levels_in(measured[0])
        if measured is not None and self.white and measured[0].shape[1] < _SIDES[0]:
            means, sigmas = (values.astype(np.float32) for values in (measured[1], levels + 1e-3))
            levels /= np.sqrt(Clipped.of(means, sigmas, self.white).variance.mean(axis=0))
        return levels


def _means_of(inside: Bools, patches: Floats32) -> Floats:
    """(N,) means of the patches, (H, W, side, side), that are inside, (H, W)."""
    return np.asarray(patches[inside].mean(axis=(1, 2), dtype=np.float64))


def _looks(versions: Versions, *, in_place: bool) -> list[tuple[int, ...]]:
    """Numbers of the versions that show the noise alone, or two and two if they are `in_place`."""
    numbers = np.flatnonzero(versions.known.any(axis=(0, 1))).tolist()
    return list(pairwise(numbers)) if in_place and len(numbers) > 1 else [(number,) for number in numbers]


def _halves_of(patches: Floats) -> tuple[Floats, Floats]:
    """(N, P / 2) even and odd parts of patches, (N, side, side, C), about their centers."""
    rows = patches.reshape(len(patches), -1, patches.shape[3])
    half = rows.shape[1] // 2
    first, other = (part.reshape(len(patches), -1) for part in (rows[:, :half], rows[:, : -half - 1 : -1]))
    return (first + other) / np.sqrt(2), (first - other) / np.sqrt(2)


def _order_of(halves: Floats) -> Indices:
    """(N,) patches from quiet to loud, where each direction counts by what is usual in it."""
    rows = halves - halves.mean(axis=0)
    squares = np.square(rows @ np.linalg.eigh(rows.T @ rows)[1])
    usual = np.median(squares.T.copy(), axis=1, overwrite_input=True)  # 0 where most are flat, as drawings are
    return np.argsort((squares / np.maximum(usual, 1e-9 * usual.max() + 1e-30)).sum(axis=1), kind="stable")


# --- the level, and what bands share


def _covariances(versions: Versions, *, in_place: bool) -> list[Floats]:
    """(C, C) covariance of the noise of the bands of each version; NaN where too little is known."""
    numbers = range(versions.n_versions)
    measured = side_by_side(lambda number: _covariance_of(versions, number), numbers)
    alone = [covariance for _, covariance in zip(each(numbers), measured, strict=True)]
    seen = [s for s in np.flatnonzero(versions.known.any(axis=(0, 1))).tolist() if np.isfinite(alone[s]).all()]
    if len(alone[0]) == 1 or len(seen) < 2 or not in_place:
        return alone
    # What versions in place differ by has no texture, and tells more if bands share noise.
    pairs = [*pairwise(seen), *([(seen[0], seen[-1])] if len(seen) > 2 else [])]
    apart = [*side_by_side(lambda pair: _covariance_of(versions, *pair), pairs)]
    told = [(pair, half) for pair, half in zip(pairs, apart, strict=True) if np.isfinite(half).all() and half.any()]
    mean = np.mean([half for _, half in told], axis=0) if told else np.eye(1)
    if not _is_shared(mean):
        return [np.diag(np.diag(covariance)) for covariance in alone]
    # Each alone tells how much of it is its own; NaN of one that tells nothing must not reach the others.
    traces = np.fmax([np.trace(covariance) for covariance in alone], 1e-9)
    traces *= sum(np.trace(half) for _, half in told) / sum(traces[[*pair]].mean() for pair, _ in told)
    return [mean * (trace / np.trace(mean)) if s in seen else alone[s] for s, trace in enumerate(traces)]


def _covariance_of(versions: Versions, *numbers: int) -> Floats:
    """(C, C) covariance of the noise of bands, of a version or of half of what two differ by; NaN where unknown."""
    look = _Look.of(versions, *numbers)
    squares = np.diag(np.square(look.levels))
    if look.has_texture and not squares.any():  # flat patches, as of drawings: axes would hang on rounding
        return squares
    large = look.patches(_SIDES[0], per_value=1)
    if look.has_texture and len(squares) > 1 and (large is None or _QUIET * len(large[0]) < _FEWEST):
        large = look.patches(_SIDES[0], per_value=1, most=min(_CUT_OFF[2] + float(np.isinf(look.lost).mean()), 0.5))
    if large is not None and _QUIET * len(large[0]) >= _FEWEST and np.isfinite(squares).all():
        axes, powers = _flat(large[0], squares)
    elif look.has_texture or large or np.count_nonzero(look.lost == 0) < _FEWEST * len(squares):
        return squares
    else:  # few patches are whole, but there is no texture; medians of what is known pass over spikes
        # R. Gnanadesikan, J. R. Kettenring, Biometrics 28 (1972) 81-124, doi 10.2307/2528963, for medians.
        rows = look.values[look.lost == 0].astype(np.float64)
        sums, apart = (np.median(np.abs(rows[:, :, None] + sign * rows[:, None]), axis=0) for sign in (1, -1))
        powers, axes = np.linalg.eigh((sums**2 - apart**2) / (2 * 0.6745) ** 2)
        squares = np.where(np.isfinite(squares), squares, np.median(powers) * np.eye(len(squares)))
    if len(squares) == 1:
        return np.minimum(squares, np.maximum(powers, 0)) if look.has_texture else squares
    least = np.einsum("ij,ik,kj->j", axes, squares, axes)
    grain = _GRAIN * 256 * versions.rounding if look.has_texture else 0.0
    excess = np.maximum(powers - least, 0)
    excess[(excess < (_POWER - 1) * least) | (excess < len(squares) * grain**2)] = 0
    return np.asarray(squares + (axes * excess) @ axes.T)


def _flat(patches: Floats, least: Floats) -> tuple[Floats, Floats]:
    """(C, C) axes of bands and (C,) the power along each that all waves of patches, (N, side, side, C), have."""
    # Middle waves have power n + m t and high ones n + h t, n of white noise and t of the texture of a patch. What both
    # grow by, from quiet patches to louder ones, tells the slope h / m; n is where the line of the one against the
    # other meets equal power. The slope is at most that of texture whose power falls as the square of frequency: D. J.
    # Field, J. Opt. Soc. Am. A 4 (1987) 2379-2394, doi 10.1364/JOSAA.4.002379. `least`, (C, C), is noise that is known.
    n, side, _, n_bands = patches.shape
    rings, squares = (np.add.outer(axis, axis).ravel() for axis in (np.arange(side), np.arange(side) ** 2))
    groups = (rings >= side // 2) & (rings < side - 1), rings > side
    basis = dct(np.eye(side), axis=0, norm="ortho")
    waves = np.kron(basis, basis) @ patches.reshape(n, side**2, n_bands)
    # Patches are ordered by waves that are even about their centers and measured in those that are odd, and vice versa.
    halves = [[waves[:, group & (rings % 2 == parity)] for group in groups] for parity in (0, 1)]
    high = waves[:, groups[1]].reshape(-1, n_bands)
    axis = np.linalg.eigh(high.T @ high / len(high) - least)[1][:, -1]
    powers = np.zeros((2, 2, n_bands, n_bands))  # of quiet and of louder patches, in middle and in high waves
    for measured, other in zip(halves, halves[::-1], strict=True):
        order = np.argsort(sum(np.square(wave @ axis).sum(axis=1) for wave in other), kind="stable")
        for place, (start, end) in enumerate(((0, _QUIET), _GROWING)):
            for number, wave in enumerate(measured):
                rows = wave[order[int(start * n) : int(end * n)]].reshape(-1, n_bands)
                share = wave.shape[1] / np.count_nonzero(groups[number])
                powers[place, number] += share * (rows.T @ rows) / len(rows)
    axes = np.linalg.eigh(powers[0, 1] - least)[1]
    (middle, high), growth = (quiet := np.einsum("ik,gwij,jk->gwk", axes, powers, axes))[0], np.diff(quiet, axis=0)[0]
    falls = (1 / squares[groups[1]]).mean() / (1 / squares[groups[0]]).mean()
    slope = np.clip(growth[1] / np.maximum(growth[0], 1e-30), 0, falls)
    return axes, high - slope / (1 - slope) * np.maximum(middle - high, 0)


def _levels_in(patches: Floats) -> Floats:
    """(C,) standard deviation of the noise in each band of patches, (N, side, side, C)."""
    bands = np.array([*side_by_side(_least, np.split(patches, patches.shape[3], axis=3))])
    if len(bands) == 1 or not bands.max():
        return bands
    # Bands have texture in common, so that together they have more directions without it.
    bands = np.maximum(bands, 1e-3 * bands.max())
    return np.asarray(bands * _least(patches / bands))


def _least(patches: Floats) -> float:
    """Return the standard deviation of patches in the directions in which they vary least, which only noise fills."""
    even, odd = _halves_of(patches)
    few = min(_FEWEST * patches.shape[3], int(_OF_FEW * len(patches)))
    n_quiet = min(max(int(_QUIET * len(patches)), few, _PER_VALUE * even[0].size), len(patches))
    pairs = [(even, odd), (odd, even)]
    of_pairs = [*side_by_side(lambda pair: _powers(pair[0][_order_of(pair[1])[:n_quiet]]), pairs)]
    powers, again = (both := np.concatenate(of_pairs, axis=1))[:, np.argsort(both[0])]
    # As many directions, but not two, as have a mean that is not above their median: texture would raise the mean.
    count = np.arange(1, len(powers) + 1)
    means = np.cumsum(powers) / count
    medians = (powers[(count - 1) // 2] + powers[count // 2]) / 2
    last = np.flatnonzero((means <= medians) & (count != 2))[-1]
    # The mean is too low, by chance; that of other patches along the same axes is too high, by texture.
    return float(np.sqrt(max(means[last] + min(again[: last + 1].mean(), _AGAIN * means[last]), 0.0) / 2))


def _powers(halves: Floats) -> Floats:
    """(2, P) power along the axes of every second of the halves of patches: of these, and of the others."""
    rows = halves - halves.mean(axis=0)
    values, axes = np.linalg.eigh(rows[::2].T @ rows[::2] / len(rows[::2]))
    return np.stack([values, np.square(rows[1::2] @ axes).mean(axis=0)])


# --- noise whose variance follows the level, as that of light does
# A. Foi et al., IEEE Trans. Image Processing 17 (2008) 1737-1754, doi 10.1109/TIP.2008.2001399, for the model.


def lines_of(versions: Versions, *, in_place: bool, across: Floats | None = None) -> tuple[Floats, Floats] | None:
    """(C, 2) relative variance by level, as constant and slope, and (C,) its mean; None if chance explains as much."""
    # What bands share, as far as `across`, (C, C), has any, is measured along its main axis.
    axes = np.linalg.eigh(across)[1][:, -1:] if across is not None and _is_shared(across) else None
    levels, variances, usual = [], [], []
    for numbers in _looks(versions, in_place=in_place):
        if measured := _Look.of(versions, *numbers).patches(*_SIDES[:2], per_value=3 * _CLASSES):
            patches, means = measured
            parts = np.array_split(np.argsort(means.mean(axis=1), kind="stable"), _CLASSES)
            patches = patches if axes is None else patches @ axes
            squares = np.square([*side_by_side(_levels_in, [patches[part] for part in parts])])
            squares = np.broadcast_to(squares, (len(parts), means.shape[1]))
            levels += [means[part].mean(axis=0) for part in parts]
            usual.append(squares.mean(axis=0))
            # Versions may be more or less noisy; what matters is how noise changes with the level.
            variances += [*(squares / np.maximum(usual[-1], 1e-30))]
    if not usual or np.min(usual) <= 0 or np.min(np.ptp(levels, axis=0)) <= 0:
        return None
    seen, told = np.array(levels), np.array(variances)
    # Small lights make the one class that has them seem noisy: a line shows without any of the classes, and in all.
    classes = np.arange(len(seen)) % _CLASSES
    lines = [_line(seen[classes != number], told[classes != number]) for number in range(_CLASSES + 1)]
    return (lines[-1][0], np.mean(usual, axis=0)) if max(chance for _, chance in lines) < _CHANCE else None


def _line(levels: Floats, told: Floats) -> tuple[Floats, float]:
    """(C, 2) constants and slopes of what is told at levels, (N, C), and the chance that explains as much."""
    from scipy.stats import f as distribution

    lines = np.array([np.polynomial.polynomial.polyfit(*pair, 1) for pair in zip(levels.T, told.T, strict=True)])
    fitted, freedom = lines[:, 0] + lines[:, 1] * levels, len(lines) * (len(levels) - 2)
    explained, left = (np.square(fitted - other).sum() for other in (told.mean(axis=0), told))
    return lines, float(distribution.sf(explained / len(lines) / max(left / freedom, 1e-30), len(lines), freedom))


# --- noise that neighboring pixels and bands share, as demosaicing, scaling and compression leave it
# It is measured in quiet blocks, chosen as for the level. What bands have in common and grows from the quietest to
# louder ones is texture: that much of it, and more, is taken away, but nothing of the white noise that is there.


def shared_noise(versions: Versions, *, in_place: bool) -> SharedNoise | None:
    """Find the noise that pixels share, a mean over versions; None where it is white or too little is known."""
    looks = side_by_side(lambda numbers: _shared_in(versions, numbers), _looks(versions, in_place=in_place))
    shared = [look for look in looks if look is not None]
    return SharedNoise(np.mean(shared, axis=0)) if shared else None


def _shared_in(versions: Versions, numbers: tuple[int, ...]) -> Floats | None:
    """(2 L + 1, 2 L + 1, C, C) autocovariance of what pixels share; None where noise is white or too little known."""
    look, grain = _Look.of(versions, *numbers), _GRAIN * 256 * versions.rounding
    whole, level = look.patches(_BLOCK, per_value=1), look.levels.min()
    if whole is None or not level > 0:
        return None
    rows = whole[0].reshape(len(whole[0]), _BLOCK**2, -1) / level
    planes, _ = np.linalg.qr([(1, *place) for place in np.ndindex(_BLOCK, _BLOCK)])  # what fits them best is no noise
    blocks = (rows - planes @ (planes.T @ rows)).reshape(whole[0].shape)
    even, odd = _halves_of(blocks)

    def half(sign: int) -> tuple[Floats, Indices]:
        return (blocks + sign * blocks[:, ::-1, ::-1]) / 2, _order_of(odd if sign == 1 else even)

    halves = [*side_by_side(half, (1, -1))]
    side = np.hanning(_BLOCK + 2)[1:-1]
    window, sides = np.outer(side, side), (2 * _BLOCK,) * 2

    def spectrum(*shares: float) -> Floats:
        """(X, Y, C, C) mean of the products of the bands of waves of some blocks."""
        group = slice(*(int(share * len(blocks)) for share in shares))

        def products(number: int) -> Floats:
            blocks, order = halves[number]
            wave = np.fft.rfft2(blocks[order[group]] * window[:, :, None], sides, axes=(1, 2))
            return np.asarray(np.einsum("bxyi,bxyj->xyij", wave, wave.conj()) / len(wave))

        return np.asarray(sum(side_by_side(products, (0, 1))))

    frequencies = np.hypot(np.fft.fftfreq(sides[0])[:, None], np.fft.rfftfreq(sides[1]))
    white, quiet = np.square(window).sum(), spectrum(_GROUPS[0 if look.has_texture else 2])
    if look.has_texture:
        quiet = _without_texture(quiet, spectrum(*_GROUPS[1:]), white, frequencies)
    squares, axes = np.linalg.eigh(quiet)
    squares = np.maximum(squares, white)
    power = squares[frequencies >= _HIGH].mean() / white  # texture that all bands share leaves none
    if power < _POWER or (look.has_texture and power * level**2 < grain**2):
        return None
    powers = np.einsum("xyij,xyj,xykj->xyik", axes, squares, axes.conj()) * level**2
    seen = np.square(np.abs(np.fft.rfft2(window, sides)))[:, :, None, None]
    return _near(powers, sides) / _near(seen, sides)


def _without_texture(quiet: Floats, louder: Floats, white: float, frequencies: Floats) -> Floats:
    """(X, Y, C, C) part of the spectrum of quiet blocks in each pair of bands that is noise."""
    rings, n_bands = (frequencies * _RINGS).astype(np.intp), quiet.shape[2]

    def by_ring(values: Array) -> Floats:
        return np.bincount(rings.ravel(), values.real.ravel()).astype(np.float64)

    first, next_ = (by_ring(np.einsum("xyii->xy", spectrum)) for spectrum in (quiet, louder))
    together, common_next = (spectrum.sum(axis=(2, 3)).real / n_bands for spectrum in (quiet, louder))
    common, apart_next = by_ring(together), (next_ - by_ring(common_next)).sum()
    steady = np.clip(1 - _TIMES * (next_ / first - _GROWS), 0, 1)
    # What bands differ by is texture where all of it grows by as much again, as in pictures of many colors.
    share = np.clip(1 - (apart_next / max((first - common).sum(), 1e-30) - _GROWS), 0, 1)
    apart = share * (first - common) / max(n_bands - 1, 1)
    noise = steady * np.maximum(common - apart, 0) + np.minimum(common, apart)
    if n_bands > 1:
        beyond = [by_ring(power - white)[1:].sum() for power in (np.einsum("xyii->xy", quiet) / n_bands, together)]
        if beyond[1] > _COMMON * n_bands * beyond[0]:
            # What bands differ by tells nothing, as where there is one. Grain is blurred: it falls, and falls again.
            noise = steady * common
            falling = (noise / np.bincount(rings.ravel()))[(np.arange(1, 4) * _HIGH * _RINGS).astype(np.intp)]
            noise *= np.all(falling[:-1] > _TIMES * falling[1:])
        else:
            # Texture grows toward low frequencies; there, noise has no more in common than at middle ones.
            ratios, middle = noise / np.maximum(apart, 1e-30), _RINGS // 3
            ratios[:middle] = np.minimum.accumulate(ratios[middle::-1])[:0:-1]
            noise = np.minimum(noise, ratios * apart)
    gray, bands = np.full((n_bands, n_bands), 1 / n_bands), np.eye(n_bands)
    texture = (1 - noise / np.maximum(common, 1e-30))[rings] * together
    kept = gray + np.sqrt(share) * (bands - gray)
    return np.asarray(kept @ (quiet - texture[:, :, None, None] * gray - white * bands) @ kept + white * bands)
