"""What every method receives and returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.iteration import Stopping, Watch
from cvtimg.engine.points import Points


@dataclass(frozen=True, slots=True, eq=False)
class Conditions:
    """Conditions that a method must respect.

    Attributes
    ----------
    stopping : Stopping
        When to stop.
    rng : numpy.random.Generator
        Source of all random numbers.
    n_locked : int
        The first `n_locked` generators stay in place.
    volume_power : float
        Cells are weighted by their mass to this power; 0 unless the method takes another.
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
        In the frame of the points.
    energies : list of float
        Before each step and at the end, weighted by `Conditions.volume_power`.
    converged : bool
        Whether the iteration converged.
    labels : int32 array or None
        The cell of each point, padding included, where that is not the cell of its nearest generator.
    """

    generators: NDArray[np.float64]
    energies: list[float]
    converged: bool
    labels: NDArray[np.int32] | None = None


class Ends(NamedTuple):
    """The ends of iterations from n sets of generators.

    Attributes
    ----------
    generators : (n, K, D) float64 array
        In the frame of the points.
    energies : (n,) float64 array
        At the ends, weighted by `Conditions.volume_power`.
    """

    generators: NDArray[np.float64]
    energies: NDArray[np.float64]


#: Takes points, initial generators (K, D) and conditions, and returns the end of the iteration.
Iterate = Callable[[Points, NDArray[np.float64], Conditions], Iteration]
#: The same for n sets (n, K, D) of initial generators.
IterateSets = Callable[[Points, NDArray[np.float64], Conditions], Ends]


@dataclass(frozen=True, slots=True)
class Method:
    """A way to move generators, and what it can do: a line in the registry.

    Attributes
    ----------
    iterate : callable
        The iteration itself.
    takes_power : bool
        Whether it minimizes the energy weighted by a `volume_power` other than 0.
    takes_locked : bool
        Whether it can leave some generators in place.
    exact_in_one_dimension : bool
        Whether it finds the global optimum of samples of one dimension, and works for no others. Of the initial
        generators only the number matters then.
    over_few : callable or None
        The same iteration, faster for so few points that a pass takes less time than calling for it; it locks no
        generator. By default `iterate`.
    of_sets : callable or None
        The same iteration from many sets of generators at once, over few points; empty cells may stay empty. By
        default one `iterate` after the other.
    """

    iterate: Iterate
    takes_power: bool = False
    takes_locked: bool = True
    exact_in_one_dimension: bool = False
    over_few: Iterate | None = None
    of_sets: IterateSets | None = None

    def __call__(self, points: Points, generators: NDArray[np.float64], conditions: Conditions) -> Iteration:
        """Iterate from these generators."""
        return self.iterate(points, generators, conditions)

    def descend_all(self, points: Points, sets: NDArray[np.float64], conditions: Conditions) -> Ends:
        """Iterate from each of (n, K, D) sets of generators."""
        if self.of_sets is not None:
            return self.of_sets(points, sets, conditions)
        ends = [self.iterate(points, generators, conditions) for generators in sets]
        return Ends(np.stack([end.generators for end in ends]), np.array([end.energies[-1] for end in ends]))
