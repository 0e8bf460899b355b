"""How points of the sphere move to the centers of mass of their cells, while edges of their triangulation flip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.methods import Watch
from cvtimg.placement.quasi_newton import StepMemory
from cvtimg.sphere.densities import SphereDensity
from cvtimg.sphere.triangulation import Points, Triangulation, unit

#: No point moves farther than this part of the size of its cell.
_LONGEST = 0.3
#: A move that would turn a triangle over is halved down to this part; after that the triangulation is built anew.
_SHORTEST = 1e-3
#: Steps are forgotten where offsets grow by more than this factor in one move.
_WORSE = 2.0


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
    energy : float
    """

    masses: NDArray[np.float64]
    pulls: Points
    areas: NDArray[np.float64]
    energy: float

    @property
    def offset(self) -> float:
        """Root mean square of the distances to centers of mass, by the sizes of cells."""
        return float(np.sqrt(self._offsets().mean()))

    def offset_of(self, free: NDArray[np.bool_] | None) -> float:
        """Return the same for the free points alone."""
        return self.offset if free is None else float(np.sqrt(self._offsets()[free].mean()))

    def _offsets(self) -> NDArray[np.float64]:
        squares: NDArray[np.float64] = np.einsum("ij,ij->i", self.pulls, self.pulls) / (self.masses**2 * self.areas)
        return squares


class SumCells(Protocol):
    """Integrates over the cells of a triangulation."""

    def __call__(self, mesh: Triangulation, /) -> Cells:
        """Sum cells."""
        ...


def uniform_cells(mesh: Triangulation) -> Cells:
    """Integrate over cells for the density 1, exactly but for areas, which are lengths of moments."""
    moments = mesh.uniform_moments()
    along = np.einsum("ij,ij->i", moments, mesh.points)
    areas = np.sqrt(np.einsum("ij,ij->i", moments, moments))
    moments -= along[:, None] * mesh.points
    return Cells(areas, moments, areas, 8 * np.pi - 2 * float(along.sum()))


@dataclass(frozen=True, slots=True)
class WeightedCells:
    """Integrates a density over cells: linear between points and corners of cells."""

    density: SphereDensity

    def __call__(self, mesh: Triangulation) -> Cells:
        """Sum cells."""
        centers, at_points = mesh.circumcenters(), self.density(mesh.points)
        masses, moments, energies = mesh.weighted_moments(at_points, centers, self.density(centers))
        moments -= np.einsum("ij,ij->i", moments, mesh.points)[:, None] * mesh.points
        return Cells(masses, moments, masses / at_points, float(energies.sum()))


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
    """Move the points of a triangulation by limited-memory BFGS with capped steps; return the cells at the end.

    The energy is not searched along a direction: the quadrature of a density is not exactly its own gradient, and where
    it is, the full step is nearly always taken.
    """
    memory = StepMemory()
    at = sum_cells(mesh)
    offset = at.offset_of(terms.free)
    for _ in range(terms.most):
        if offset <= terms.tolerance or terms.watch(at.energy):
            break
        before, gradient = mesh.points, _gradient(at, terms)
        step = -memory.times(gradient, partial(np.multiply, 0.5 / at.masses[:, None]))
        if float(np.einsum("kd,kd", step, gradient)) >= 0:
            memory.clear()
            step = at.pulls / at.masses[:, None] if terms.free is None else -gradient / (2 * at.masses[:, None])
        _move(mesh, _capped(step, at.areas), terms)
        at = sum_cells(mesh)
        memory.learn(mesh.points - before, _gradient(at, terms) - gradient)
        last, offset = offset, at.offset_of(terms.free)
        if offset > _WORSE * last:
            memory.clear()
    return at


def _gradient(cells: Cells, terms: Terms) -> Points:
    gradient = -2 * cells.pulls
    if terms.free is not None:
        gradient[~terms.free] = 0
    return gradient


def _capped(step: Points, areas: NDArray[np.float64]) -> Points:
    squares = np.einsum("ij,ij->i", step, step) / (_LONGEST**2 * areas)
    if squares.max() > 1:
        step /= np.sqrt(np.maximum(squares, 1))[:, None]
    return step


def _move(mesh: Triangulation, step: Points, terms: Terms) -> None:
    """Move points by a step, or by a part of it where triangles would turn over."""
    start, part = mesh.points, 1.0
    while True:
        there = unit(start + (step if part == 1 else part * step))
        if terms.project is not None:
            there = terms.project(there, start)
        if terms.free is not None:
            there[~terms.free] = start[~terms.free]
        if mesh.move(there):
            return
        part /= 2
        if part < _SHORTEST:
            mesh.replace(there)
            return
