"""Where a figure of results reaches a target, with few trials."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Generic, TypeVar

import numpy as np

from cvtimg._shared.progress import first_few, tell

R = TypeVar("R")

#: Places between which a secant is taken, so that noise does not matter, and the farthest step along it.
_APART, _FARTHEST = 1.0, 48.0


@dataclass(frozen=True, slots=True)
class Ladder(Generic[R]):
    """Numbers of colors, prices of a bit or both, by which a figure of results grows, more or less in a line."""

    rungs: Sequence[Any]
    result: Callable[[Any], R]  # at a rung; expensive
    figure: Callable[[R], float]
    growth: float  # of the figure where the place grows by 1, roughly; two trials replace it
    place: Callable[[Any], float] = math.log2  # of a rung on the line

    def climb(self, target: float, first: object) -> tuple[tuple[Any, R] | None, tuple[Any, R] | None]:
        """Return the highest rung below a target and the lowest that reaches it, with their results.

        They are neighbors, and one of them is missing at the ends.
        """
        below, reaching, at = -1, len(self.rungs), min(self._at(first), len(self.rungs) - 1)
        trials: list[tuple[float, float]] = []
        found: dict[bool, tuple[Any, R]] = {}
        for _ in first_few(range(1000)):
            result = self.result(self.rungs[at])
            figure = self.figure(result)
            trials.append((self.place(self.rungs[at]), figure))
            found[figure >= target] = self.rungs[at], result
            below, reaching = (below, at) if figure >= target else (at, reaching)
            if reaching - below == 1:
                break
            at = min(max(self._next(trials, target, below, reaching), below + 1), reaching - 1)
        tell(1)
        return found.get(False), found.get(True)

    def _at(self, rung: object) -> int:
        return bisect_left(self.rungs, self.place(rung), key=self.place)

    def _next(self, trials: list[tuple[float, float]], target: float, below: int, reaching: int) -> int:
        """Follow the line through the last two trials; every sixth time bisect: the figures may be far from a line."""
        place, figure = trials[-1]
        if not math.isfinite(figure) or len(trials) % 6 == 0:
            ends = (self.place(self.rungs[at]) for at in (max(below, 0), min(reaching, len(self.rungs) - 1)))
            return bisect_left(self.rungs, sum(ends) / 2, key=self.place)
        growth = self.growth
        if len(trials) > 1 and (before := trials[-2])[1] != figure and math.isfinite(before[1]):
            growth = max((figure - before[1]) / (place - before[0]), self.growth / 8)
        guess = place + min(max((target - figure) / growth, -4), 4)
        if figure < target:
            return bisect_left(self.rungs, guess, key=self.place)
        return bisect_right(self.rungs, guess, key=self.place) - 1


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
        growth = min(max((seen[other] - seen[near]) / (other - near), 0.5), 2.0)
    return near + min(max((target - seen[near]) / growth, -_FARTHEST), _FARTHEST)
