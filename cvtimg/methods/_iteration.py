"""What every method is given and what it gives back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.points import Points


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


@dataclass(frozen=True, slots=True, eq=False)
class Iteration:
    """The end of an iteration: generators (K, D), centered as the points, and the energy before each of its moves."""

    generators: NDArray[np.float64]
    energies: list[float]
    converged: bool


#: From points, initial generators (K, D) and a stopping rule to the end of the iteration.
Method = Callable[[Points, NDArray[np.float64], Stopping], Iteration]
