"""Noise whose variance follows the level, as that of light does: constant + slope x level.

The filters of groups take noise to be alike everywhere, so levels are bent. The noise is measured in classes of levels,
of what is quiet there, and even unless a line explains so much of what it varies by that chance would not.

A. Foi et al., IEEE Trans. Image Processing 17 (2008) 1737-1754, doi 10.1109/TIP.2008.2001399, for the model.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.anscombe import Bend
from cvtimg.restoration.quiet import levels_in, looks_at
from cvtimg.restoration.versions import Versions

_Doubles = NDArray[np.float64]

#: Patches have this side, and are sorted into this many classes by their level, of which so many must tell.
_SIDE, _CLASSES, _TELLING = 8, 8, 5
#: A class tells if it has this many patches for each value of one.
_PER_VALUE = 3
#: A line is taken if chance explains as much as it does less often than this.
_CHANCE = 1e-3
#: Least variance at an end of the levels, as a part of the least that was seen; and least slope, for rounding.
_LEAST, _SLOPE = 0.1, 1e-3


def bend_of(versions: Versions, *, in_place: bool) -> Bend | None:
    """Find how noise follows the level, in all versions together; None if it is even or too little is known."""
    found = [np.array(one).reshape(-1, 2, versions.stack[0].shape[2]) for one in _classes(versions, in_place=in_place)]
    found = [one for one in found if len(one) >= _TELLING]
    if not found:
        return None
    # Versions may be more or less noisy; what matters is how noise changes with the level.
    usual = [one[:, 1].mean(axis=0) for one in found]
    levels = np.concatenate([one[:, 0] for one in found])
    if min(one.min() for one in usual) <= 0:
        return None
    lines = _lines(levels, np.concatenate([one[:, 1] / mean for one, mean in zip(found, usual, strict=True)]))
    if lines is None:
        return None
    low, high = (float(levels.min()), float(levels.max())) if versions.white is None else (0.0, versions.white)
    constant, slope = lines.T * np.mean(usual, axis=0)
    least = _LEAST * min(one[:, 1].min() for one in found)
    first, last = (np.maximum(constant + slope * end, least) for end in (low, high))
    slope = (last - first) / (high - low)
    slope = np.where(np.abs(last - first) < _SLOPE * first, _SLOPE * first / (high - low), slope)
    return Bend(first - slope * low, slope, low, high)


def _classes(versions: Versions, *, in_place: bool) -> list[list[tuple[_Doubles, _Doubles]]]:
    """(C,) level and (C,) variance of the noise in classes of levels, of each version or pair of versions."""
    found = []
    for look in looks_at(versions, in_place=in_place):
        patches, levels = look.patches(_SIDE)
        parts = np.array_split(np.argsort(levels.mean(axis=1), kind="stable"), _CLASSES)
        if len(parts[-1]) >= _PER_VALUE * patches[:1].size > 0:
            found.append(
                [(levels[part].mean(axis=0), np.square(levels_in(patches[part], look.share))) for part in parts]
            )
    return found


def _lines(levels: _Doubles, variances: _Doubles) -> _Doubles | None:
    """(C, 2) constant and slope of the variances, (N, C), of bands; None if these may be even, or are on no line."""
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
    return np.array(lines) if by_chance < _CHANCE else None
