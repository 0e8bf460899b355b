"""From the generators of several versions to one color a segment, at full contrast.

A segment that is painted over in one of three versions has a generator that is diluted: by a third towards what it was
painted over with. Each rule undoes that in its way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
_Doubles = NDArray[np.float64]

#: Segments of a smaller share of what a version knows do not tell its levels.
_LEAST_SHARE = 1e-3
_NOTHING = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What colors are made of.

    Attributes
    ----------
    values : list of (H, W, C) arrays
        Of each version.
    known : list of (H, W) bool arrays
        What each version knows.
    labels : (H, W) int32 array
        From 1.
    generators, masses : (S, K, C) arrays
        Of each version.
    alone : callable
        From the number of a version to the generators and masses, (K, C), where its segments come to rest if they
        start as the labels and it is alone.
    """

    values: list[Floats]
    known: list[NDArray[np.bool_]]
    labels: NDArray[np.int32]
    generators: _Doubles
    masses: _Doubles
    alone: Callable[[int], tuple[_Doubles, _Doubles]]


def mean_colors(evidence: Evidence) -> _Doubles:
    """(K, C) mean of all that is known of a segment, in all versions."""
    totals = evidence.masses.sum(axis=0)
    sums = (evidence.masses * evidence.generators).sum(axis=0)
    colors: _Doubles = np.divide(sums, totals, out=evidence.generators.mean(axis=0), where=totals > 0)
    return colors


def median_colors(evidence: Evidence) -> _Doubles:
    """(K, C) median of all that is known of a segment: right while less than half of it is painted over."""
    colors = mean_colors(evidence)
    for cell in range(len(colors)):
        inside = evidence.labels == cell + 1
        seen = [values[inside & known] for values, known in zip(evidence.values, evidence.known, strict=True)]
        if any(map(len, seen)):
            colors[cell] = np.median(np.concatenate(seen), axis=0)
    return colors


def range_colors(evidence: Evidence) -> _Doubles:
    """(K, C) levels that segments have in the versions taken each for itself; the median over these.

    There what is painted over goes to the background, and no longer dilutes the level of what is not: together the
    levels span the range of the versions again. It is told by segments and not by the least and greatest pixels, which
    are the noisiest. A segment that is too small in every version for that keeps its mean.
    """
    colors = mean_colors(evidence)
    settled = []
    for version in range(len(evidence.values)):
        levels, masses = evidence.alone(version)
        enough = masses >= max(_LEAST_SHARE * float(masses.sum(axis=0).max()), _NOTHING)
        settled.append(np.where(enough, levels, np.nan))
    told = np.stack(settled)
    some = ~np.isnan(told).all(axis=(0, 2))
    colors[some] = np.nanmedian(told[:, some], axis=0)
    return colors


#: The registry: names for `renormalize` and ``--renormalize``; none leaves the means.
RENORMALIZATIONS: dict[str, Callable[[Evidence], _Doubles]] = {
    "range": range_colors,
    "median": median_colors,
    "none": mean_colors,
}
