"""Noise that near pixels and bands share, as demosaicing, scaling and compression leave it: its autocovariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_Doubles = NDArray[np.float64]

#: Pixels farther apart than this share no noise.
LAGS = 6
#: Part of its mean variance that noise has in any direction of a patch, so that the covariance has an inverse.
_LEAST = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class SharedNoise:
    """Noise with one autocovariance everywhere; whitening patches by it makes it that for which the filters are."""

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

    @property
    def neighbors(self) -> float:
        """Correlation of pixels next to each other in a row."""
        middle = len(self.autocovariance) // 2
        return float(np.trace(self.autocovariance[middle, middle + 1]) / np.trace(self.bands))

    def along(self, matrix: _Doubles | None) -> SharedNoise:
        """Noise of bands times a matrix, (C, D)."""
        return self if matrix is None else SharedNoise(matrix.T @ self.autocovariance @ matrix)

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
        raised = (axes * np.maximum(values, _LEAST * values.mean())) @ axes.T
        return np.asarray(raised * (size / np.trace(raised)))
