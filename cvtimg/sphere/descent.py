"""How points of the sphere move to the centers of mass of their cells, while edges of their triangulation flip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.methods import Watch
from cvtimg.sphere.cell_sums import Cells, SumCells
from cvtimg.sphere.steps import Stretch, block_size, follow
from cvtimg.sphere.triangulation import Points, Triangulation

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
