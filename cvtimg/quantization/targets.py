"""Where a figure of results reaches a target, with few trials."""

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from cvtimg._shared.progress import first_few, tell

R = TypeVar("R")

#: Places between which a secant is taken, so that noise does not matter, and the farthest step along it.
_APART, _FARTHEST = 1.0, 48.0


def climb(
    rungs: Sequence[Any], result: Callable[[Any], R], figure: Callable[[R], float], target: float,
    place: Callable[[Any], float], first: int,
) -> tuple[tuple[Any, R] | None, tuple[Any, R] | None]:  # fmt: skip
    """Return the highest rung below a target and the lowest that reaches it, with their results.

    They are neighbors, and one of them is missing at the ends. Figures of results, which are expensive, are to grow
    about as the places of rungs do; the search begins at a place in `rungs`.
    """
    below, reaching, at = -1, len(rungs), min(first, len(rungs) - 1)
    seen: dict[float, float] = {}
    ends: dict[bool, tuple[Any, R]] = {}
    for n in first_few(range(1000)):
        trial = result(rungs[at])
        value = seen[place(rungs[at])] = figure(trial)
        ends[value >= target] = rungs[at], trial
        below, reaching = (below, at) if value >= target else (at, reaching)
        if reaching - below == 1:
            break
        if math.isfinite(value) and n % 4 < 3:
            guess = toward(target, {key: known for key, known in seen.items() if math.isfinite(known)})
        else:  # figures may be far from a line
            guess = (place(rungs[max(below, 0)]) + place(rungs[min(reaching, len(rungs) - 1)])) / 2
        at = min(max(bisect_left(rungs, guess, key=place), below + 1), reaching - 1)
    tell(1)
    return ends.get(False), ends.get(True)


def toward(target: float, seen: dict[float, float]) -> float:
    """Return where a line through two places, with what was seen there, reaches a target: around it, or nearest to it.

    Figures are to grow about as places do.
    """
    places = sorted(seen)
    around = [ends for ends in pairwise(places) if seen[ends[0]] < target <= seen[ends[1]]]
    if around:
        return float(np.interp(target, [seen[place] for place in around[0]], around[0]))
    near, *others = places if seen[places[0]] >= target else places[::-1]
    growth = 1.0
    for other in [other for other in others if abs(other - near) > _APART][:1]:
        growth = min(max((seen[other] - seen[near]) / (other - near), 0.25), 2.0)
    return near + min(max((target - seen[near]) / growth, -_FARTHEST), _FARTHEST)
