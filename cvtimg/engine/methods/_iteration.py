"""What every method receives and returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from cvtimg._shared.iteration import Stopping, Watch
from cvtimg._shared.types import Floats, Ints
from cvtimg.engine.points import Points, assign


@dataclass(frozen=True, slots=True, eq=False)
class Conditions:
    """Conditions that a method must respect."""

    stopping: Stopping
    rng: np.random.Generator  # source of all random numbers
    n_locked: int = 0  # number of generators, the first ones, that stay in place
    volume_power: float = 0.0  # cells are weighted by their mass to this power; 0 unless the method takes another
    watch: Watch = field(default_factory=Watch)  # to be called with the energy before each step

    def until(self, stopping: Stopping) -> Conditions:
        """Return the same conditions with another stopping rule."""
        return replace(self, stopping=stopping)


@dataclass(frozen=True, slots=True, eq=False)
class Iteration:
    """The end of an iteration."""

    generators: Floats  # (K, D) in the frame of the points
    energies: list[float]  # before each step and at the end, weighted by `Conditions.volume_power`
    converged: bool
    labels: Ints | None = None  # of all points, padding included; None for those of the nearest generators

    def labels_of(self, points: Points) -> Ints:
        """Return the labels of the points, found if the iteration had none."""
        return assign(points, self.generators) if self.labels is None else self.labels


class Ends(NamedTuple):
    """The ends of iterations from n sets of generators."""

    generators: Floats  # (n, K, D) in the frame of the points
    energies: Floats  # (n,) weighted by `Conditions.volume_power`


#: Takes points, initial generators (K, D) and conditions; returns the end of the iteration.
Iterate = Callable[[Points, Floats, Conditions], Iteration]


@dataclass(frozen=True, slots=True)
class Method:
    """A way to move generators, and what it can do: a line in the registry."""

    iterate: Iterate
    takes_power: bool = False  # whether it minimizes the energy weighted by a `volume_power` other than 0
    takes_locked: bool = True  # whether it can leave some generators in place
    # Whether it finds the global optimum in one dimension, and works in no other. Of the initial generators only the
    # number matters then.
    exact_in_one_dimension: bool = False

    def __call__(self, points: Points, generators: Floats, conditions: Conditions) -> Iteration:
        """Iterate from these generators."""
        return self.iterate(points, generators, conditions)
