"""The level of the noise of images, measured where texture hides it least.

Texture and edges show in the part of a patch that is even about its center and in the odd part alike. The two parts of
noise, which is alike all over, know nothing of each other. So patches with a quiet odd part tell what noise is in even
parts, and the other way round: to choose by one and to measure in the other takes no noise away. Patches cut off at an
end of the levels have lost noise and are left out. In doubt there is less noise.

The level is that of the least eigenvalues of the covariance of patches: G. Chen, F. Zhu, P. A. Heng, ICCV 2015, doi
10.1109/ICCV.2015.62. To choose patches by their other half is our own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Floats, Versions

_Doubles = NDArray[np.float64]

#: Sides of patches: the largest of which there are this many times as many as they have values; and at most so many.
_SIDES, _PER_VALUE, _MOST = (8, 4), 10, 1 << 14
#: Patches with more than this share of values at an end of the levels are cut off.
_CUT_OFF = 0.02
#: The share of patches that are quiet, of an image and of what two versions of it differ by.
_QUIET, _QUIET_APART = 0.1, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What noise is measured in."""

    values: Floats  # (H, W, C): noise and, unless versions were subtracted, the image
    image: Floats  # (H, W, C): the image
    lost: Floats  # (H, W): share of the bands that are cut off; infinite where nothing is known
    has_texture: bool = True  # False where versions were subtracted

    @property
    def share(self) -> float:
        """Share of the patches that are quiet."""
        return _QUIET if self.has_texture else _QUIET_APART

    def patches(self, side: int, most: int = _MOST) -> tuple[_Doubles, _Doubles]:
        """(N, side, side, C) patches all over, about so many, and their levels, (N, C)."""
        height, width = (size - side + 1 for size in self.lost.shape)
        if min(height, width) < 1:
            return np.empty((0, side, side, self.values.shape[2])), np.empty((0, self.values.shape[2]))
        every = (slice(None, None, int(np.ceil(np.sqrt(max(height * width / most, 1))))),) * 2

        def seen(image: Floats) -> Floats:
            return np.lib.stride_tricks.sliding_window_view(image, (side, side), (0, 1))[every]

        inside = seen(self.lost).mean(axis=(2, 3)) <= _CUT_OFF
        patches = np.moveaxis(seen(self.values)[inside], 1, 3).astype(np.float64)
        return patches, seen(self.image)[inside].mean(axis=(2, 3), dtype=np.float64)


def looks_at(versions: Versions, *, in_place: bool) -> Iterator[Look]:
    """Yield what shows the noise of versions: each of them; or what two differ by, if they are `in_place`."""
    numbers = np.flatnonzero(versions.known.any(axis=(0, 1))).tolist()
    if in_place and len(numbers) > 1:
        for one, other in pairwise(numbers):
            left, right = versions.bands(one), versions.bands(other)
            lost = np.maximum(_lost(versions, one), _lost(versions, other))
            half = np.float32(np.sqrt(0.5))
            yield Look((left - right) * half, (left + right) * np.float32(0.5), lost, has_texture=False)
    else:
        yield from (Look(versions.bands(one), versions.bands(one), _lost(versions, one)) for one in numbers)


def _lost(versions: Versions, version: int) -> Floats:
    """(H, W) share of the bands of a version that are at an end of its levels; infinite where nothing is known."""
    values, known = versions.stack[version], versions.known[:, :, version]
    ends = (0, versions.white) if versions.white is not None else (values[known].min(), values[known].max())
    lost = ((values <= ends[0]) | (values >= ends[1])).mean(axis=2, dtype=np.float32)
    return np.where(known, lost, np.float32(np.inf))


def levels_of(look: Look) -> _Doubles:
    """(C,) standard deviation of the noise in each band; NaN where too usual is known or all is cut off."""
    n_bands = look.values.shape[2]
    for side in _SIDES:
        patches, _ = look.patches(side)
        if len(patches) >= _PER_VALUE * side**2 * n_bands:
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
    size = even[0].size
    n_quiet = min(max(int(share * len(patches)), _PER_VALUE * size), len(patches))
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
