"""Where a figure of results reaches a target, with few trials."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from cvtimg._shared.progress import first_few, tell

R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Ladder(Generic[R]):
    """Numbers of colors, or prices of a bit, along which a figure of results grows, more or less in a line."""

    rungs: Sequence[float]
    result: Callable[[float], R]  # at a rung; expensive
    figure: Callable[[R], float]
    growth: float  # of the figure where the place grows by 1, roughly; two trials replace it
    place: Callable[[float], float] = math.log2  # of a rung on the line

    def climb(
        self, target: float, first: float, close: float = 0.0, most: int = 1000
    ) -> tuple[tuple[float, R] | None, tuple[float, R] | None]:
        """Return the highest rung below a target and the lowest that reaches it, with their results.

        They are neighbors, and one of them is missing at the ends; but the search ends at once where the figure is less
        than `close` above the target, and after so many trials, the last at the upper end if nothing else reached it.
        """
        below, reaching, at = -1, len(self.rungs), min(self._at(first), len(self.rungs) - 1)
        trials: list[tuple[float, float]] = []
        found: dict[bool, tuple[float, R]] = {}
        for n in first_few(range(1, most + 1)):
            result = self.result(self.rungs[at])
            figure = self.figure(result)
            trials.append((self.place(self.rungs[at]), figure))
            found[figure >= target] = self.rungs[at], result
            below, reaching = (below, at) if figure >= target else (at, reaching)
            if reaching - below == 1 or 0 <= figure - target < close:
                break
            at = min(max(self._next(trials, target + close / 2, below, reaching), below + 1), reaching - 1)
            if n == most - 1 and True not in found:
                at = len(self.rungs) - 1
        tell(1)
        return found.get(False), found.get(True)

    def _at(self, rung: float) -> int:
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
