"""One color per segment from the generators of several versions, at full contrast.

A segment that is painted over in one of three versions has a diluted generator: a third of the way to the color that
covers it. Each rule undoes that in its own way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
_Doubles = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Values of segments in each version, from which their colors are made."""

    values: list[Floats]  # (H, W, C) each: values of each version
    known: list[NDArray[np.bool_]]  # (H, W) each: which pixels each version knows
    labels: NDArray[np.int32]  # (H, W): labels from 1
    generators: _Doubles  # (S, K, C): means and weights of the segments in each version
    masses: _Doubles
    #: Takes the number of a version and returns the generators and masses, (K, C), of its segments once they have
    #: settled in that version alone, starting from the labels
    alone: Callable[[int], tuple[_Doubles, _Doubles]]


def mean_colors(levels: Levels) -> _Doubles:
    """(K, C) mean of the known values of each segment in all versions."""
    totals = levels.masses.sum(axis=0)
    sums = (levels.masses * levels.generators).sum(axis=0)
    return np.divide(sums, totals, out=levels.generators.mean(axis=0), where=totals > 0)


def median_colors(levels: Levels) -> _Doubles:
    """(K, C) median of the known values of each segment: right while less than half of it is painted over."""
    colors = mean_colors(levels)
    for cell in range(len(colors)):
        inside = levels.labels == cell + 1
        seen = [values[inside & known] for values, known in zip(levels.values, levels.known, strict=True)]
        if any(map(len, seen)):
            colors[cell] = np.median(np.concatenate(seen), axis=0)
    return colors


def range_colors(levels: Levels) -> _Doubles:
    """(K, C) median over the versions of the level that each segment has in that version alone."""
    # In a single version, painted-over parts belong to the background and no longer dilute the level of the rest, so
    # the levels span the range of the versions again. Levels are those of segments, not of the least and greatest
    # pixels, which are the noisiest. A segment that has less than a thousandth of every version keeps its mean.
    colors, told = mean_colors(levels), []
    for version in range(len(levels.values)):
        means, masses = levels.alone(version)
        enough = masses >= max(1e-3 * float(masses.sum(axis=0).max()), 1e-12)
        told.append(np.where(enough, means, np.nan))
    some = ~np.isnan(told).all(axis=(0, 2))
    colors[some] = np.nanmedian(np.array(told)[:, some], axis=0)
    return colors


#: The registry: names for `renormalize` and ``--renormalize``; "none" keeps the means.
RENORMALIZATIONS: dict[str, Callable[[Levels], _Doubles]] = {
    "range": range_colors,
    "median": median_colors,
    "none": mean_colors,
}
