"""Noise that neighboring pixels and bands share, as demosaicing, scaling and compression leave it: its autocovariance.

Whitening patches by it makes their noise that of a sensor again, for which the filters of groups are. It is measured in
quiet blocks, chosen as for the level. What grows from the quietest blocks to the next is texture: that much of it, and
more, is taken away, but nothing of the white noise that is known to be there.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, starmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.quiet import Look, halves_of, levels_of, looks_at, order_of
from cvtimg.restoration.versions import Versions

_Doubles = NDArray[np.float64]

#: Pixels farther apart than this share no noise.
LAGS = 6
#: Side of the blocks whose spectra are compared, how many are looked at, and how many must be in the quietest group.
_BLOCK, _MOST, _ENOUGH = 16, 1 << 12, 12
#: Shares of the blocks, from quiet to loud, at which groups end.
_GROUPS = 0.03, 0.1, 0.25
#: Frequencies, in cycles per pixel, between which power is compared.
_RINGS, _MIDDLE = np.array([0.12, 0.2, 0.28, 0.36, 0.44]), 3
#: Growth of power from group to group that is chance, and how many times what is more is texture.
_CHANCE, _TEXTURE = 0.1, 3.0
#: What differs from white noise is texture if bands have more than this part of it in common; or more than that, where
#: it does not grow by more than this factor from the first group to the last. One band has all in common.
_MOST_COMMON, _NEVER_COMMON, _MOST_GROWTH = 0.8, 0.9, 1.2
#: Noise is shared if from this frequency on it has more than this times the power of white noise, and more than that of
#: this part of the range of levels: the grain of a picture may have less.
_TELLING, _SHARED, _GRAIN = 0.2, 2.0, 0.01
#: Least variance of whitened noise in any direction, as a part of the mean.
_FLOOR = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class SharedNoise:
    """Noise with one autocovariance everywhere."""

    #: (2 L + 1, 2 L + 1, C, C): covariance of the bands of a pixel with those of one so many rows and columns away
    autocovariance: _Doubles

    @property
    def variance(self) -> float:
        """Mean variance of a band."""
        return float(np.trace(self.bands) / len(self.bands))

    @property
    def bands(self) -> _Doubles:
        """(C, C) covariance of the bands of a pixel."""
        middle = len(self.autocovariance) // 2
        return np.asarray(self.autocovariance[middle, middle])

    def along(self, matrix: _Doubles | None) -> SharedNoise:
        """Noise of bands times a matrix, (C, C)."""
        return self if matrix is None else SharedNoise(matrix.T @ self.autocovariance @ matrix)

    def of_bands(self, chosen: slice) -> SharedNoise:
        """Noise of some of the bands."""
        return SharedNoise(self.autocovariance[:, :, chosen, chosen])

    def halved(self) -> SharedNoise:
        """Noise of means of 2 x 2 pixels."""
        from scipy.ndimage import convolve1d

        smooth = self.autocovariance
        for axis in (0, 1):
            smooth = convolve1d(smooth, np.array([0.25, 0.5, 0.25]), axis, mode="constant")
        lags = len(smooth) // 2
        return SharedNoise(smooth[lags % 2 :: 2, lags % 2 :: 2])

    def of_patches(self, side: int) -> _Doubles:
        """(P, P) covariance of the noise of patches, as a part of its mean variance."""
        lags = len(self.autocovariance) // 2
        reach = max(side - 1 - lags, 0)
        wide = np.pad(self.autocovariance, ((reach, reach), (reach, reach), (0, 0), (0, 0)))
        places = np.indices((side, side)).reshape(2, -1).T
        rows, columns = np.moveaxis(places[:, None] - places, 2, 0) + lags + reach
        size = side**2 * wide.shape[2]
        covariance = wide[rows, columns].transpose(0, 2, 1, 3).reshape(size, size)
        values, axes = np.linalg.eigh((covariance + covariance.T) / 2)
        raised = (axes * np.maximum(values, _FLOOR * values.mean())) @ axes.T
        return np.asarray(raised * (size / np.trace(raised)))


def shared_noise(versions: Versions, *, in_place: bool) -> SharedNoise | None:
    """Find the noise that pixels share, a mean over versions; None where it is white or too little is known."""
    grain = _GRAIN * 256 * versions.rounding
    looks = looks_at(versions, in_place=in_place)
    found = [powers for look in looks if (powers := _measured(look, grain)) is not None]
    return SharedNoise(_autocovariance(np.mean(found, axis=0))) if found else None


def _measured(look: Look, grain: float) -> NDArray[Any] | None:
    """(2 n, n + 1, C, C) spectrum of the noise that pixels share; None where it is white or too little is known."""
    blocks, _ = look.patches(_BLOCK, _MOST)
    level = levels_of(look).min()
    groups = [int(share * len(blocks)) for share in _GROUPS]
    if groups[0] < _ENOUGH or not level > 0:
        return None
    blocks = _without_slopes(blocks / level)
    turned = blocks[:, ::-1, ::-1]
    even, odd = halves_of(blocks)
    chosen = ((blocks + turned) / 2, order_of(odd)), ((blocks - turned) / 2, order_of(even))
    first = groups[0] if look.has_texture else len(blocks) // 2

    def spectrum(group: slice) -> NDArray[Any]:
        return np.asarray(sum(_mean_products(_waves(half[order[group]])) for half, order in chosen))

    quiet, frequencies = spectrum(slice(first)), _frequencies()
    white = np.square(_window()).sum()
    if look.has_texture:
        rings = np.digitize(frequencies, _RINGS)
        powers = [_by_ring(one, rings) for one in (quiet, *map(spectrum, starmap(slice, pairwise(groups))))]
        near, far = (power / powers[0] for power in powers[1:])
        common = _common(quiet, white, frequencies)
        if (common > _NEVER_COMMON and blocks.shape[3] > 1) or (common > _MOST_COMMON and far.mean() > _MOST_GROWTH):
            return None
        left = np.clip(1 - _TEXTURE * np.maximum(near - 1 - _CHANCE, 0), 0, 1)[rings]
        quiet = _without_texture(quiet, left, rings)
    squares, axes = np.linalg.eigh(quiet)
    squares = np.maximum(squares, white)
    power = squares[frequencies >= _TELLING].mean() / white
    if power < _SHARED or (look.has_texture and power * level**2 < grain**2):
        return None
    found = np.einsum("xyij,xyj,xykj->xyik", axes, squares, axes.conj())
    return np.asarray(found * level**2)


def _by_ring(powers: NDArray[Any], rings: NDArray[np.intp]) -> _Doubles:
    """Power of each ring of frequencies, in all bands."""
    return np.bincount(rings.ravel(), np.einsum("xyii->xy", powers).real.ravel()).astype(np.float64)


def _common(powers: NDArray[Any], white: float, frequencies: _Doubles) -> float:
    """Return the part of what is not white that all bands have in common; 1 for one band."""
    shared = powers[frequencies >= _RINGS[0]].sum(axis=0).real
    shared = shared - white * np.count_nonzero(frequencies >= _RINGS[0]) * np.eye(len(shared))
    return float(shared.sum() / max(len(shared) * np.trace(shared), 1e-30))


def _without_texture(powers: NDArray[Any], left: _Doubles, rings: NDArray[np.intp]) -> NDArray[Any]:
    """Leave a part of what bands have in common beyond what they have apart, as texture has all of it."""
    n_bands = powers.shape[2]
    common = powers.sum(axis=(2, 3)).real / n_bands
    apart = (np.einsum("xyii->xy", powers).real - common) / max(n_bands - 1, 1)
    totals = [np.bincount(rings.ravel(), one.ravel()).astype(np.float64) for one in (common, apart, left)]
    commons, aparts, lefts = totals
    lefts = np.divide(lefts, np.bincount(rings.ravel()))
    noises = np.minimum(commons, aparts) + lefts * np.maximum(commons - aparts, 0)
    if n_bands > 1:
        # Texture grows toward low frequencies; there, noise has no more in common than at middle ones.
        ratios = noises / np.maximum(aparts, 1e-30)
        ratios[:_MIDDLE] = np.minimum.accumulate(ratios[_MIDDLE::-1])[:0:-1]
        noises = np.minimum(noises, ratios * aparts)
    texture = (1 - noises / np.maximum(commons, 1e-30))[rings] * common
    return np.asarray(powers - (texture / n_bands)[:, :, None, None])


def _without_slopes(blocks: _Doubles) -> _Doubles:
    """Blocks less the plane that fits each best."""
    along = np.arange(_BLOCK) - (_BLOCK - 1) / 2
    basis = along / np.sqrt(np.square(along).sum() * _BLOCK)
    down = np.einsum("bxyc,x->bc", blocks, basis)[:, None, None] * basis[:, None, None]
    right = np.einsum("bxyc,y->bc", blocks, basis)[:, None, None] * basis[None, :, None]
    return np.asarray(blocks - blocks.mean(axis=(1, 2), keepdims=True) - down - right)


def _waves(blocks: _Doubles) -> NDArray[Any]:
    """(B, 2 n, n + 1, C) waves of blocks under the window."""
    return np.fft.rfft2((blocks * _window()[:, :, None]).astype(np.float32), (2 * _BLOCK,) * 2, axes=(1, 2))


def _mean_products(waves: NDArray[Any]) -> NDArray[Any]:
    """(X, Y, C, C) mean of the products of bands of (B, X, Y, C) waves."""
    return np.asarray(np.einsum("bxyi,bxyj->xyij", waves, waves.conj()) / len(waves))


def _frequencies() -> _Doubles:
    """(2 n, n + 1) cycles per pixel of waves."""
    return np.hypot(np.fft.fftfreq(2 * _BLOCK)[:, None], np.fft.rfftfreq(2 * _BLOCK))


def _window() -> _Doubles:
    """(n, n) weights that fall off to the borders of a block."""
    side = np.hanning(_BLOCK + 2)[1:-1]
    return np.outer(side, side)


def _autocovariance(powers: NDArray[Any]) -> _Doubles:
    """(2 L + 1, 2 L + 1, C, C) autocovariance of noise with this spectrum under the window."""
    lags = np.arange(-LAGS, LAGS + 1)
    sides = (2 * _BLOCK,) * 2
    weight = np.fft.irfft2(np.square(np.abs(np.fft.rfft2(_window(), sides))), sides)[np.ix_(lags, lags)]
    return np.asarray(np.fft.irfft2(powers, sides, axes=(0, 1))[np.ix_(lags, lags)] / weight[:, :, None, None])
