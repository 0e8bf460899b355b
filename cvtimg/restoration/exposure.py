"""Exposure and white balance of versions that were put in place: a gain and an offset for each band, to the first."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import side_by_side
from cvtimg.restoration.versions import Versions

_Doubles = NDArray[np.float64]

#: Side of the blocks whose means are compared, and how many are compared at least and at most.
_SIDE, _BLOCKS = 8, (32, 1000)
#: Share of the pixels of a block that are clipped at black and at white, which bias its mean.
_CLIPPED = (0.3, 0.03)
#: Part of the variance of the first version that a line leaves, and the gain, at most.
_LEFT, _LARGEST = 0.1, 4.0
#: Gain below which a version is a longer exposure, which knows nothing within the other part of the range from white.
_LONGER, _NEAR_WHITE = 0.95, 1 / 16


def exposures(placed: Versions) -> _Doubles:
    """(S, C, 2) gain and offset of each version in place that bring it to the levels of the first."""
    n_bands = placed.stack[0].shape[2]
    found = np.tile([1.0, 0.0], (placed.n_versions, n_bands, 1))
    first, first_known = _blocks(placed, 0)
    for version in range(1, placed.n_versions):
        values, known = _blocks(placed, version)
        both = np.flatnonzero(first_known & known)
        if len(both) >= _BLOCKS[0]:
            both = both[:: -(-len(both) // _BLOCKS[1])]
            lines = [*side_by_side(_line, [*zip(values[both].T, first[both].T, strict=True)])]
            if not any(line is None for line in lines):
                found[version] = lines
    return found


def equalized(versions: Versions, tones: _Doubles) -> Versions:
    """Bring versions to the levels of the first; what longer exposures show near white is unknown."""
    from scipy.ndimage import uniform_filter

    known, most = versions.known.copy(), (1 - _NEAR_WHITE) * (versions.white or np.inf)
    for version in np.flatnonzero((tones[:, :, 0] < _LONGER).any(axis=1)):
        mean = uniform_filter(versions.bands(int(version)), (5, 5, 0))
        known[:, :, version] &= (mean < most).all(axis=2)
    return replace(versions, known=known, tones=tones)


def _blocks(versions: Versions, version: int) -> tuple[_Doubles, NDArray[np.bool_]]:
    """(B, C) means of the known pixels of blocks, and (B,) whether most are known and few clipped."""
    from skimage.measure import block_reduce

    reduced: Any = block_reduce

    def mean(image: NDArray[np.generic]) -> _Doubles:
        whole = image[tuple(slice(size // _SIDE * _SIDE) for size in image.shape[:2])].astype(np.float64)
        return np.asarray(reduced(whole, (_SIDE, _SIDE, 1), np.mean)).reshape(-1, image.shape[2])

    values, seen = versions.bands(version), versions.known[:, :, [version]]
    share, white = mean(seen), versions.white
    known = share[:, 0] >= 0.5
    if white is not None:
        for clipped, most in zip((values <= 0, values >= white), _CLIPPED, strict=True):
            known &= mean(seen & clipped.any(axis=2, keepdims=True))[:, 0] < most
    return mean(values) / np.maximum(share, 1e-9), known


def _line(pairs: tuple[_Doubles, _Doubles]) -> tuple[float, float] | None:
    """Gain and offset from values to those wanted, most of which are on a line; None if they are on none."""
    from scipy.stats import theilslopes

    values, wanted = pairs
    # What is left of noise and of motion, in both, biases the slope of a regression of either on the other alike.
    slopes = [theilslopes(*pair).slope for pair in ((wanted, values), (values, wanted))]
    gain = float(np.sqrt(max(slopes[0], 0) / slopes[1])) if slopes[1] > 0 else 0.0
    offset = float(np.median(wanted - gain * values))
    scale = 1.4826 * np.median(np.abs(gain * values + offset - wanted))
    return (gain, offset) if scale**2 < _LEFT * np.var(wanted) and 1 / _LARGEST < gain < _LARGEST else None
