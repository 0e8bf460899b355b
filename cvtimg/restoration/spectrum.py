"""Noise that neighboring pixels and bands share, as demosaicing, scaling and compression leave it: its autocovariance.

It is measured where an image is quiet, or where versions differ. Whitening patches by it makes their noise that of a
sensor again, for which the filters of groups are.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Floats, Versions

_Doubles = NDArray[np.float64]

#: Pixels farther apart than this share no noise.
LAGS = 6
#: Side of the blocks whose spectra are compared, and pixels from one to the next.
_BLOCK, _STEP = 16, 8
#: This share of all blocks, the quieter ones, tells of noise; and at least this many must.
_QUIET, _ENOUGH = 0.08, 24
#: At each frequency, this share of these, those with the least power, counts, so that edges that a block has do not.
_LOWER = 0.5
#: Correlation of bands in quiet blocks, by their texture, where their noise has none.
_TEXTURE = 0.25
#: At most this many blocks are looked at; and of differences of versions, where all of them tell of noise.
_MOST, _MOST_APART = 1 << 12, 1 << 8
#: Versions that differ by more than this times the power of their quiet blocks differ by more than noise.
_IN_PLACE = 2.0
#: Blocks whose mean is nearer to an end than this part of the range have lost noise by clipping.
_FROM_ENDS = 1 / 16
#: Frequencies, in cycles per pixel, between which power is middle, and from which on it is high; noise whose powers
#: differ by a larger factor is not white.
_MIDDLE, _HIGH, _WHITE = (0.15, 0.3), 0.42, 3.5
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
    # Versions that are in place differ by noise alone.
    known = np.moveaxis(versions.known, 2, 0)
    numbers = np.flatnonzero(known.any(axis=(1, 2))).tolist()
    alone = (_measured(versions.bands(s), known[s], versions.white, _QUIET) for s in numbers)
    if in_place and len(numbers) > 1:
        pairs = pairwise(numbers)
        apart = (
            ((versions.bands(a) - versions.bands(b)) * np.float32(np.sqrt(0.5)), known[a] & known[b]) for a, b in pairs
        )
        powers, own = _mean([_measured(*one, None, 1.0) for one in apart]), next(alone)
        if powers is not None and own is not None and _total(powers) > _IN_PLACE * _total(own):
            powers = _mean([own, *alone])
    else:
        powers = _mean(list(alone))
    return None if powers is None or _is_white(powers) else SharedNoise(_autocovariance(powers))


def _mean(found: list[NDArray[Any] | None]) -> NDArray[Any] | None:
    """Mean of the spectra that are known; None if none is."""
    told = [powers for powers in found if powers is not None]
    return np.asarray(np.mean(told, axis=0)) if told else None


def _total(powers: NDArray[Any]) -> float:
    """Power of all frequencies and bands."""
    return float(np.einsum("xyii->", powers).real)


def _measured(values: Floats, known: NDArray[np.bool_], white: float | None, share: float) -> NDArray[Any] | None:
    """(2 n, 2 n, C, C) spectrum of the noise in a share of the blocks, the quieter ones, or None if there are few."""
    from scipy.special import gammainc, gammaincinv

    blocks = blocks_of(values, known, _MOST if share < 1 else _MOST_APART)
    means = blocks.mean(axis=(1, 2))
    if white is not None:
        inside = (means.min(axis=1) > _FROM_ENDS * white) & (means.max(axis=1) < (1 - _FROM_ENDS) * white)
        blocks = blocks[inside] if np.count_nonzero(inside) >= _ENOUGH else blocks
    if len(blocks) < _ENOUGH:
        return None
    rounding = np.finfo(np.float32).eps * np.abs(means).max()
    blocks = _without_slopes(blocks)
    variances = np.square(blocks).mean(axis=(1, 2, 3))
    quiet = blocks[np.argsort(variances)[: max(_ENOUGH, int(share * len(blocks)))]]
    squares, axes = np.linalg.eigh(np.einsum("bxyi,bxyj->ij", quiet, quiet) / quiet[:, :, :, 0].size)
    if squares[-1] <= rounding**2:
        return None
    scales = np.sqrt(np.maximum(squares, 1e-6 * squares[-1]))
    equal = quiet @ (axes / scales) * _window()[:, :, None]
    waves = np.fft.fft2(equal, (2 * _BLOCK, 2 * _BLOCK), axes=(1, 2))
    lower = np.argsort(np.square(np.abs(waves)).sum(axis=3), axis=0)[: int(_LOWER * len(quiet))]
    # Power follows a gamma distribution with as many degrees as there are independent bands at this frequency.
    powers = _mean_products(waves)
    total = np.einsum("xyii->xy", powers).real
    degrees = total**2 / np.maximum(np.square(np.abs(powers)).sum(axis=(2, 3)), 1e-30)
    part = gammainc(degrees + 1, gammaincinv(degrees, _LOWER)) / _LOWER
    powers = _mean_products(np.take_along_axis(waves, lower[..., None], 0)) / part[:, :, None, None]
    back = axes * scales
    powers = np.asarray(back @ powers @ back.T)
    return powers if share == 1 else _with_less_in_common(powers)


def _with_less_in_common(powers: NDArray[Any]) -> NDArray[Any]:
    """Lower what bands have in common: of blocks that are only quiet, it is texture in part, most of which is gray."""
    bands = powers.mean(axis=(0, 1)).real
    scales = np.sqrt(np.maximum(np.diag(bands), 1e-30))
    common = bands / np.outer(scales, scales)
    lower = np.maximum(common - _TEXTURE, 0) / (1 - _TEXTURE)
    return powers * np.divide(lower, common, out=np.ones_like(common), where=common > 0)


def _mean_products(waves: NDArray[Any]) -> NDArray[Any]:
    """(X, Y, C, C) mean of the products of bands of (B, X, Y, C) waves."""
    return np.asarray(np.einsum("bxyi,bxyj->xyij", waves, waves.conj()) / len(waves))


def blocks_of(values: Floats, known: NDArray[np.bool_], most: int = _MOST) -> _Doubles:
    """(B, n, n, C) blocks without holes, at most so many of them."""
    if min(known.shape) < _BLOCK:
        return np.empty((0, _BLOCK, _BLOCK, values.shape[2]))
    every = slice(None, None, _STEP)
    seen, whole = (np.lib.stride_tricks.sliding_window_view(one, (_BLOCK,) * 2, (0, 1)) for one in (values, known))
    rows, columns = np.nonzero(whole[every, every].all(axis=(2, 3)))
    drawn = np.linspace(0, len(rows) - 1, min(len(rows), most)).astype(np.intp)
    blocks = seen[every, every][rows[drawn], columns[drawn]]
    return np.moveaxis(blocks, 1, 3).astype(np.float64)


def _without_slopes(blocks: _Doubles) -> _Doubles:
    """Blocks less the plane that fits each best."""
    along = np.arange(_BLOCK) - (_BLOCK - 1) / 2
    basis = along / np.sqrt(np.square(along).sum() * _BLOCK)
    down = np.einsum("bxyc,x->bc", blocks, basis)[:, None, None] * basis[:, None, None]
    right = np.einsum("bxyc,y->bc", blocks, basis)[:, None, None] * basis[None, :, None]
    return blocks - blocks.mean(axis=(1, 2), keepdims=True) - down - right


def _window() -> _Doubles:
    """(n, n) weights that fall off to the borders of a block."""
    side = np.hanning(_BLOCK + 2)[1:-1]
    return np.outer(side, side)


def _is_white(powers: NDArray[Any]) -> bool:
    """Tell whether noise has about equal power at middle and at high frequencies."""
    along = np.fft.fftfreq(len(powers))
    frequency = np.hypot(along[:, None], along)
    middle = powers[(frequency >= _MIDDLE[0]) & (frequency <= _MIDDLE[1])].mean(axis=0).real
    high = powers[frequency >= _HIGH].mean(axis=0).real
    axes = np.linalg.eigh(middle)[1]
    low, top = (np.einsum("ci,cd,di->i", axes, power, axes) for power in (middle, high))
    return bool((top * _WHITE >= low).all() and (top <= low * _WHITE).all())


def _autocovariance(powers: NDArray[Any]) -> _Doubles:
    """(2 L + 1, 2 L + 1, C, C) autocovariance of noise with this spectrum under the window."""
    lags = np.arange(-LAGS, LAGS + 1)
    seen = np.fft.fft2(_window(), (2 * _BLOCK, 2 * _BLOCK))
    weight = np.fft.ifft2(np.square(np.abs(seen))).real[np.ix_(lags, lags)]
    return np.asarray(np.fft.ifft2(powers, axes=(0, 1)).real[np.ix_(lags, lags)] / weight[:, :, None, None])
