"""How strong the noise of each version is, and whether it follows the level of the picture.

Texture and edges show in the part of a patch that is even about its center and in the odd part alike. The two parts of
noise, which is alike all over, know nothing of each other. So patches with a quiet odd part tell what noise is in even
parts, and the other way round: to choose by one and to measure in the other takes no noise away. Patches cut off at an
end of the levels have lost noise and are left out. In doubt there is less noise. The level is that of the least
eigenvalues of the covariance of patches: G. Chen, F. Zhu, P. A. Heng, ICCV 2015, doi 10.1109/ICCV.2015.62. To choose
patches by their other half is our own.

Where several versions know a pixel, their difference has no texture in it. It is too large where they do not line up or
differ in exposure: the lower of the two is taken. Where pixels are missing one by one, no patch is whole, and
differences across the diagonals of four adjacent pixels have to do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.anscombe import Bend
from cvtimg.restoration.versions import Floats, Versions
from cvtimg.segmentation.noise import lower_variance, scattered_noise

_Doubles = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Measuring:
    """In what noise is measured."""

    sides: tuple[int, ...] = (8, 4)  # of patches: the largest of which there are enough
    per_value: int = 10  # patches for each of their values, so that chance does not make their covariance
    most: int = 1 << 14  # patches, about
    cut_off: float = 0.02  # share of values at an end of the levels from which on a patch is cut off
    margin: float = 1.25  # standard deviations from an end of the levels, on the mean, within which noise is lost
    classes: int = 8  # of levels, in each of which noise is measured
    enough: int = 64  # pixels that two versions must both know
    most_pixels: int = 1 << 20  # of two versions that are compared, about
    copies: float = 0.0025  # part of the variance of noise that two versions differ by at least, or are copies
    #: Relative errors of the variance of a difference; of how much noisier one version is than another, each measured
    #: alone; and of the noise of a version alone, which may be texture for the most part.
    errors: tuple[float, float, float] = (0.02, 0.25, 0.5)


_MEASURING = _Measuring()


# --- what noise shows in


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What noise is measured in."""

    values: Floats  # (H, W, C): noise and, unless versions were subtracted, the image
    image: Floats  # (H, W, C): the image
    lost: Floats  # (H, W): share of the bands that are cut off; infinite where nothing is known
    has_texture: bool = True  # False where versions were subtracted

    @property
    def share(self) -> float:
        """Share of the patches that are quiet enough to show noise."""
        return 0.1 if self.has_texture else 0.5

    def patches(self, side: int, most: int = _MEASURING.most) -> tuple[_Doubles, _Doubles]:
        """(N, side, side, C) patches all over, about so many, and their levels, (N, C)."""
        height, width = (size - side + 1 for size in self.lost.shape)
        if min(height, width) < 1:
            return np.empty((0, side, side, self.values.shape[2])), np.empty((0, self.values.shape[2]))
        every = (slice(None, None, int(np.ceil(np.sqrt(max(height * width / most, 1))))),) * 2

        def seen(image: Floats) -> Floats:
            return np.lib.stride_tricks.sliding_window_view(image, (side, side), (0, 1))[every]

        inside = seen(self.lost).mean(axis=(2, 3)) <= _MEASURING.cut_off
        patches = np.moveaxis(seen(self.values)[inside], 1, 3).astype(np.float64)
        return patches, seen(self.image)[inside].mean(axis=(2, 3), dtype=np.float64)


def looks_at(versions: Versions, *, in_place: bool) -> Iterator[Look]:
    """Yield what shows the noise of versions: each of them; or what two differ by, if they are `in_place`."""
    numbers = np.flatnonzero(versions.known.any(axis=(0, 1))).tolist()
    if in_place and len(numbers) > 1:
        for one, other in pairwise(numbers):
            left, right = versions.bands(one), versions.bands(other)
            lost = np.maximum(_lost(versions, one), _lost(versions, other))
            yield Look(
                (left - right) * np.float32(np.sqrt(0.5)), (left + right) * np.float32(0.5), lost, has_texture=False
            )
    else:
        yield from (Look(versions.bands(one), versions.bands(one), _lost(versions, one)) for one in numbers)


def _lost(versions: Versions, version: int) -> Floats:
    """(H, W) share of the bands of a version that are at an end of its levels; infinite where nothing is known."""
    values, known = versions.stack[version], versions.known[:, :, version]
    ends = (0, versions.white) if versions.white is not None else (values[known].min(), values[known].max())
    lost = ((values <= ends[0]) | (values >= ends[1])).mean(axis=2, dtype=np.float32)
    return np.where(known, lost, np.float32(np.inf))


def halves_of(patches: _Doubles) -> tuple[_Doubles, _Doubles]:
    """(N, P / 2, C) even and odd parts of patches, (N, side, side, C), about their centers."""
    rows = patches.reshape(len(patches), -1, patches.shape[3])
    half = rows.shape[1] // 2
    one, other = rows[:, :half], rows[:, : -half - 1 : -1]
    return (one + other) / np.sqrt(2), (one - other) / np.sqrt(2)


def order_of(halves: _Doubles) -> NDArray[np.intp]:
    """(N,) patches from quiet to loud, where each direction counts by what is usual in it."""
    rows = halves.reshape(len(halves), -1)
    rows = rows - rows.mean(axis=0)
    squares = np.square(rows @ np.linalg.eigh(rows.T @ rows)[1])
    usual = np.median(squares, axis=0)
    tells = usual > 1e-9 * usual.max(initial=0)
    return np.argsort((squares[:, tells] / usual[tells]).sum(axis=1), kind="stable")


# --- the level


def levels_of(look: Look) -> _Doubles:
    """(C,) standard deviation of the noise in each band; NaN where too little is known or all is cut off."""
    n_bands = look.values.shape[2]
    for side in _MEASURING.sides:
        patches, _ = look.patches(side)
        if len(patches) >= _MEASURING.per_value * side**2 * n_bands:
            return levels_in(patches, look.share)
    return np.full(n_bands, np.nan)


def levels_in(patches: _Doubles, share: float) -> _Doubles:
    """(C,) standard deviation of the noise in each band of patches, (N, side, side, C)."""
    n_bands = patches.shape[3]
    bands = np.array([_least(patches[..., band : band + 1], share) for band in range(n_bands)])
    if n_bands == 1 or not bands.max():
        return bands
    # Bands have texture in common, so that together they have more directions without it.
    bands = np.maximum(bands, 1e-3 * bands.max())
    return np.asarray(bands * _least(patches / bands, share))


def _least(patches: _Doubles, share: float) -> float:
    """Return the standard deviation of patches in the directions in which they vary least, which only noise fills."""
    even, odd = halves_of(patches)
    n_quiet = min(max(int(share * len(patches)), _MEASURING.per_value * even[0].size), len(patches))
    found = [_powers(even[order_of(odd)[:n_quiet]]), _powers(odd[order_of(even)[:n_quiet]])]
    powers, again = np.concatenate(found, axis=1)
    order = np.argsort(powers)
    # As many directions as have a mean that is not above their median: texture would raise the mean.
    count = np.arange(1, len(powers) + 1)
    means = np.cumsum(powers[order]) / count
    medians = (powers[order][(count - 1) // 2] + powers[order][count // 2]) / 2
    last = np.flatnonzero(means <= medians)[-1]
    # The mean is too low, by chance; that of other patches along the same axes is too high, by texture.
    return float(np.sqrt(max((means[last] + again[order[: last + 1]].mean()) / 2, 0.0)))


def _powers(halves: _Doubles) -> _Doubles:
    """(2, P) power along the axes of every second of the halves of patches: of these, and of the others."""
    rows = halves.reshape(len(halves), -1)
    rows = rows - rows.mean(axis=0)
    values, axes = np.linalg.eigh(rows[::2].T @ rows[::2] / len(rows[::2]))
    return np.stack([values, np.square(rows[1::2] @ axes).mean(axis=0)])


# --- the level of several versions


def mean_noise(noise_by_band: list[_Doubles]) -> _Doubles:
    """(S,) root mean squares of the noise in the bands of each version."""
    return np.array([np.sqrt(np.mean(np.square(sigmas))) for sigmas in noise_by_band])


def noise_of_bands(versions: Versions, *, alike: bool = True) -> list[_Doubles]:
    """(C,) standard deviation of the noise in each band, of each version; NaN where too little is known."""
    # Versions are as they came: interpolation would smooth their noise. Those that are `alike` differ by noise. All are
    # measured in one way, so that they compare.
    numbers = np.flatnonzero(versions.known.any(axis=(0, 1))).tolist()
    found = [np.full(np.count_nonzero(versions.version_of == s), np.nan) for s in range(versions.n_versions)]
    for number, look in zip(numbers, looks_at(versions, in_place=False), strict=True):
        found[number] = levels_of(look)
    if any(np.isnan(found[number]).any() for number in numbers):
        found = [_scattered(versions, number) for number in range(versions.n_versions)]
    return list(_by_differences(versions, np.stack(found))) if alike and versions.n_versions > 1 else found


def _scattered(versions: Versions, version: int) -> _Doubles:
    """(C,) noise in each band, where clipping took none of it away, if there is enough of that."""
    from scipy.ndimage import uniform_filter

    values, known = versions.bands(version), versions.known[:, :, version]
    found: _Doubles = scattered_noise(values, known)
    if versions.white is None or np.isnan(found).any():
        return found
    share = np.maximum(uniform_filter(known.astype(np.float32), 5), 1e-3)
    for band, sigma in enumerate(found):
        inside = known & versions.is_inside(uniform_filter(values[:, :, band], 5) / share, _MEASURING.margin * sigma)
        again = float(scattered_noise(values[:, :, band : band + 1], inside)[0])
        found[band] = sigma if np.isnan(again) else again
    return found


def _by_differences(versions: Versions, alone: _Doubles) -> _Doubles:
    """(S, C) noise: variances that explain what versions differ by, and are no larger than those of each `alone`."""
    n, squares = versions.n_versions, alone**2
    if not np.isfinite(squares).all():
        return alone
    squares = np.maximum(squares, np.maximum(1e-4 * squares.max(axis=0), 1e-30))  # errors have a finite range
    pairs = sorted({(min(a, b), max(a, b)) for a in range(n) for b in ((a + 1) % n, (a + 2) % n) if a != b})
    compared = [(pair, told) for pair in pairs if (told := _variance_between(versions, *pair, alone)) is not None]
    noise, (of_sums, of_steps, of_own) = alone.copy(), _MEASURING.errors
    for band, own in enumerate(squares.T):
        told = np.array([variance[band] for _, variance in compared])
        if len(told) and told.min() > _MEASURING.copies * own.min():
            sums = np.array([[number in pair for number in range(n)] for pair, _ in compared], np.float64)
            steps, next_own = np.eye(n) - np.roll(np.eye(n), 1, axis=1), np.roll(own, -1)
            rows, values = np.concatenate([sums, steps, np.eye(n)]), np.concatenate([told, own - next_own, own])
            errors = np.concatenate([of_sums * told, of_steps * np.maximum(own, next_own), of_own * own])
            found = np.linalg.lstsq(rows / errors[:, None], values / errors)[0]
            noise[:, band] = np.sqrt(np.clip(found, np.minimum(0.1 * told.min(), own), own))
    return noise


def _variance_between(versions: Versions, one: int, other: int, alone: _Doubles) -> _Doubles | None:
    """(C,) variance of the difference of two versions where both know a pixel; None if there are few."""
    both = np.flatnonzero(versions.known[:, :, one] & versions.known[:, :, other])
    if len(both) < _MEASURING.enough:
        return None
    both = both[:: -(-len(both) // _MEASURING.most_pixels)]
    left, right = (versions.bands(number).reshape(-1, alone.shape[1])[both].T for number in (one, other))
    found = []
    for apart, mean, sigma in zip(left - right, (left + right) / 2, alone[[one, other]].max(axis=0), strict=True):
        inside = versions.is_inside(mean, _MEASURING.margin * sigma)
        found.append(lower_variance(apart[inside] if np.count_nonzero(inside) >= _MEASURING.enough else apart))
    return np.array(found)


# --- noise whose variance follows the level, as that of light does: constant + slope x level
# A. Foi et al., IEEE Trans. Image Processing 17 (2008) 1737-1754, doi 10.1109/TIP.2008.2001399, for the model.


def bend_of(versions: Versions, *, in_place: bool) -> Bend | None:
    """Find how noise follows the level, in all versions together; None if it is even or too little is known."""
    levels, variances, usual, least = [], [], [], np.inf
    for look in looks_at(versions, in_place=in_place):
        patches, means = look.patches(_MEASURING.sides[0])
        parts = np.array_split(np.argsort(means.mean(axis=1), kind="stable"), _MEASURING.classes)
        if not len(patches) or len(parts[-1]) < 3 * patches[:1].size:
            continue
        squares = np.array([np.square(levels_in(patches[part], look.share)) for part in parts])
        levels += [means[part].mean(axis=0) for part in parts]
        # Versions may be more or less noisy; what matters is how noise changes with the level.
        usual.append(squares.mean(axis=0))
        variances.append(squares / np.maximum(usual[-1], 1e-30))
        least = min(least, squares.min())
    if not usual or np.min(usual) <= 0:
        return None
    lines = _lines(np.array(levels), np.concatenate(variances))
    if lines is None:
        return None
    low, high = (float(np.min(levels)), float(np.max(levels))) if versions.white is None else (0.0, versions.white)
    constant, slope = lines.T * np.mean(usual, axis=0)
    # An end of the levels has at least a tenth of the least variance that was seen.
    first, last = (np.maximum(constant + slope * end, 0.1 * least) for end in (low, high))
    rise = np.where(np.abs(last - first) < 1e-3 * first, 1e-3 * first, last - first)  # not 0, by which a bend divides
    slope = rise / (high - low)
    return Bend(first - slope * low, slope, low, high)


def _lines(levels: _Doubles, variances: _Doubles, chance: float = 1e-3) -> _Doubles | None:
    """(C, 2) constant and slope of the variances, (N, C), of bands; None if chance explains as much."""
    from scipy.stats import f as distribution

    lines, explained, left = [], 0.0, 0.0
    for level, variance in zip(levels.T, variances.T, strict=True):
        rows = np.stack([np.ones_like(level), level], axis=1)
        line = np.linalg.lstsq(rows, variance)[0]
        explained += np.square(rows @ line - variance.mean()).sum()
        left += np.square(rows @ line - variance).sum()
        lines.append(line)
    freedom = len(lines) * (len(levels) - 2)
    by_chance = distribution.sf(explained / len(lines) / max(left / freedom, 1e-30), len(lines), freedom)
    return np.array(lines) if by_chance < chance else None
