"""Limited-memory BFGS on the sphere, with all sums over points made at once, so that points may lie in several patches.

D. C. Liu, J. Nocedal, On the limited memory BFGS method for large scale optimization, Mathematical Programming 45
(1989) 503-528, doi 10.1007/BF01589116; with products instead of vectors, W. Chen, Z. Wang, J. Zhou, Large-scale L-BFGS
using MapReduce, Advances in Neural Information Processing Systems 27 (2014) 1332-1340.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.engine.methods import Watch
from cvtimg.sphere import _steps
from cvtimg.sphere.cell_sums import SumCells
from cvtimg.sphere.triangulation import Points, Triangulation

_Floats = NDArray[np.float64]

#: How many steps are remembered; the rows of the products are these, the changes of the gradient, and the gradient.
N_STEPS = 7
_ROWS, _GRADIENT = 2 * N_STEPS + 1, 2 * N_STEPS
#: Sums over a block that come before its products: squared offsets, energy, mass, and roots of the density.
_OTHERS = 4
#: No point moves farther than this part of the size of its cell.
_LONGEST = 0.3
#: The inverse Hessian starts as its diagonal times a number in this range.
_LEAST_SCALE, _LARGEST_SCALE = 0.5, 4.0
#: A move that would turn a triangle over is halved down to this part; after that the triangulation is built anew.
_SHORTEST = 1e-3
#: Steps are forgotten where offsets grow by more than this factor in one move.
_WORSE = 2.0
#: Blocks of points at most whose sums are added in their order, and points of a block at least.
_MOST_BLOCKS, _LEAST_BLOCK = 8192, 64
#: Steps of the kernels for each point, by which their work is divided among threads.
_WORK = 100


def block_size(n: int) -> int:
    """Return the number of points whose sums are made first, of n: the same for any number of patches."""
    return max(_LEAST_BLOCK, 1 << (-(-n // _MOST_BLOCKS) - 1).bit_length())


class Stretch:
    """Consecutive points of a triangulation that move by the steps that they remember.

    Parameters
    ----------
    mesh : Triangulation
        Of these points and others.
    own : slice
        Which they are.
    sum_cells : callable
        Integrates over cells.
    block : int
        Points whose sums are made first; the points begin with a block.
    free : (N,) bool array or None
        Which of them may move; None lets all.
    """

    def __init__(
        self, mesh: Triangulation, own: slice, sum_cells: SumCells, block: int, free: NDArray[np.bool_] | None = None
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
        """Sum cells where points are now, and remember the step to there; return sums over blocks."""
        self.cells = cells = self._sum_cells(self.mesh).of(self._own, self._free)
        densities = cells.masses / cells.areas
        if self._before is None:
            # A point of a centroidal tessellation has a cell of mass density^(1/2), and that is its stiffness.
            self._stretches = densities**-0.25
        before = self.points if self._before is None else self._before
        has_step = self._before is not None
        n, new = len(densities), np.array([slot, slot + N_STEPS, _GRADIENT], np.intp)

        def learn(start: int, stop: int) -> None:
            _steps.learn(
                self.points, before, cells.pulls, self._stretches, slot if has_step else -1, N_STEPS, start, stop,
                self._rows,
            )  # fmt: skip

        in_parts(learn, n, _WORK * n)
        starts = np.arange(0, n, self._block)
        products = np.empty((len(starts), 3, _ROWS))

        def multiply(start: int, stop: int) -> None:
            _steps.sum_products(self._rows, new, self._block, start, stop, products)

        in_parts(multiply, len(starts), _WORK * n)
        others = [np.add.reduceat(each, starts) for each in (cells.offsets(), cells.energies, cells.masses)]
        others.append(np.add.reduceat(np.sqrt(densities), starts))
        return np.concatenate([np.stack(others, axis=1), products.reshape(len(starts), -1)], axis=1)

    def moved(self, coefficients: _Floats, part: float) -> Points:
        """Return where a part of the step leads that is a sum of what is remembered."""
        self._before = self.points
        there = np.empty_like(self._before)

        def kernel(start: int, stop: int) -> None:
            _steps.move_points(
                self.points, self._rows, coefficients, self._stretches, self.cells.areas, _LONGEST, part, start, stop,
                there,
            )  # fmt: skip

        in_parts(kernel, len(there), _WORK * len(there))
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

    def move(self, coefficients: _Floats, part: float, anyhow: bool, /) -> bool:
        """Move points; return False, and move none, if a triangle would turn over, unless they must move anyhow."""
        ...


class _Products:
    """The products of what is remembered, of which steps are made."""

    def __init__(self) -> None:
        self._table = np.zeros((_ROWS, _ROWS))
        self._held: list[int] = []

    @property
    def slot(self) -> int:
        """Where the next step is to be written."""
        free = [slot for slot in range(N_STEPS) if slot not in self._held]
        return free[0] if free else self._held[0]

    def clear(self) -> None:
        """Forget all steps."""
        self._held.clear()

    def learn(self, slot: int, products: _Floats) -> None:
        """Take products of a new step, unless the energy is not convex along it, and of the gradient."""
        new = [slot, slot + N_STEPS, _GRADIENT]
        self._table[new] = products
        self._table[:, new] = products.T
        if slot in self._held:
            self._held.remove(slot)
        step, change, product = (self._table[i, j] for i, j in ((slot, slot), (new[1], new[1]), (slot, new[1])))
        if product > 1e-12 * (step * change) ** 0.5:
            self._held.append(slot)

    def step(self, scale: float) -> _Floats:
        """Return the step, as coefficients of what is remembered; `scale` is the inverse Hessian to start from."""
        rest, parts = np.zeros(_ROWS), []
        rest[_GRADIENT] = 1
        for slot in reversed(self._held):
            parts.append(float(self._table[slot] @ rest) / self._table[slot, slot + N_STEPS])
            rest[slot + N_STEPS] -= parts[-1]
        if self._held:
            last, change = self._held[-1], self._held[-1] + N_STEPS
            found = self._table[last, change] / self._table[change, change]
            scale = min(max(found, _LEAST_SCALE * scale), _LARGEST_SCALE * scale)
        rest *= scale
        for slot, part in zip(self._held, reversed(parts), strict=True):
            rest[slot] += part - float(self._table[slot + N_STEPS] @ rest) / self._table[slot, slot + N_STEPS]
        if float(self._table[_GRADIENT] @ rest) <= 0 and self._held:
            self.clear()
            return self.step(scale)
        return -rest


def follow(moving: Moving, most: int, tolerance: float, watch: Watch) -> None:
    """Move points, at most so often, until they are within the tolerance of centers of mass.

    The energy is not searched along a direction: the quadrature of a density is not exactly its own gradient, and where
    it is, the full step is nearly always taken.
    """
    products, offset, slot, n_moves = _Products(), np.inf, 0, 0
    while True:
        squares, energy, mass, roots, *others = moving.measured(slot).sum(axis=0)
        products.learn(slot, np.reshape(others, (3, _ROWS)))
        last, offset = offset, float(np.sqrt(squares / moving.n_free))
        if offset > _WORSE * last:
            products.clear()
        if n_moves == most or offset <= tolerance or watch(moving.constant + float(energy)):
            return
        step, slot, part = products.step(0.5 * float(roots / mass)), products.slot, 1.0
        while not moving.move(step, part, part < _SHORTEST):
            part /= 2
        n_moves += 1
