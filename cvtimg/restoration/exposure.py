"""Exposure and white balance of versions that were put in place: a gain and an offset for each band, to the first."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Versions

_Doubles = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Lines:
    """What a gain and an offset are found from, and where they are believed."""

    side: int = 8  # of the blocks whose means are compared
    known: float = 0.5  # share of their pixels at least
    clipped: tuple[float, float] = (0.3, 0.03)  # share of pixels clipped at black and at white that bias the mean
    enough: int = 32  # blocks
    outlying: float = 3.0  # standard deviations that count half
    explained: float = 0.9  # of the variance of the first version, at least
    largest: float = 4.0  # gain
    longer: float = 0.95  # gain below which a version is a longer exposure, which knows nothing near white:
    near_white: float = 1 / 16  # within this part of the range, on the mean of 5 x 5 pixels


_LINES = _Lines()


def exposures(placed: Versions) -> _Doubles:
    """(S, C, 2) gain and offset of each version in place that bring it to the levels of the first."""
    n_bands = placed.stack[0].shape[2]
    found = np.tile([1.0, 0.0], (placed.n_versions, n_bands, 1))
    first, first_known = _blocks(placed, 0)
    for version in range(1, placed.n_versions):
        values, known = _blocks(placed, version)
        both = first_known & known
        if np.count_nonzero(both) >= _LINES.enough:
            lines = [_line(values[both, band], first[both, band]) for band in range(n_bands)]
            if not any(line is None for line in lines):
                found[version] = lines
    return found


def equalized(versions: Versions, tones: _Doubles) -> Versions:
    """Bring versions to the levels of the first; what longer exposures show near white is unknown."""
    from scipy.ndimage import uniform_filter

    known, most = versions.known.copy(), (1 - _LINES.near_white) * (versions.white or np.inf)
    for version in np.flatnonzero((tones[:, :, 0] < _LINES.longer).any(axis=1)):
        mean = uniform_filter(versions.bands(int(version)), (5, 5, 0))
        known[:, :, version] &= (mean < most).all(axis=2)
    return replace(versions, known=known, tones=tones)


def _blocks(versions: Versions, version: int) -> tuple[_Doubles, NDArray[np.bool_]]:
    """(B, C) means of the known pixels of blocks, and (B,) whether they are known and not clipped."""
    side = _LINES.side
    height, width = (size // side for size in versions.known.shape[:2])
    rows, columns, shape = slice(height * side), slice(width * side), (height, side, width, side)
    values = versions.bands(version, rows)[:, columns]
    seen = versions.known[rows, columns, version]
    share = seen.reshape(shape).mean(axis=(1, 3)).ravel()
    means = values.reshape(*shape, values.shape[2]).mean(axis=(1, 3), dtype=np.float64).reshape(-1, values.shape[2])
    known = share >= _LINES.known
    if versions.white is not None:
        for clipped, most in zip((values <= 0, values >= versions.white), _LINES.clipped, strict=True):
            known &= (seen & clipped.any(axis=2)).reshape(shape).mean(axis=(1, 3)).ravel() < most
    return means / np.maximum(share, 1e-9)[:, None], known


def _line(values: _Doubles, wanted: _Doubles) -> tuple[float, float] | None:
    """Gain and offset from values to those wanted, most of which are on a line; None if they are on none."""
    # It begins with the median of the slopes from darker to brighter blocks, which others at the ends do not bend.
    order, half = np.argsort(values), len(values) // 2
    dark, bright = order[:half], order[-half:]
    gain = np.median((wanted[bright] - wanted[dark]) / np.maximum(values[bright] - values[dark], 1e-9))
    offset = np.median(wanted - gain * values)
    for _ in range(8):
        apart = gain * values + offset - wanted
        scale = 1.4826 * np.median(np.abs(apart)) + 1e-30
        weight = 1 / (1 + (apart / (_LINES.outlying * scale)) ** 2)
        # The ratio of deviations: what is left of noise and of motion, in both, would bias the slope of a regression.
        center, middle = np.average(values, weights=weight), np.average(wanted, weights=weight)
        squares = [np.sum(weight * np.square(one)) for one in (wanted - middle, values - center)]
        gain = np.sqrt(squares[0] / max(squares[1], 1e-30))
        offset = middle - gain * center
    explained = scale**2 < (1 - _LINES.explained) * np.var(wanted)
    return (float(gain), float(offset)) if explained and 1 / _LINES.largest < gain < _LINES.largest else None
