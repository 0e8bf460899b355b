"""How points of the sphere move to the centers of mass of their cells, while edges of their triangulation flip.

They move by limited-memory BFGS. Its sums over points are made at once, so that points may lie in several patches: it
remembers products instead of vectors, as in W. Chen, Z. Wang, J. Zhou, Large-scale L-BFGS using MapReduce, Advances in
Neural Information Processing Systems 27 (2014) 1332-1340.
"""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.iteration import Watch
from cvtimg._shared.threads import in_parts
from cvtimg.placement.descent import Projection, StepMemory
from cvtimg.sphere import _sphere
from cvtimg.sphere.triangulation import Cells, Points, SphereTriangulation, SumCells, unit

_Floats = NDArray[np.float64]

#: How many steps are remembered; the rows of the products are these, the changes of the gradient, and the gradient.
N_STEPS = 7
_ROWS, _GRADIENT = 2 * N_STEPS + 1, 2 * N_STEPS
#: No point moves farther than this part of the size of its cell.
_LONGEST = 0.3
#: A move that would turn a triangle over is halved down to this part; after that the triangulation is built anew.
_SHORTEST = 1e-3
#: Steps are forgotten where offsets grow by more than this factor in one move.
_WORSE = 2.0
#: Blocks of points at most whose sums are added in their order, and points of a block at least.
_MOST_BLOCKS, _LEAST_BLOCK = 8192, 64
#: Steps of the kernels for each point, by which their work is divided among threads.
_WORK = 100
#: Angles in degrees that are aimed at: beyond them corners push, so that none comes near to 90 degrees.
BOUNDS = (49.0, 77.0)
#: Step length of polishing per unit slope of what angles cost, in areas of cells, and the longest step, in their sizes.
_RATE, _LONGEST_POLISHING = 0.25, 0.05


def block_size(n: int) -> int:
    """Return the number of points whose sums are made first, of n: the same for any number of patches."""
    return max(_LEAST_BLOCK, 1 << (-(-n // _MOST_BLOCKS) - 1).bit_length())


class Stretch:
    """Consecutive points of a triangulation, its `own`, that move by the steps that they remember.

    Sums are made over blocks of points first; the points begin with a block. None of `free` (N,) lets all move.
    """

    def __init__(
        self,
        mesh: SphereTriangulation,
        own: slice,
        sum_cells: SumCells,
        block: int,
        free: NDArray[np.bool_] | None = None,
    ) -> None:
        self.mesh = mesh
        self._own = own
        self._sum_cells = sum_cells
        self._block = block
        self._free = free
        self._before: Points | None = None
        self._rows = np.zeros((_ROWS, *self.points.shape))

    @property
    def points(self) -> Points:
        """Where the points are."""
        return self.mesh.points[self._own]

    def measured(self, slot: int) -> _Floats:
        """Sum cells where points are now, and remember the step to there; return sums over blocks.

        In front of the products are squared offsets, energy, mass, and roots of the density.
        """
        self.cells = cells = self._sum_cells(self.mesh).of(self._own, self._free)
        densities = cells.masses / cells.areas
        if self._before is None:
            # A point of a centroidal tessellation has a cell of mass density^(1/2), and that is its stiffness.
            self._stretches = densities**-0.25
        # Coordinates in which points are about equally stiff.
        slopes = (-2 * self._stretches)[:, None] * cells.pulls
        if self._before is not None:
            self._rows[slot] = (self.points - self._before) / self._stretches[:, None]
            self._rows[slot + N_STEPS] = slopes - self._rows[_GRADIENT]
        self._rows[_GRADIENT] = slopes
        starts = np.arange(0, len(densities), self._block)
        products = np.empty((len(starts), 3, _ROWS))
        new = np.array([slot, slot + N_STEPS, _GRADIENT], np.intp)
        kernel = partial(_sphere.sum_products, self._rows, new, self._block, products)
        in_parts(kernel, len(starts), _WORK * len(densities))
        others = [cells.offsets(), cells.energies, cells.masses, np.sqrt(densities)]
        sums = np.stack([np.add.reduceat(each, starts) for each in others], axis=1)
        return np.concatenate([sums, products.reshape(len(starts), -1)], axis=1)

    def moved(self, coefficients: _Floats, part: float) -> Points:
        """Return where a part of the step leads that is a sum of what is remembered."""
        self._before = self.points
        there, areas = np.empty_like(self._before), self.cells.areas
        given = self._before, self._rows, coefficients, self._stretches, areas, _LONGEST, part, there
        in_parts(partial(_sphere.move_points, *given), len(there), _WORK * len(there))
        return there


class Moving(Protocol):
    """Points that move together."""

    @property
    def constant(self) -> float:
        """What is to be added to sums of energy."""
        ...

    @property
    def n_free(self) -> int:
        """How many points may move."""
        ...

    def measured(self, slot: int, /) -> _Floats:
        """Sum over blocks, as of a `Stretch`; all blocks of all points, in their order."""
        ...

    def move(self, coefficients: _Floats, part: float, force: bool, /) -> bool:
        """Move points; return False, and move none, if a triangle would turn over, unless they must move."""
        ...


class _ProductMemory:
    """Steps as coefficients of the rows that stretches remember; only the products of rows are known."""

    def __init__(self) -> None:
        self._table = np.zeros((_ROWS, _ROWS))
        self._steps = StepMemory(N_STEPS, lambda a, b: float((a @ self._table) @ b))
        self._held: deque[int] = deque(maxlen=N_STEPS)

    @property
    def slot(self) -> int:
        """Where the next step is to be written: in the place of the oldest, if there is no other."""
        return next((slot for slot in range(N_STEPS) if slot not in self._held), self._held[0] if self._held else 0)

    def clear(self) -> None:
        """Forget all steps."""
        self._steps.clear()
        self._held.clear()

    def learn(self, slot: int, products: _Floats) -> None:
        """Take products of a new step and of the gradient."""
        new = [slot, slot + N_STEPS, _GRADIENT]
        self._table[new] = products
        self._table[:, new] = products.T
        if slot in self._held:  # that of the oldest step, which it replaces
            self._held.popleft()
            self._steps.forget()
        if self._steps.learn(*np.eye(_ROWS)[new[:2]]):
            self._held.append(slot)

    def step(self, scale: float) -> _Floats:
        """Return the step, as coefficients of what is remembered; `scale` is the inverse Hessian to start from."""
        gradient = np.eye(_ROWS)[_GRADIENT]
        step = self._steps.times(gradient, np.copy, scale)
        if float(self._table[_GRADIENT] @ step) <= 0 and self._held:
            self.clear()
            return self.step(scale)
        return -step


def follow(moving: Moving, most: int, tolerance: float, watch: Watch) -> None:
    """Move points, at most so often, until they are within the tolerance of centers of mass.

    The energy is not searched along a direction: the quadrature of a density is not exactly its own gradient, and where
    it is, the full step is nearly always taken.
    """
    memory, offset, slot, n_moves = _ProductMemory(), np.inf, 0, 0
    while True:
        squares, energy, mass, roots, *others = moving.measured(slot).sum(axis=0)
        memory.learn(slot, np.reshape(others, (3, _ROWS)))
        last, offset = offset, float(np.sqrt(squares / moving.n_free))
        if offset > _WORSE * last:
            memory.clear()
        if n_moves == most or offset <= tolerance or watch(moving.constant + float(energy)):
            return
        step, slot, part = memory.step(0.5 * float(roots / mass)), memory.slot, 1.0
        while not moving.move(step, part, part < _SHORTEST):
            part /= 2
        n_moves += 1


class _Whole(Stretch):
    """All points of a triangulation, as they move."""

    def __init__(
        self,
        mesh: SphereTriangulation,
        sum_cells: SumCells,
        free: NDArray[np.bool_] | None = None,
        project: Projection | None = None,
    ) -> None:
        n = len(mesh.points)
        super().__init__(mesh, slice(0, n), sum_cells, block_size(n), free)
        self._project = project
        self.n_free = n if free is None else int(free.sum())

    @property
    def constant(self) -> float:
        return self.cells.constant

    def move(self, coefficients: _Floats, part: float, force: bool) -> bool:
        there = self.moved(coefficients, part)
        if self._project is not None:
            there = self._project(there, self.points)
        if self._free is not None:
            there[~self._free] = self.points[~self._free]
        if force:
            self.mesh.replace(there)
        return force or self.mesh.move(there)


def descend(
    mesh: SphereTriangulation,
    sum_cells: SumCells,
    most: int,
    tolerance: float,
    *,
    free: NDArray[np.bool_] | None = None,
    project: Projection | None = None,
    watch: Watch | None = None,
) -> Cells:
    """Move the points of a triangulation by limited-memory BFGS with capped steps; return the cells at the end.

    It ends when free points are no farther than `tolerance` from centers of mass, by the sizes of cells.
    """
    whole = _Whole(mesh, sum_cells, free, project)
    follow(whole, most, tolerance, Watch() if watch is None else watch)
    return whole.cells


def polish_angles(
    mesh: SphereTriangulation,
    sizes: NDArray[np.float64],
    most: int,
    *,
    bounds: tuple[float, float] = BOUNDS,
    free: NDArray[np.bool_] | None = None,
    project: Projection | None = None,
) -> None:
    """Descend the sum of squares by which cosines of angles are out of bounds, in degrees, with flips in between.

    Cells have `sizes` (N,), the roots of their areas. It ends when no angle is out of bounds.
    """
    least_cosine, largest_cosine = np.cos(np.radians(bounds[::-1]))
    for _ in range(most):
        slopes, n_out = _sphere.sum_corner_slopes(mesh, least_cosine, largest_cosine)
        if not n_out:
            return
        moving = np.flatnonzero(slopes.any(axis=1) if free is None else slopes.any(axis=1) & free)
        step = (-_RATE * sizes[moving] ** 2)[:, None] * slopes[moving]
        lengths = np.sqrt(np.einsum("ij,ij->i", step, step)) / (_LONGEST_POLISHING * sizes[moving])
        step /= np.maximum(lengths, 1)[:, None]
        there = mesh.points.copy()
        there[moving] = unit(mesh.points[moving] + step)
        mesh.replace(there if project is None else project(there, mesh.points))
