"""How points of the sphere move to the centers of mass of their cells, while edges of their triangulation flip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.engine.methods import Watch
from cvtimg.sphere import _steps
from cvtimg.sphere.densities import SphereDensity
from cvtimg.sphere.steps import Stretch, block_size, follow
from cvtimg.sphere.triangulation import Points, Triangulation

#: What the energy of even cells is, but for what depends on the points.
UNIFORM_ENERGY = 8 * np.pi
#: Steps of the kernels for each cell, by which their work is divided among threads.
_WORK = 20


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Sums over the cells of N points.

    Attributes
    ----------
    masses : (N,) float64 array
        Integral of the density.
    pulls : (N, 3) float64 array
        Integral of the density times x, without its part along the point: mass times the way to the center of mass.
    areas : (N,) float64 array
        By which steps are measured.
    energies : (N,) float64 array
        Parts of the energy; those of even cells are without a constant.
    constant : float
        What is to be added to their sum.
    """

    masses: NDArray[np.float64]
    pulls: Points
    areas: NDArray[np.float64]
    energies: NDArray[np.float64]
    constant: float = 0.0

    @property
    def energy(self) -> float:
        """Integral of the density times the squared distance to the points."""
        return self.constant + float(self.energies.sum())

    def offset_of(self, free: NDArray[np.bool_] | None) -> float:
        """Return the root mean square of the distances to centers of mass, by the sizes of cells, of free points."""
        return float(np.sqrt((self.offsets() if free is None else self.offsets()[free]).mean()))

    def offsets(self) -> NDArray[np.float64]:
        """Return squared distances (N,) to centers of mass, by the areas of cells."""
        squares: NDArray[np.float64] = np.einsum("ij,ij->i", self.pulls, self.pulls) / (self.masses**2 * self.areas)
        return squares

    def of(self, own: slice, free: NDArray[np.bool_] | None = None) -> Cells:
        """Return some of the cells, with no pull at points that are not free."""
        pulls = self.pulls[own] if free is None else np.where(free[:, None], self.pulls[own], 0.0)
        return Cells(self.masses[own], pulls, self.areas[own], self.energies[own], self.constant)


class SumCells(Protocol):
    """Integrates over the cells of a triangulation."""

    def __call__(self, mesh: Triangulation, /) -> Cells:
        """Sum cells."""
        ...


def uniform_cells(mesh: Triangulation) -> Cells:
    """Integrate over cells for the density 1, exactly but for areas, which are lengths of moments."""
    points, pulls = mesh.points, mesh.uniform_moments()
    areas, along = np.empty((2, len(points)))

    def kernel(start: int, stop: int) -> None:
        _steps.split_moments(points, start, stop, pulls, areas, along)

    in_parts(kernel, len(points), _WORK * len(points))
    return Cells(areas, pulls, areas, -2 * along, UNIFORM_ENERGY)


@dataclass(frozen=True, slots=True)
class WeightedCells:
    """Integrates a density over cells: linear between points and corners of cells."""

    density: SphereDensity

    def __call__(self, mesh: Triangulation) -> Cells:
        """Sum cells."""
        centers, at_points = mesh.circumcenters(), self.density(mesh.points)
        masses, moments, energies = mesh.weighted_moments(at_points, centers, self.density(centers))
        moments -= np.einsum("ij,ij->i", moments, mesh.points)[:, None] * mesh.points
        return Cells(masses, moments, masses / at_points, energies)


#: Where points (N, 3) that have moved may be, given where they came from.
Projection = Callable[[Points, Points], Points]


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """Conditions of a descent.

    Attributes
    ----------
    most : int
        Moves at most.
    tolerance : float
        It ends when points are no farther from centers of mass, by the sizes of cells.
    free : (N,) bool array or None
        Which points may move; None lets all.
    project : callable or None
        Brings moved points back to where they may be.
    watch : Watch
        Called with the energy before each move.
    """

    most: int
    tolerance: float
    free: NDArray[np.bool_] | None = None
    project: Projection | None = None
    watch: Watch = field(default_factory=Watch)


def descend(mesh: Triangulation, sum_cells: SumCells, terms: Terms) -> Cells:
    """Move the points of a triangulation by limited-memory BFGS with capped steps; return the cells at the end."""
    whole = _Whole(mesh, sum_cells, terms)
    follow(whole, terms.most, terms.tolerance, terms.watch)
    return whole.stretch.cells


class _Whole:
    """All points of a triangulation, as they move."""

    def __init__(self, mesh: Triangulation, sum_cells: SumCells, terms: Terms) -> None:
        n = len(mesh.points)
        self.stretch = Stretch(mesh, slice(0, n), sum_cells, block_size(n), terms.free)
        self._terms = terms

    @property
    def constant(self) -> float:
        return self.stretch.cells.constant

    @property
    def n_free(self) -> int:
        return len(self.stretch.points) if self._terms.free is None else int(self._terms.free.sum())

    def measured(self, slot: int) -> NDArray[np.float64]:
        return self.stretch.measured(slot)

    def move(self, step: NDArray[np.float64], part: float, anyhow: bool) -> bool:
        mesh, terms = self.stretch.mesh, self._terms
        there = self.stretch.moved(step, part)
        if terms.project is not None:
            there = terms.project(there, mesh.points)
        if terms.free is not None:
            there[~terms.free] = mesh.points[~terms.free]
        if anyhow:
            mesh.replace(there)
        return anyhow or mesh.move(there)
