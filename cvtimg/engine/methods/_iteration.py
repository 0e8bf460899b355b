"""What every method is given and what it gives back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.points import Points

#: Sees the number of the step and the energy before it; returns True to stop.
Callback = Callable[[int, float], bool | None]


@dataclass(frozen=True, slots=True)
class Stopping:
    """When an iteration has gone far enough.

    Attributes
    ----------
    tolerance : float
        It has converged when a pass lowers the energy by this share of it or less.
    max_iterations : int
        It stops after so many passes in any case.
    """

    tolerance: float
    max_iterations: int

    def converged(self, energies: list[float]) -> bool:
        """Whether the last pass changed next to nothing."""
        if energies[-1] == 0:
            return True
        return len(energies) > 1 and energies[-2] - energies[-1] <= self.tolerance * energies[-2]


class Watch:
    """Counts the steps of all iterations that serve one result, and asks the callback whether to go on."""

    def __init__(self, callback: Callback | None = None, outward: Callable[[float], float] = float) -> None:
        self._callback = callback
        self._outward = outward
        self._n_steps = 0
        self.stopped = False

    def __call__(self, energy: float) -> bool:
        """Report a step; return whether to stop now."""
        if self._callback is not None and not self.stopped:
            self.stopped = bool(self._callback(self._n_steps, self._outward(energy)))
        self._n_steps += 1
        return self.stopped


@dataclass(frozen=True, slots=True, eq=False)
class Conditions:
    """What a method must respect.

    Attributes
    ----------
    stopping : Stopping
        When to stop.
    rng : numpy.random.Generator
        Where everything that is drawn comes from.
    n_locked : int
        So many generators, the first ones, stay in place.
    volume_power : float
        How a cell counts by its mass; 0 for methods that take no other.
    watch : Watch
        To be called with the energy before each step.
    """

    stopping: Stopping
    rng: np.random.Generator
    n_locked: int = 0
    volume_power: float = 0.0
    watch: Watch = field(default_factory=Watch)

    def until(self, stopping: Stopping) -> Conditions:
        """Return the same conditions with another stopping rule."""
        return replace(self, stopping=stopping)

    def ended(self, energies: list[float]) -> bool:
        """Whether to stop before the next step, given the energies so far."""
        asked = self.watch(energies[-1])
        return asked or self.stopping.converged(energies) or len(energies) > self.stopping.max_iterations


@dataclass(frozen=True, slots=True, eq=False)
class Iteration:
    """The end of an iteration.

    Attributes
    ----------
    generators : (K, D) float64 array
        Centered as the points.
    energies : list of float
        Before each step and at the end, weighted by `Conditions.volume_power`.
    converged : bool
        Whether it came to rest.
    labels : int32 array or None
        The cell of each point, padding too, where that is not the nearest generator's.
    """

    generators: NDArray[np.float64]
    energies: list[float]
    converged: bool
    labels: NDArray[np.int32] | None = None


#: From points, initial generators (K, D) and conditions to the end of the iteration.
Method = Callable[[Points, NDArray[np.float64], Conditions], Iteration]
