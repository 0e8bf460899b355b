"""What noise versions have: its level, how that follows the level of the picture, and what near pixels share of it.

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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.progress import each
from cvtimg.restoration.anscombe import Bend
from cvtimg.restoration.shared import LAGS, SharedNoise
from cvtimg.restoration.versions import Floats, Versions
from cvtimg.segmentation.noise import lower_variance, scattered_noise

_Doubles = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Measuring:
    """In what noise is measured."""

    sides: tuple[int, ...] = (8, 4)  # of patches: the largest of which there are enough
    per_value: int = 10  # patches for each of their values, so that chance does not make their covariance
    most: int = 1 << 14  # patches, about
    quiet: tuple[float, float] = (0.1, 0.5)  # share of them that show noise; and where versions were subtracted
    cut_off: float = 0.02  # share of values at an end of the levels from which on a patch is cut off
    margin: float = 1.25  # standard deviations from an end of the levels, on the mean, within which noise is lost
    enough: int = 64  # pixels that two versions must both know
    most_pixels: int = 1 << 20  # of two versions that are compared, about
    copies: float = 0.0025  # part of the variance of noise that two versions differ by at least, or are copies
    least: float = 0.1  # part of the least variance found that noise has anywhere
    #: Relative errors of the variance of a difference; of how much noisier one version is than another, each measured
    #: alone; and of the noise of a version alone, which may be texture for the most part.
    errors: tuple[float, float, float] = (0.02, 0.25, 0.5)
    # How noise follows the level
    classes: int = 8  # of levels, in each of which noise is measured
    chance: float = 1e-3  # with which even noise is taken to follow the level
    # What near pixels share of it
    side: int = 16  # of the blocks whose spectra are compared: room for the lags, with a window
    blocks: int = 1 << 12  # that are looked at
    fewest: int = 12  # blocks in the quietest group
    groups: tuple[float, float, float] = (0.03, 0.1, 0.25)  # shares of the blocks, from quiet to loud, that end groups
    rings: int = 12  # per cycle per pixel, in each of which spectra are compared
    texture: tuple[float, float] = (3.0, 0.1)  # times what grows from the first to the third is, but for chance
    common: float = 0.9  # part of what is not white that bands share, from which on it is texture
    high: float = 0.2  # cycles per pixel from which on noise is compared with white noise: below, texture prevails
    power: float = 2.0  # of noise that is shared, as a multiple of that of white noise
    grain: float = 0.01  # of the range of levels: a picture may have less of its own


_MEASURING = _Measuring()


# --- what noise shows in


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What noise is measured in."""

    values: Floats  # (H, W, C): noise and, unless versions were subtracted, the image
    image: Floats  # (H, W, C): the image
    lost: Floats  # (H, W): share of the bands that are cut off; infinite where nothing is known
    has_texture: bool = True  # False where versions were subtracted

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

    def quiet(self, n: int) -> int:
        """Return how many of so many patches are quiet enough to show noise."""
        return int(_MEASURING.quiet[0 if self.has_texture else 1] * n)


def looks_at(versions: Versions, *, in_place: bool) -> Iterator[Look]:
    """Yield what shows the noise of versions: each of them; or what two differ by, if they are `in_place`."""
    numbers = np.flatnonzero(versions.known.any(axis=(0, 1))).tolist()
    if in_place and len(numbers) > 1:
        for one, other in pairwise(numbers):
            left, right = versions.bands(one), versions.bands(other)
            lost = np.maximum(_lost(versions, one), _lost(versions, other))
            apart, mean = (left - right) * np.float32(np.sqrt(0.5)), (left + right) * np.float32(0.5)
            yield Look(apart, mean, lost, has_texture=False)
    else:
        yield from (Look(versions.bands(one), versions.bands(one), _lost(versions, one)) for one in each(numbers))


def _lost(versions: Versions, version: int) -> Floats:
    """(H, W) share of the bands of a version that are at an end of its levels; infinite where nothing is known."""
    values, known = versions.stack[version], versions.known[:, :, version]
    ends = (0, versions.white) if versions.white is not None else (values[known].min(), values[known].max())
    lost = ((values <= ends[0]) | (values >= ends[1])).mean(axis=2, dtype=np.float32)
    return np.where(known, lost, np.float32(np.inf))


def _halves_of(patches: _Doubles) -> tuple[_Doubles, _Doubles]:
    """(N, P / 2, C) even and odd parts of patches, (N, side, side, C), about their centers."""
    rows = patches.reshape(len(patches), -1, patches.shape[3])
    half = rows.shape[1] // 2
    one, other = rows[:, :half], rows[:, : -half - 1 : -1]
    return (one + other) / np.sqrt(2), (one - other) / np.sqrt(2)


def _order_of(halves: _Doubles) -> NDArray[np.intp]:
    """(N,) patches from quiet to loud, where each direction counts by what is usual in it."""
    rows = halves.reshape(len(halves), -1)
    rows = rows - rows.mean(axis=0)
    squares = np.square(rows @ np.linalg.eigh(rows.T @ rows)[1])
    usual = np.median(squares, axis=0)
    tells = usual > 1e-9 * usual.max(initial=0)
    return np.argsort((squares[:, tells] / usual[tells]).sum(axis=1), kind="stable")


# --- the level


def _levels_of(look: Look) -> _Doubles:
    """(C,) standard deviation of the noise in each band; NaN where too little is known or all is cut off."""
    n_bands = look.values.shape[2]
    for side in _MEASURING.sides:
        patches, _ = look.patches(side)
        if len(patches) >= _MEASURING.per_value * side**2 * n_bands:
            return _levels_in(patches, look.quiet(len(patches)))
    return np.full(n_bands, np.nan)


def _levels_in(patches: _Doubles, n_quiet: int) -> _Doubles:
    """(C,) standard deviation of the noise in each band of patches, (N, side, side, C), so many of them quiet."""
    n_bands = patches.shape[3]
    bands = np.array([_least(patches[..., band : band + 1], n_quiet) for band in each(range(n_bands))])
    if n_bands == 1 or not bands.max():
        return bands
    # Bands have texture in common, so that together they have more directions without it.
    bands = np.maximum(bands, 1e-3 * bands.max())
    return np.asarray(bands * _least(patches / bands, n_quiet))


def _least(patches: _Doubles, n_quiet: int) -> float:
    """Return the standard deviation of patches in the directions in which they vary least, which only noise fills."""
    even, odd = _halves_of(patches)
    n_quiet = min(max(n_quiet, _MEASURING.per_value * even[0].size), len(patches))
    found = [_powers(even[_order_of(odd)[:n_quiet]]), _powers(odd[_order_of(even)[:n_quiet]])]
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
        found[number] = _levels_of(look)
    if any(np.isnan(found[number]).any() for number in numbers):
        found = [_scattered(versions, number) for number in range(versions.n_versions)]
    return list(_by_differences(versions, np.stack(found))) if alike and versions.n_versions > 1 else found


def _scattered(versions: Versions, version: int) -> _Doubles:
    """(C,) noise in each band, where clipping took none of it away, if there is enough of that."""
    from scipy.ndimage import uniform_filter

    values, known = versions.bands(version), versions.known[:, :, version]
    found: _Doubles = scattered_noise(values, known)
    share = np.maximum(uniform_filter(known.astype(np.float32), 5), 1e-3)[:, :, None]
    inside = versions.is_inside(uniform_filter(values, (5, 5, 0)) / share, _MEASURING.margin * found)
    again = [
        scattered_noise(values[:, :, [band]], known & one)[0] for band, one in enumerate(np.moveaxis(inside, 2, 0))
    ]
    return np.where(np.isnan(again), found, again)


def _by_differences(versions: Versions, alone: _Doubles) -> _Doubles:
    """(S, C) noise: variances that explain what versions differ by, and are no larger than those of each `alone`."""
    n, squares = versions.n_versions, np.maximum(alone**2, 1e-30)
    pairs = sorted({(min(a, b), max(a, b)) for a in range(n) for b in ((a + 1) % n, (a + 2) % n) if a != b})
    told = np.array([_variance_between(versions, *pair, alone) for pair in pairs])
    known = np.isfinite(told).all(axis=1)
    sums = np.array([[number in pair for number in range(n)] for pair in pairs], np.float64)[known]
    steps, noise, errors = np.eye(n) - np.roll(np.eye(n), 1, axis=1), alone.copy(), _MEASURING.errors
    for band, (own, apart) in enumerate(zip(squares.T, told[known].T, strict=True)):
        if np.isfinite(own).all() and apart.min(initial=np.inf) > _MEASURING.copies * own.min() and len(apart):
            after = np.roll(own, -1)  # versions that are compared when each is measured alone
            rows, values = np.concatenate([sums, steps, np.eye(n)]), np.concatenate([apart, own - after, own])
            scales = [error * size for error, size in zip(errors, (apart, np.maximum(own, after), own), strict=True)]
            weights = 1 / np.maximum(np.concatenate(scales), 1e-4 * own.max())
            found = np.linalg.lstsq(rows * weights[:, None], values * weights)[0]
            noise[:, band] = np.sqrt(np.clip(found, np.minimum(_MEASURING.least * apart.min(), own), own))
    return noise


def _variance_between(versions: Versions, one: int, other: int, alone: _Doubles) -> _Doubles:
    """(C,) variance of the difference of two versions where both know a pixel; NaN if there are few."""
    both = np.flatnonzero(versions.known[:, :, one] & versions.known[:, :, other])
    if len(both) < _MEASURING.enough:
        return np.full(alone.shape[1], np.nan)
    both = both[:: -(-len(both) // _MEASURING.most_pixels)]
    left, right = (versions.bands(number).reshape(-1, alone.shape[1])[both] for number in (one, other))
    inside = versions.is_inside((left + right) / 2, _MEASURING.margin * alone[[one, other]].max(axis=0))
    found = [(apart, apart[seen]) for apart, seen in zip((left - right).T, inside.T, strict=True)]
    return np.array([lower_variance(some if len(some) >= _MEASURING.enough else every) for every, some in found])


# --- noise whose variance follows the level, as that of light does
# A. Foi et al., IEEE Trans. Image Processing 17 (2008) 1737-1754, doi 10.1109/TIP.2008.2001399, for the model.


def bend_of(versions: Versions, *, in_place: bool) -> Bend | None:
    """Find how noise follows the level, in all versions together; None if it is even or too little is known."""
    levels, variances, usual = [], [], []
    for look in looks_at(versions, in_place=in_place):
        patches, means = look.patches(_MEASURING.sides[0])
        parts = np.array_split(np.argsort(means.mean(axis=1), kind="stable"), _MEASURING.classes)
        if not len(patches) or len(parts[-1]) < 3 * patches[:1].size:
            continue
        squares = np.array([np.square(_levels_in(patches[part], look.quiet(len(part)))) for part in each(parts)])
        levels += [means[part].mean(axis=0) for part in parts]
        # Versions may be more or less noisy; what matters is how noise changes with the level.
        usual.append(squares.mean(axis=0))
        variances.append(squares / np.maximum(usual[-1], 1e-30))
    if not usual or np.min(usual) <= 0:
        return None
    lines = _lines(np.array(levels), np.concatenate(variances))
    if lines is None:
        return None
    low, high = (float(np.min(levels)), float(np.max(levels))) if versions.white is None else (0.0, versions.white)
    least = _MEASURING.least * np.min(np.concatenate(variances))
    first, last = (np.maximum(lines @ [1, end], least) for end in (low, high))
    return Bend.between(first * (mean := np.mean(usual, axis=0)), last * mean, low, high)


def _lines(levels: _Doubles, variances: _Doubles) -> _Doubles | None:
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
    return np.array(lines) if by_chance < _MEASURING.chance else None


# --- noise that neighboring pixels and bands share, as demosaicing, scaling and compression leave it
# It is measured in quiet blocks, chosen as for the level. What bands have in common and grows from the quietest to
# louder ones is texture: that much of it, and more, is taken away, but nothing of the white noise that is there.


def shared_noise(versions: Versions, *, in_place: bool) -> SharedNoise | None:
    """Find the noise that pixels share, a mean over versions; None where it is white or too little is known."""
    grain = _MEASURING.grain * 256 * versions.rounding
    found = [one for look in looks_at(versions, in_place=in_place) if (one := _shared_in(look, grain)) is not None]
    return SharedNoise(np.mean(found, axis=0)) if found else None


def _shared_in(look: Look, grain: float) -> _Doubles | None:
    """(2 L + 1, 2 L + 1, C, C) autocovariance of what pixels share; None where noise is white or too little known."""
    how = _MEASURING
    blocks, _ = look.patches(how.side, how.blocks)
    level = _levels_of(look).min()
    first, second, third = (int(share * len(blocks)) for share in how.groups)
    if first < how.fewest or not level > 0:
        return None
    blocks = _without_slopes(blocks / level)
    turned = blocks[:, ::-1, ::-1]
    even, odd = _halves_of(blocks)
    halves = ((blocks + turned) / 2, _order_of(odd)), ((blocks - turned) / 2, _order_of(even))
    side = np.hanning(how.side + 2)[1:-1]
    window, sides = np.outer(side, side), (2 * how.side,) * 2

    def spectrum(group: slice) -> _Doubles:
        """(X, Y, C, C) mean of the products of the bands of waves of some blocks."""
        waves = [np.fft.rfft2(half[order[group]] * window[:, :, None], sides, axes=(1, 2)) for half, order in halves]
        return np.asarray(sum(np.einsum("bxyi,bxyj->xyij", one, one.conj()) / len(one) for one in waves))

    frequencies = np.hypot(np.fft.fftfreq(sides[0])[:, None], np.fft.rfftfreq(sides[1]))
    white = np.square(window).sum()
    quiet = spectrum(slice(first if look.has_texture else look.quiet(len(blocks))))
    if look.has_texture:
        quiet = quiet - _texture_in(quiet, spectrum(slice(second, third)), white, frequencies)
    squares, axes = np.linalg.eigh(quiet)
    squares = np.maximum(squares, white)
    power = squares[frequencies >= how.high].mean() / white  # texture that all bands share leaves none
    if power < how.power or (look.has_texture and power * level**2 < grain**2):
        return None
    powers = np.einsum("xyij,xyj,xykj->xyik", axes, squares, axes.conj()) * level**2
    lags = np.ix_(*(np.arange(-LAGS, LAGS + 1),) * 2)
    weight = np.fft.irfft2(np.square(np.abs(np.fft.rfft2(window, sides))), sides)[lags]
    return np.asarray(np.fft.irfft2(powers, sides, axes=(0, 1))[lags] / weight[:, :, None, None])


def _texture_in(quiet: _Doubles, louder: _Doubles, white: float, frequencies: _Doubles) -> _Doubles:
    """(X, Y, 1, 1) part of the spectrum of quiet blocks in each pair of bands that is texture."""
    how, n_bands = _MEASURING, quiet.shape[2]
    rings = (frequencies * how.rings).astype(np.intp)

    def by_ring(values: NDArray[Any]) -> _Doubles:
        return np.bincount(rings.ravel(), values.real.ravel()).astype(np.float64)

    first, next_ = (by_ring(np.einsum("xyii->xy", one)) for one in (quiet, louder))
    together = quiet.sum(axis=(2, 3)).real / n_bands
    common = by_ring(together)
    apart = (first - common) / max(n_bands - 1, 1)
    times, chance = how.texture
    noise = np.clip(1 - times * np.maximum(next_ / first - 1 - chance, 0), 0, 1) * np.maximum(common - apart, 0)
    noise += np.minimum(common, apart)
    if n_bands > 1:
        beyond = [by_ring(one - white)[1:].sum() for one in (np.einsum("xyii->xy", quiet) / n_bands, together)]
        if beyond[1] > how.common * n_bands * beyond[0]:
            noise[:] = 0.0
        # Texture grows toward low frequencies; there, noise has no more in common than at middle ones.
        ratios, middle = noise / np.maximum(apart, 1e-30), how.rings // 3
        ratios[:middle] = np.minimum.accumulate(ratios[middle::-1])[:0:-1]
        noise = np.minimum(noise, ratios * apart)
    return np.asarray((1 - noise / np.maximum(common, 1e-30))[rings] * together / n_bands)[:, :, None, None]


def _without_slopes(blocks: _Doubles) -> _Doubles:
    """Blocks less the plane that fits each best."""
    along = np.arange(blocks.shape[1]) - (blocks.shape[1] - 1) / 2
    planes = np.stack([np.ones(along.size**2), *(one.ravel() for one in np.meshgrid(along, along))], axis=1)
    planes /= np.linalg.norm(planes, axis=0)
    rows = blocks.reshape(len(blocks), -1, blocks.shape[3])
    return np.asarray(rows - planes @ (planes.T @ rows)).reshape(blocks.shape)
