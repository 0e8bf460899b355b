"""Exposure and white balance of versions that were put in place: a gain and an offset for each band, to the first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Versions

_Doubles = NDArray[np.float64]

#: Side of the blocks whose means are compared, the least share of known pixels in them, those from which on pixels that
#: are clipped at black and at white would bias the mean, and how many blocks must be left.
_SIDE, _KNOWN, _CLIPPED, _ENOUGH = 8, 0.5, (0.3, 0.03), 32
#: Steps of robust least squares, and the number of standard deviations that count half.
_STEPS, _OUTLYING = 8, 3.0
#: Part of the variance of the first version that a line must explain, and the largest gain.
_EXPLAINED, _LARGEST = 0.9, 4.0
#: Longer exposures than this know nothing near white: within this part of the range, on the mean of so many pixels.
_LONGER, _NEAR_WHITE, _AROUND = 0.95, 1 / 16, 5


def exposures(placed: Versions) -> _Doubles:
    """(S, C, 2) gain and offset of each version in place that bring it to the levels of the first."""
    n_bands = placed.stack[0].shape[2]
    found = np.tile([1.0, 0.0], (placed.n_versions, n_bands, 1))
    first, first_known = _blocks(placed, 0)
    for version in range(1, placed.n_versions):
        values, known = _blocks(placed, version)
        both = first_known & known
        if np.count_nonzero(both) >= _ENOUGH:
            lines = [_line(values[both, band], first[both, band]) for band in range(n_bands)]
            if not any(line is None for line in lines):
                found[version] = lines
    return found


def equalized(versions: Versions, tones: _Doubles) -> Versions:
    """Bring versions to the levels of the first; what longer exposures show near white is unknown."""
    from scipy.ndimage import uniform_filter

    longer = np.flatnonzero((tones[:, :, 0] < _LONGER).any(axis=1))
    if versions.white is None or not len(longer):
        return replace(versions, tones=tones)
    known = versions.known.copy()
    for version in longer:
        mean = uniform_filter(versions.bands(int(version)), (_AROUND, _AROUND, 0))
        known[:, :, version] &= (mean < (1 - _NEAR_WHITE) * versions.white).all(axis=2)
    return replace(versions, known=known, tones=tones)


def _blocks(versions: Versions, version: int) -> tuple[_Doubles, NDArray[np.bool_]]:
    """(B, C) means of the known pixels of blocks, and (B,) whether they are known and not clipped."""
    height, width = (side // _SIDE for side in versions.known.shape[:2])
    rows, columns = slice(height * _SIDE), slice(width * _SIDE)
    shape = height, _SIDE, width, _SIDE
    values = versions.bands(version, rows)[:, columns]
    seen = versions.known[rows, columns, version]
    share = seen.reshape(shape).mean(axis=(1, 3)).ravel()
    means = values.reshape(*shape, values.shape[2]).mean(axis=(1, 3), dtype=np.float64).reshape(-1, values.shape[2])
    known = share >= _KNOWN
    if versions.white is not None:
        for clipped, most in zip((values <= 0, values >= versions.white), _CLIPPED, strict=True):
            known &= (seen & clipped.any(axis=2)).reshape(shape).mean(axis=(1, 3)).ravel() < most
    return means / np.maximum(share, 1e-9)[:, None], known


def _line(values: _Doubles, wanted: _Doubles) -> tuple[float, float] | None:
    """Gain and offset from values to those wanted, most of which are on a line; None if they are on none."""
    # It begins with the median of the slopes from darker to brighter blocks, which others at the ends do not bend.
    order, half = np.argsort(values), len(values) // 2
    dark, bright = order[:half], order[-half:]
    gain = np.median((wanted[bright] - wanted[dark]) / np.maximum(values[bright] - values[dark], 1e-9))
    offset = np.median(wanted - gain * values)
    for _ in range(_STEPS):
        apart = gain * values + offset - wanted
        scale = 1.4826 * np.median(np.abs(apart)) + 1e-30
        weight = 1 / (1 + (apart / (_OUTLYING * scale)) ** 2)
        # The ratio of deviations: what is left of noise and of motion, in both, would bias the slope of a regression.
        center, middle = np.average(values, weights=weight), np.average(wanted, weights=weight)
        squares = [np.sum(weight * np.square(one)) for one in (wanted - middle, values - center)]
        gain = np.sqrt(squares[0] / max(squares[1], 1e-30))
        offset = middle - gain * center
    explained = scale**2 < (1 - _EXPLAINED) * np.var(wanted)
    return (float(gain), float(offset)) if explained and 1 / _LARGEST < gain < _LARGEST else None
