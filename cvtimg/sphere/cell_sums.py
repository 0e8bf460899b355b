"""Integrals over the cells of a triangulation of the sphere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.sphere import _sphere
from cvtimg.sphere.densities import SphereDensity
from cvtimg.sphere.triangulation import Points, SphereTriangulation

#: What the energy of even cells is, but for what depends on the points.
UNIFORM_ENERGY = 8 * np.pi
#: Steps of the kernels for each cell, by which their work is divided among threads.
_WORK = 20


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Sums over the cells of N points."""

    masses: NDArray[np.float64]  # (N,): integral of the density
    # (N, 3): integral of the density times x, without its part along the point: mass times the way to the center of
    # mass.
    pulls: Points
    areas: NDArray[np.float64]  # (N,): by which steps are measured
    energies: NDArray[np.float64]  # (N,): parts of the energy; those of even cells are without a constant
    constant: float = 0.0  # What is to be added to their sum

    @property
    def energy(self) -> float:
        """Integral of the density times the squared distance to the points."""
        return self.constant + float(self.energies.sum())

    def offset_of(self, free: NDArray[np.bool_] | None) -> float:
        """Return the root mean square of the distances to centers of mass, by the sizes of cells, of free points."""
        return float(np.sqrt((self.offsets() if free is None else self.offsets()[free]).mean()))

    def offsets(self) -> NDArray[np.float64]:
        """Return squared distances (N,) to centers of mass, by the areas of cells."""
        return np.einsum("ij,ij->i", self.pulls, self.pulls) / (self.masses**2 * self.areas)

    def of(self, own: slice, free: NDArray[np.bool_] | None = None) -> Cells:
        """Return some of the cells, with no pull at points that are not free."""
        pulls = self.pulls[own] if free is None else np.where(free[:, None], self.pulls[own], 0.0)
        return Cells(self.masses[own], pulls, self.areas[own], self.energies[own], self.constant)


#: Integrates over the cells of a triangulation.
SumCells = Callable[[SphereTriangulation], Cells]


def uniform_cells(mesh: SphereTriangulation) -> Cells:
    """Integrate over cells for the density 1, exactly but for areas, which are lengths of moments."""
    points, pulls = mesh.points, mesh.uniform_moments()
    areas, along = np.empty((2, len(points)))

    in_parts(partial(_sphere.split_moments, points, pulls, areas, along), len(points), _WORK * len(points))
    return Cells(areas, pulls, areas, -2 * along, UNIFORM_ENERGY)


@dataclass(frozen=True, slots=True)
class WeightedCells:
    """Integrates a density over cells: linear between points and corners of cells."""

    density: SphereDensity

    def __call__(self, mesh: SphereTriangulation) -> Cells:
        """Sum cells."""
        centers, at_points = mesh.circumcenters(), self.density(mesh.points)
        masses, moments, energies = mesh.weighted_moments(at_points, centers, self.density(centers))
        moments -= np.einsum("ij,ij->i", moments, mesh.points)[:, None] * mesh.points
        return Cells(masses, moments, masses / at_points, energies)
