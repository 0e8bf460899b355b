"""The loop of all iterations: step until the energy rests, the steps run out, or the caller has seen enough."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Self

from cvtimg._shared.progress import tell

#: Receives the number of the step and the energy before it; returns True to stop.
Callback = Callable[[int, float], bool | None]


@dataclass(frozen=True, slots=True)
class Stopping:
    """When an iteration stops.

    Attributes
    ----------
    tolerance : float
        The iteration has converged when a step lowers the energy by at most this fraction of it.
    max_iterations : int
        Maximum number of steps.
    patience : int
        Number of steps in a row that must lower the energy by next to nothing, where one may do so by chance.
    """

    tolerance: float
    max_iterations: int
    patience: int = 1

    @classmethod
    def after(cls, n_steps: int) -> Self:
        """Stop after this many steps, unless the energy is 0 before."""
        return cls(0.0, n_steps)

    def converged(self, energies: list[float]) -> bool:
        """Whether the last steps changed next to nothing."""
        last = pairwise(energies[-self.patience - 1 :])
        changed = any(before - after > self.tolerance * before for before, after in last)
        return energies[-1] == 0 or (len(energies) > self.patience and not changed)

    def share(self, energies: list[float]) -> float:
        """Estimate how far the iteration is: by its steps, or by how much less than the first the last one changed."""
        by_steps = (len(energies) - 1) / max(self.max_iterations, 1)
        if len(energies) < 3 or self.tolerance == 0:
            return by_steps
        first, last = (1 - energies[at] / energies[at - 1] if energies[at - 1] else 0.0 for at in (1, -1))
        if not self.tolerance < last < first:
            return by_steps
        return max(by_steps, math.log(first / last) / math.log(first / self.tolerance))


class Watch:
    """Counts the steps of all iterations that contribute to one result, and asks the callback whether to stop."""

    def __init__(self, callback: Callback | None = None, outward: Callable[[float], float] = float) -> None:
        self._callback = callback
        self.outward = outward  # converts energies for the callback
        self._n_steps = 0
        self.stopped = False

    def __call__(self, energy: float) -> bool:
        """Report a step; return whether to stop now."""
        if self._callback is not None and not self.stopped:
            self.stopped = bool(self._callback(self._n_steps, self.outward(energy)))
        self._n_steps += 1
        return self.stopped


class History(NamedTuple):
    """The energies before each step and at the end, and whether the iteration converged."""

    energies: list[float]
    converged: bool


def iterate(
    energy: float,
    step: Callable[[], float | None],
    stopping: Stopping,
    watch: Callable[[float], bool] | None = None,
    before: Sequence[float] = (),
) -> History:
    """Step from a start of this energy until it converges.

    A step returns the energy after it; None if none lowers it, where the iteration has converged. `watch` receives the
    energy before each step, and returns True to stop; `before` are energies that led to the start, of a run that goes
    on.
    """
    energies = [*before, energy]
    while True:
        asked = watch is not None and watch(energies[-1])
        converged = stopping.converged(energies)
        if asked or converged or len(energies) > stopping.max_iterations:
            return History(energies, converged)
        after = step()
        if after is None:
            return History(energies, True)
        energies.append(after)
        tell(stopping.share(energies))
