"""Defects that are no noise: impulses, as salt and pepper and hot and dead pixels are, and stripes of rows or columns.

Either is taken for one only by evidence that pictures do not give: values at an end of the levels stand out from all
around them, as others do not, or others do so as no lens draws lights; rows differ by the same amount, or part, from
those above and below on the left and on the right.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import median_filter, uniform_filter, uniform_filter1d

from cvtimg._shared.threads import in_stripes, of_each
from cvtimg._shared.types import Array, Bools, Floats, Floats32
from cvtimg.restoration.versions import Versions, fill
from cvtimg.segmentation.noise import MEDIAN_OF_NORMAL, NEXT_TO_LIGHT

#: Chance that what is there by itself seems to be impulses.
_CHANCE = 1e-3
#: Share of pixels that are quiet: what is around them has a range of about two standard deviations of noise.
_QUIET = 0.1
#: Neighbors, of eight, that must not be at an end of the levels themselves.
_BETWEEN = 3
#: Part of what is at an end that stands out, at least; and how many times as much of it as elsewhere is near.
_ALONE, _NEAR = 0.25, 2.0
#: Ranges of what is around by which lone pixels stand out, and by which many of them must: of what stands out by one in
#: 24 photographs, and in lights of a width of .5 pixels, no more than this part does so by as many, and none in wider.
_LONE, _FAR, _RARELY = 2.0, 3.0, 0.05
#: Correlation of the offsets of rows in the left and in the right half, from which on they are those of the rows.
_ALIKE = 0.6
#: Pixels above and below with which rows are compared, and columns of which each tells their offset.
_ABOUT, _PART = 9, 16
#: Rounds in which lone pixels are found once there are some, and offsets: all but the waves that are longer than what
#: rows are compared with.
_ROUNDS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Defects:
    """What was found in each version."""

    impulses: Floats  # (S,): share of the known pixels that are impulses, which are unknown from then on
    stripes: Floats  # (S, 2): standard deviations of what stripes of rows and of columns added and was taken away


def without_defects(versions: Versions) -> tuple[Versions, Defects]:
    """Take stripes of rows and columns away, and let impulses be unknown, where there is evidence of either."""
    known, stack = versions.known.copy(), list(versions.stack)
    defects = Defects(np.zeros(versions.n_versions), np.zeros((versions.n_versions, 2)))

    def mend(number: int) -> None:
        given, inside = versions.stack[number], versions.known[:, :, number]
        bands = np.where(inside[:, :, None], given, np.float32(np.nan)).astype(np.float32)
        hits = [hit for hit in (_impulses(bands, inside), _lone(bands)) if hit is not None]
        if hits:
            known[:, :, number] &= ~np.any(hits, axis=0)
            defects.impulses[number] = 1 - np.count_nonzero(known[:, :, number]) / np.count_nonzero(inside)
        seen = known[:, :, number]
        filled = fill(np.where(seen[:, :, None], given, 0).astype(np.float32), seen.astype(np.float32))
        for axis, rows in enumerate((filled, filled.swapaxes(0, 1))):
            stripes = _stripes(rows)
            if (level := np.sqrt(np.square(stripes).mean())) > versions.unseen:
                defects.stripes[number, axis] = level
                values = stack[number] - stripes.swapaxes(0, axis)
                stack[number] = np.where(inside[:, :, None], values, np.float32(0))

    of_each(mend, versions.n_versions, 1e3 * stack[0].size)
    return replace(versions, known=known, stack=tuple(stack)), defects


# --- impulses


def _impulses(bands: Floats32, known: Bools) -> Bools | None:
    """(H, W) impulses at the ends of the levels of each band of a version, (H, W, C); None without evidence."""
    from scipy.stats import binom

    if not known.any() or not np.ptp(bands[known], axis=0).any():
        return None
    black, white = (pick(bands[known], axis=0) for pick in (np.min, np.max))
    ends, hits = (bands == black, bands == white), np.zeros(known.shape, np.bool_)

    def surroundings(around: Floats32) -> tuple[Array, ...]:
        is_between = np.isfinite(around) & (around != black) & (around != white)
        low = np.min(around, axis=0, initial=np.inf, where=is_between)
        high = np.max(around, axis=0, initial=-np.inf, where=is_between)
        same = ((around == level).sum(axis=0, dtype=np.uint8) for level in (black, white))
        return low, high, is_between.sum(axis=0) >= _BETWEEN, np.isfinite(around).sum(axis=0), *same

    low, high, judged, n_known, *n_same = _of_neighbors(surroundings, bands)
    down, right = (3 - (np.arange(side) == 0) - (np.arange(side) == side - 1) for side in known.shape)
    n_within = np.multiply.outer(down, right) - 1  # neighbors within the image
    apart = np.where(judged, np.maximum(bands - high, low - bands), np.float32(-1))
    around_by = np.maximum(high - low, (white - black) / np.float32(256))
    inside = judged & ~ends[0] & ~ends[1]
    quiet = np.quantile((high - low)[inside], _QUIET) if inside.any() else 0.0  # 0 in drawings, where areas count
    counted = tuple(end & judged for end in ends) if quiet else ends
    # What stands out does so by more than the range of what is around, or by twice that, where noise does so by once.
    outs = (apart > times * around_by for times in ((1, _LONE) if quiet else (1,)))
    tries = (_counts(out, apart, ends, counted, bands < low, np.max(white - black) / 2) for out in outs)
    if (counts := next(filter(None, tries), None)) is None:
        return None
    least = 1.5 * quiet  # three of them
    # Where noise is cut off at the other end, that is what is around.
    is_whole = n_known == n_within[:, :, None]
    apart = np.where(judged, apart, np.abs(bands - np.where(ends[0], white, black)) * is_whole)
    for end, around, n in zip(ends, n_same, counts, strict=True):
        # More neighbors at the same end than chance puts there: what is there is true.
        by_chance = binom.isf(_CHANCE, np.arange(9), min(2 * n / end.size, 0.5))[n_within]
        hits |= (end & (around <= by_chance[:, :, None]) & (apart > least) & (n > 0)).any(axis=2)
    return hits


def _counts(
    out: Bools, apart: Floats32, ends: tuple[Bools, ...], counted: tuple[Bools, ...], is_low: Bools, half: float
) -> list[int] | None:
    """Numbers of the values at each end that stand out, (H, W, C), if those of either are impulses."""
    alone, others = [out & end for end in ends], out & ~ends[0] & ~ends[1]
    # Dithering stands out by a step of its levels, as a rule.
    heights = [apart[some] for some in alone if some.any()]
    if not any(np.count_nonzero(some > half) > _ALONE * len(some) or _vary(some) for some in heights):
        return None
    n_others = [int(np.count_nonzero(others & side)) for side in (is_low, ~is_low)]
    are_any = any(_are_impulses(*of_end) for of_end in zip(alone, counted, n_others, strict=True))
    return [int(np.count_nonzero(some)) for some in alone] if are_any else None


def _are_impulses(alone: Bools, end: Bools, n_others: int) -> bool:
    """Tell whether what stands out at an end, (H, W, C), is more than what does so elsewhere, and lies as by chance."""
    from scipy.stats import binom

    n = int(np.count_nonzero(alone))
    if n < max(_ALONE * np.count_nonzero(end), 2 * n_others) or binom.sf(n - 1, n + n_others, 0.5) > _CHANCE:
        return False
    # Thin strokes of text stand out, too, but have others near. Bands may have their impulses together.
    places, ends = alone.any(axis=2), np.asarray(end.any(axis=2), np.float32)
    near = np.median(uniform_filter(ends, 5, mode="constant")[places]) * 25 - 1
    return bool(near <= _NEAR * 24 * ends.mean())


def _lone(bands: Floats32) -> Bools | None:
    """(H, W) hot and dead pixels of any level: they stand out from all around them as no light does through a lens."""
    from scipy.stats import binom

    # NaN at the border and beside what is unknown.
    low, high = _of_neighbors(lambda around: (np.min(around, axis=0), np.max(around, axis=0)), bands)
    spread, hits = high - low, np.zeros(bands.shape[:2], np.bool_)
    if not np.isfinite(spread).any() or (usual := np.nanquantile(spread, _QUIET)) == 0:
        return None  # drawn: any dot is true
    step, are_many = usual + np.float32(np.nanmax(bands) - np.nanmin(bands)) / 64, False
    for apart in (bands - high, low - bands):
        hits |= (NEXT_TO_LIGHT * apart > spread + usual).any(axis=2)  # by itself: no light stands out by as much
        out, lone, most = ((apart > times * (spread + step)).any(axis=2) for times in (1, _LONE, _FAR))
        n = np.count_nonzero(most)
        if binom.sf(n - 1, np.count_nonzero(out), _RARELY) < _CHANCE and _vary(apart[apart > spread + step]):
            hits, are_many = hits | lone, True
    for _ in range(_ROUNDS if are_many else 0):  # those that are left, also two beside each other
        low, high, n_known = _of_neighbors(_seconds, np.where(hits[:, :, None], np.float32(np.nan), bands))
        apart = np.where(n_known >= _BETWEEN, np.maximum(bands - high, low - bands), 0)
        hits |= (apart > _FAR * (high - low + step)).any(axis=2)
    return hits if hits.any() else None


def _vary(heights: Floats32) -> bool:
    """Tell whether values stand out by this and that, as steps of dithering do not."""
    some, most = np.quantile(heights, (0.1, 0.9))
    return bool(most > 2 * some)


def _seconds(around: Floats32) -> tuple[Array, ...]:
    """(H, W, C) the second lowest and the second highest of the neighbors, (8, H, W, C), and how many are known."""
    rest = np.sort(around, axis=0)  # NaN last
    n_known = np.isfinite(rest).sum(axis=0, dtype=np.intp)
    return rest[1], np.take_along_axis(rest, np.maximum(n_known - 2, 0)[None], axis=0)[0], n_known


def _of_neighbors(tell: Callable[[Floats32], tuple[Array, ...]], bands: Floats32) -> list[Any]:
    """(H, W, C) arrays that `tell` makes of the neighbors, (8, h, W, C), NaN outside, of the pixels of a few rows."""
    padded = np.pad(bands, ((1, 1), (1, 1), (0, 0)), constant_values=np.nan)
    steps = [(dy, dx) for dy in range(3) for dx in range(3) if (dy, dx) != (1, 1)]

    def told(rows: slice) -> tuple[Array, ...]:
        return tell(np.stack([padded[rows.start + dy : rows.stop + dy, dx:][:, : bands.shape[1]] for dy, dx in steps]))

    return [np.concatenate(parts) for parts in zip(*in_stripes(told, len(bands), 100.0 * bands.size), strict=True)]


# --- stripes


def _stripes(image: Floats32) -> Floats32:
    """(H, W, C) what offsets of the rows of an image add, or gains, whichever explain more; 0 without evidence."""
    if min(image.shape[:2]) < 4 * _PART or not (offsets := _offsets(image)).any():
        return np.zeros_like(image)
    least, shift = image.min(), np.ptp(image) / np.float32(64) + np.float32(1e-30)
    logs = np.log(image - least + shift)  # in which gains are offsets
    without = [image - offsets, np.exp(logs - _offsets(logs)) + least - shift]
    left = [sum(np.square(_departures(band)).sum() for band in np.moveaxis(candidate, 2, 0)) for candidate in without]
    return image - without[int(np.argmin(left))]


def _offsets(image: Floats32) -> Floats32:
    """(H, 1, C) offsets of the rows of an image, (H, W, C), from those around; 0 without evidence."""
    offsets = np.zeros((len(image), 1, image.shape[2]), np.float32)
    for band, total in zip(np.moveaxis(image, 2, 0), np.moveaxis(offsets, 2, 0), strict=True):
        if _are_of_rows(_departures(band)):
            for _ in range(_ROUNDS):
                total += _departures(band - total).mean(axis=1, keepdims=True)
            total[:, 0] = _white_part(total[:, 0])
    return offsets


def _white_part(offsets: Floats32) -> Floats32:
    """(H,) that part of what rows depart by which has the same power in all waves; edges of the picture have less."""
    waves, window = np.fft.rfftfreq(len(offsets)), np.hanning(len(offsets))
    powers = np.square(np.abs(np.fft.rfft(offsets * window)))
    # It is where the line of high against middle waves meets equal power, if texture falls as the square of frequency.
    middle, high = (waves >= 1 / _ABOUT) & (waves < 1 / 4), waves >= 1 / 3
    falls = np.mean(waves[high] ** -2) / np.mean(waves[middle] ** -2)
    white = powers[high].mean() - falls / (1 - falls) * max(powers[middle].mean() - powers[high].mean(), 0)
    parts = np.clip(white / np.maximum(uniform_filter1d(powers, _ABOUT), 1e-30), 0, 1)
    return np.fft.irfft(parts * np.fft.rfft(offsets), len(offsets)).astype(np.float32)


def _departures(band: Floats32) -> Floats32:
    """(H, P) median of what each part of a row departs by from the rows around."""
    parts = np.array_split(band, band.shape[1] // _PART, axis=1)

    def departure(number: int) -> Floats32:
        return np.asarray(np.median(parts[number] - median_filter(parts[number], (_ABOUT, 1)), axis=1))

    return np.stack(of_each(departure, len(parts), 100.0 * band.size), axis=1)


def _are_of_rows(departures: Floats32) -> bool:
    """Tell whether parts of rows, (H, P), depart alike in the left and in the right half."""
    from scipy.stats import spearmanr

    half = departures.shape[1] // 2
    left, right = departures[:, :half].mean(axis=1), departures[:, half:].mean(axis=1)
    # Ranks, because edges across the picture are in few rows, and offsets in all.
    # Offsets are normal; what charts and lines of text have is in few rows, and far from that of the most.
    usual = [np.median(np.abs(side)) > MEDIAN_OF_NORMAL / 2 * side.std() for side in (left, right)]
    return bool(all(usual) and spearmanr(left, right).statistic > _ALIKE)
