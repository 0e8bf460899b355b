"""The smallest number of colors that reaches a target, in few trials."""

from __future__ import annotations

import math
from collections.abc import Callable


def first_reaching(
    measure: Callable[[int], float], target: float, least: int, most: int, *, first: int, per_octave: float
) -> int:
    """Return an n in least..most with measure(n) >= target where measure(n - 1) is below it; most + 1 if none is.

    Parameters
    ----------
    measure : callable
        Grows with n, more or less; each trial is expensive.
    target : float
        Value to reach.
    least, most : int
        Range of n.
    first : int
        First trial.
    per_octave : float
        Approximate growth from n to 2 n, used until two trials tell.
    """
    below, reaching = least - 1, most + 1
    n = min(max(first, least), most)
    trials: list[tuple[int, float]] = []
    while reaching - below > 1:
        trials.append((n, measure(n)))
        if trials[-1][1] >= target:
            reaching = n
        else:
            below = n
        n = min(max(_next(trials, target, below, reaching, per_octave), below + 1), reaching - 1)
    return reaching


def _next(trials: list[tuple[int, float]], target: float, below: int, reaching: int, per_octave: float) -> int:
    """Follow the line through the last two trials; every sixth time bisect, in case the values are far from a line."""
    (n, value), tried = trials[-1], {trial[0] for trial in trials}
    if not math.isfinite(value) or (len(trials) % 6 == 0 and reaching in tried):
        return round(math.sqrt(max(below, 1) * reaching))
    slope = per_octave
    if len(trials) > 1 and (other := trials[-2])[1] != value and math.isfinite(other[1]):
        slope = max((value - other[1]) / math.log2(n / other[0]), per_octave / 8)
    octaves = min(max((target - value) / slope, -4), 4)
    guess = n * 2**octaves
    return math.ceil(guess) if value < target else math.floor(guess)
