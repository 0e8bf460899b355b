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

from cvtimg.restoration.noise import Look, halves_of, levels_of, looks_at, order_of
from cvtimg.restoration.versions import Versions

_Doubles = NDArray[np.float64]

#: Pixels farther apart than this share no noise.
LAGS = 6


@dataclass(frozen=True, slots=True)
class _Telling:
    """What tells noise that pixels share from texture."""

    side: int = 16  # of the blocks whose spectra are compared: room for the lags, with a window
    most: int = 1 << 12  # blocks that are looked at
    enough: int = 12  # blocks in the quietest group
    groups: tuple[float, float, float] = (0.03, 0.1, 0.25)  # shares of the blocks, from quiet to loud, that end groups
    rings: tuple[float, ...] = (0.12, 0.2, 0.28, 0.36, 0.44)  # cycles per pixel between which power is compared
    texture: float = 3.0  # times what grows from group to group is texture, but for a tenth, which is chance
    common: tuple[float, float] = (0.8, 0.9)  # part that bands share: texture if it grows, and in any case
    growth: float = 1.2  # from the first group to the last that noise has not
    power: float = 2.0  # of shared noise, as a multiple of that of white noise, from the second ring on
    grain: float = 0.01  # of the range of levels: a picture may have less of its own


_TELLING = _Telling()


@dataclass(frozen=True, slots=True, eq=False)
class SharedNoise:
    """Noise with one autocovariance everywhere."""

    #: (2 L + 1, 2 L + 1, C, C): covariance of the bands of a pixel with those of one so many rows and columns away
    autocovariance: _Doubles

    @classmethod
    def of(cls, noise: _Doubles) -> SharedNoise:
        """Measure (H, W, C) noise that goes on at its other end."""
        waves = np.fft.rfft2(noise, axes=(0, 1))
        powers = np.einsum("xyi,xyj->xyij", waves, waves.conj()) / noise[:, :, 0].size
        return cls(np.fft.irfft2(powers, noise.shape[:2], axes=(0, 1))[np.ix_(*(np.arange(-LAGS, LAGS + 1),) * 2)])

    @classmethod
    def white(cls, variance: float, n_bands: int) -> SharedNoise:
        """Noise of which pixels share nothing."""
        found = np.zeros((2 * LAGS + 1, 2 * LAGS + 1, n_bands, n_bands))
        found[LAGS, LAGS] = variance * np.eye(n_bands)
        return cls(found)

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
        """(P, P) covariance of the noise of patches, as a part of its mean variance; some in each direction."""
        lags = len(self.autocovariance) // 2
        reach = max(side - 1 - lags, 0)
        wide = np.pad(self.autocovariance, ((reach, reach), (reach, reach), (0, 0), (0, 0)))
        places = np.indices((side, side)).reshape(2, -1).T
        rows, columns = np.moveaxis(places[:, None] - places, 2, 0) + lags + reach
        size = side**2 * wide.shape[2]
        covariance = wide[rows, columns].transpose(0, 2, 1, 3).reshape(size, size)
        values, axes = np.linalg.eigh((covariance + covariance.T) / 2)
        raised = (axes * np.maximum(values, 0.01 * values.mean())) @ axes.T
        return np.asarray(raised * (size / np.trace(raised)))


def shared_noise(versions: Versions, *, in_place: bool) -> SharedNoise | None:
    """Find the noise that pixels share, a mean over versions; None where it is white or too little is known."""
    grain = _TELLING.grain * 256 * versions.rounding
    found = [one for look in looks_at(versions, in_place=in_place) if (one := _measured(look, grain)) is not None]
    return SharedNoise(np.mean(found, axis=0)) if found else None


def _measured(look: Look, grain: float) -> _Doubles | None:
    """(2 L + 1, 2 L + 1, C, C) autocovariance of what pixels share; None where noise is white or too little known."""
    tell = _TELLING
    blocks, _ = look.patches(tell.side, tell.most)
    level = levels_of(look).min()
    ends = [int(share * len(blocks)) for share in tell.groups]
    if ends[0] < tell.enough or not level > 0:
        return None
    blocks = _without_slopes(blocks / level)
    turned = blocks[:, ::-1, ::-1]
    even, odd = halves_of(blocks)
    chosen = ((blocks + turned) / 2, order_of(odd)), ((blocks - turned) / 2, order_of(even))
    side = np.hanning(tell.side + 2)[1:-1]
    window = np.outer(side, side)
    sides = (2 * tell.side,) * 2
    frequencies = np.hypot(np.fft.fftfreq(sides[0])[:, None], np.fft.rfftfreq(sides[1]))

    def spectrum(group: slice) -> NDArray[Any]:
        """(X, Y, C, C) mean of the products of the bands of waves of some blocks."""
        found = np.zeros((*frequencies.shape, *[blocks.shape[3]] * 2), np.complex128)
        for half, order in chosen:
            some = (half[order[group]] * window[:, :, None]).astype(np.float32)
            waves = np.fft.rfft2(some, sides, axes=(1, 2))
            found += np.einsum("bxyi,bxyj->xyij", waves, waves.conj()) / len(waves)
        return found

    quiet = spectrum(slice(ends[0] if look.has_texture else len(blocks) // 2))
    white = np.square(window).sum()
    if look.has_texture:
        left = _left_of(quiet, [spectrum(group) for group in starmap(slice, pairwise(ends))], white, frequencies)
        if left is None:
            return None
        quiet = left
    squares, axes = np.linalg.eigh(quiet)
    squares = np.maximum(squares, white)
    power = squares[frequencies >= tell.rings[1]].mean() / white
    if power < tell.power or (look.has_texture and power * level**2 < grain**2):
        return None
    powers = np.einsum("xyij,xyj,xykj->xyik", axes, squares, axes.conj()) * level**2
    lags = np.ix_(*(np.arange(-LAGS, LAGS + 1),) * 2)
    weight = np.fft.irfft2(np.square(np.abs(np.fft.rfft2(window, sides))), sides)[lags]
    return np.asarray(np.fft.irfft2(powers, sides, axes=(0, 1))[lags] / weight[:, :, None, None])


def _left_of(
    quiet: NDArray[Any], louder: list[NDArray[Any]], white: float, frequencies: _Doubles
) -> NDArray[Any] | None:
    """Take texture out of the spectrum of quiet blocks; None if all of it may be texture."""
    # Texture grows from group to group, and bands have it in common; noise of power `white` is none of it.
    tell, n_bands = _TELLING, quiet.shape[2]
    rings = np.digitize(frequencies, tell.rings)

    def by_ring(values: NDArray[Any]) -> _Doubles:
        return np.bincount(rings.ravel(), values.ravel()).astype(np.float64)

    first, *rest = (by_ring(np.einsum("xyii->xy", one).real) for one in (quiet, *louder))
    near, far = (power / first for power in rest)
    telling = frequencies >= tell.rings[0]
    shared = quiet[telling].sum(axis=0).real - white * np.count_nonzero(telling) * np.eye(n_bands)
    common = shared.sum() / max(n_bands * np.trace(shared), 1e-30)
    if (common > tell.common[1] and n_bands > 1) or (common > tell.common[0] and far.mean() > tell.growth):
        return None
    # Of what bands have in common beyond what they have apart, a part is left.
    part = np.clip(1 - tell.texture * np.maximum(near - 1.1, 0), 0, 1)
    commons = by_ring(together := quiet.sum(axis=(2, 3)).real / n_bands)
    aparts = (first - commons) / max(n_bands - 1, 1)
    noises = np.minimum(commons, aparts) + part * np.maximum(commons - aparts, 0)
    if n_bands > 1:
        # Texture grows toward low frequencies; there, noise has no more in common than at middle ones.
        ratios, middle = noises / np.maximum(aparts, 1e-30), len(tell.rings) // 2 + 1
        ratios[:middle] = np.minimum.accumulate(ratios[middle::-1])[:0:-1]
        noises = np.minimum(noises, ratios * aparts)
    texture = (1 - noises / np.maximum(commons, 1e-30))[rings] * together
    return np.asarray(quiet - (texture / n_bands)[:, :, None, None])


def _without_slopes(blocks: _Doubles) -> _Doubles:
    """Blocks less the plane that fits each best."""
    blocks = blocks - blocks.mean(axis=(1, 2), keepdims=True)
    along = np.arange(blocks.shape[1]) - (blocks.shape[1] - 1) / 2
    along /= np.sqrt(np.square(along).sum() * len(along))
    down = np.einsum("bxyc,x->bc", blocks, along)[:, None, None] * along[:, None, None]
    right = np.einsum("bxyc,y->bc", blocks, along)[:, None, None] * along[None, :, None]
    return np.asarray(blocks - down - right)
