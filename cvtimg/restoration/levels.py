"""Noise whose variance follows the level, as that of light does: constant + slope x level.

The filters of groups take noise to be alike everywhere, so levels are bent. Constant and slope are found where images
are quiet, or where versions differ.

A. Foi et al., IEEE Trans. Image Processing 17 (2008) 1737-1754, doi 10.1109/TIP.2008.2001399, for the model.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.anscombe import Bend
from cvtimg.restoration.spectrum import blocks_of
from cvtimg.restoration.versions import Versions

_Doubles = NDArray[np.float64]

#: Blocks are sorted into this many classes by their level; of each, those between these shares are quiet.
_CLASSES, _QUIET = 8, (0.05, 0.25)
#: These quantiles of the variance of the blocks of a class differ by less than this factor if most of it is noise.
_SPREAD, _EVEN = (0.1, 0.35), 1.3
#: Differences of pixels twice as far apart have about the variance of those of neighbors if they are noise; what is
#: more than this factor above the class with the least has texture.
_COARSE = 1.7
#: This many classes tell, with this many blocks each, if the variance differs by this factor between them, and if the
#: line leaves less than this part of what its mean leaves.
_TELLING, _ENOUGH, _UNEVEN, _LEFT = 5, 24, 1.8, 0.3
#: A line further below 0 at black than this part of the usual variance is that of texture.
_BELOW = 0.3
#: Levels nearer to an end than this many standard deviations have lost noise by clipping.
_FROM_ENDS = 1.5
#: Least variance at an end of the levels, as a part of the least that was seen; and least slope, for rounding.
_LEAST, _SLOPE = 0.1, 1e-3


def bend_of(versions: Versions, *, in_place: bool) -> Bend | None:
    """Find how noise follows the level, in all versions together; None if it is even or too little is known."""
    measured = _measured(versions, in_place=in_place)
    if not measured:
        return None
    # Versions may be more or less noisy; what matters is how noise changes with the level.
    means = np.concatenate([level for level, _ in measured])
    variances = np.concatenate([found / max(np.median(found[:, 0]), 1e-30) for _, found in measured])
    usual = float(np.median([np.median(found[:, 0]) for _, found in measured]))
    if versions.white is None:
        low, high = float(means.min()), float(means.max())
    else:
        low, high = 0.0, versions.white
        margin = _FROM_ENDS * np.sqrt(np.concatenate([found[:, 0] for _, found in measured]))
        inside = ((means > margin) & (means < high - margin)).all(axis=1)
        means, variances = means[inside], variances[inside]
    telling = _classes(means, variances)
    if len(telling) < _TELLING:
        return None
    lines = _lines(telling)
    if lines is None or (versions.white is not None and lines[0].min() < -_BELOW):
        return None
    least = _LEAST * telling[:, 1].min(axis=0)
    first, last = (usual * np.maximum(lines[0] + lines[1] * end, least) for end in (low, high))
    slope = (last - first) / (high - low)
    slope = np.where(np.abs(last - first) < _SLOPE * first, _SLOPE * first / (high - low), slope)
    return Bend(first - slope * low, slope, low, high)


def _measured(versions: Versions, *, in_place: bool) -> list[tuple[_Doubles, _Doubles]]:
    """(B, C) level of blocks and (B, 2, C) variances in them, of each version or pair of versions."""
    known = np.moveaxis(versions.known, 2, 0)
    numbers = np.flatnonzero(known.any(axis=(1, 2))).tolist()
    found = []
    if in_place and len(numbers) > 1:
        for one, other in pairwise(numbers):
            left, right, both = versions.bands(one), versions.bands(other), known[one] & known[other]
            apart = (left - right) * np.float32(np.sqrt(0.5))
            found.append(
                (
                    blocks_of((left + right) * np.float32(0.5), both).mean(axis=(1, 2)),
                    _variances(blocks_of(apart, both)),
                )
            )
    else:
        for number in numbers:
            blocks = blocks_of(versions.bands(number), known[number])
            found.append((blocks.mean(axis=(1, 2)), _variances(blocks)))
    return [one for one in found if len(one[0]) >= _CLASSES * _ENOUGH]


def _variances(blocks: _Doubles) -> _Doubles:
    """(B, 2, C) variances of white noise with the second differences that blocks have of pixels one and two apart."""
    found = []
    for apart in (1, 2):
        down = blocks[:, : -2 * apart] - 2 * blocks[:, apart:-apart] + blocks[:, 2 * apart :]
        both = down[:, :, : -2 * apart] - 2 * down[:, :, apart:-apart] + down[:, :, 2 * apart :]
        found.append(np.square(both / 6).mean(axis=(1, 2)))
    return np.stack(found, axis=1)


def _classes(means: _Doubles, variances: _Doubles) -> _Doubles:
    """(K, 2, C) level and variance of the quiet blocks of classes of levels, where that is noise for the most part."""
    found, coarse = [], []
    for part in np.array_split(np.argsort(means.mean(axis=1)), _CLASSES):
        if len(part) >= _ENOUGH:
            total = variances[part, 0].sum(axis=1)
            low, high = np.quantile(total, _SPREAD)
            first, last = (int(share * len(part)) for share in _QUIET)
            quiet = part[np.argsort(total)[first:last]]
            fine, wide = variances[quiet].mean(axis=0)
            coarse.append(wide.sum() / max(fine.sum(), 1e-30) if high < _EVEN * low else np.inf)
            found.append([means[quiet].mean(axis=0), fine])
    telling = np.array(coarse) < _COARSE * min(coarse, default=0)
    return np.array(found).reshape(-1, 2, means.shape[1])[telling]


def _lines(telling: _Doubles) -> tuple[_Doubles, _Doubles] | None:
    """(C,) constant and (C,) slope of the variance of bands; None if it is even or on no line."""
    # Weighted by relative errors. The bands are judged together.
    levels, variances = telling.transpose(1, 2, 0)
    lines, left, least = [], 0.0, 0.0
    for level, variance in zip(levels, variances, strict=True):
        rows = np.stack([1 / variance, level / variance], axis=1)
        lines.append(np.linalg.lstsq(rows, np.ones(len(rows)))[0])
        left += np.square(rows @ lines[-1] - 1).sum()
        least += np.square(rows[:, 0] * rows[:, 0].sum() / np.square(rows[:, 0]).sum() - 1).sum()
    constant, slope = np.array(lines).T
    low, high = constant + slope * levels.min(axis=1), constant + slope * levels.max(axis=1)
    if min(low.min(), high.min()) <= 0 or left > _LEFT * least:
        return None
    return (constant, slope) if np.abs(np.log(high / low).mean()) > np.log(_UNEVEN) else None
