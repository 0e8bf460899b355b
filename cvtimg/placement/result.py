"""What a placement comes to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.placement.descent import Descent


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Placement:
    """Generators in a region, and what is known of their cells.

    Attributes
    ----------
    points : (K, D) float64 array
        The generators.
    masses : (K,) float64 array
        Integral of the density over each cell.
    centroids : (K, D) float64 array
        Center of mass of each cell; the generators are there, as nearly as the descent came.
    energy : float
        Integral of the density times the squared distance to the own generator.
    energies : tuple of float
        The energy at the start of the last level and after each of its moves.
    n_iter : int
        How many moves that were.
    converged : bool
        Whether the energy had come to rest when the descent stopped.
    """

    points: NDArray[np.float64]
    masses: NDArray[np.float64]
    centroids: NDArray[np.float64]
    energy: float
    energies: tuple[float, ...]
    n_iter: int
    converged: bool

    def __post_init__(self) -> None:
        for array in (self.points, self.masses, self.centroids):
            array.flags.writeable = False

    def __repr__(self) -> str:
        n, n_dims = self.points.shape
        rest = "converged" if self.converged else "not converged"
        return f"<Placement of {n} generators in {n_dims} dimensions, energy {self.energy:g}, {rest}>"

    @classmethod
    def of(cls, descent: Descent) -> Placement:
        """Make it of the end of a descent."""
        found = descent.moments
        return cls(
            descent.generators, found.masses, found.centroids, found.energy, descent.energies,
            len(descent.energies) - 1, descent.converged,
        )  # fmt: skip
