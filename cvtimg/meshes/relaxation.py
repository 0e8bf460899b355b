"""How the vertices of a mesh move until each is the center of mass of its own Voronoi cell.

It is the descent of `cvtimg.placement` but for three things: steps are limited so that no triangle turns over, cells
are those of a triangulation that flips with them, and the masses of cells are 2 x 2 matrices where the metric is not
that of a size alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.meshes.triangulation import FREE, Triangulation

Points = NDArray[np.float64]
#: From (N, 2) points to their metrics (N, 3): xx, xy and yy. Edges are wanted to have length 1 in it.
Metric = Callable[[Points], Points]

_MEMORY = 7
#: The inverse Hessian starts as Lloyd's step times a number in this range.
_LEAST_SCALE, _LARGEST_SCALE = 0.3, 3.0
#: Vertices move by no more than this part of the wanted edge length at once.
_LONGEST = 0.5
#: An energy that rises by no more than this may be that of a metric which is interpolated.
_RISE = 1e-7


@dataclass(frozen=True, slots=True)
class Relaxed:
    """How a relaxation went: the energy at the start and after each move, and whether vertices came to rest."""

    energies: tuple[float, ...]
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """The energy, and Lloyd's steps with the mass matrices by which products of steps are formed."""

    energy: float
    steps: Points
    inertia: Points
    sizes: NDArray[np.float64]

    def dot(self, a: Points, b: Points) -> float:
        xx, xy, yy = self.inertia.T
        products = a[:, 0] * (xx * b[:, 0] + xy * b[:, 1]) + a[:, 1] * (xy * b[:, 0] + yy * b[:, 1])
        return float(products.sum())


def relax(mesh: Triangulation, metric: Metric, *, isotropic: bool, most: int, tolerance: float) -> Relaxed:
    """Move the vertices that are not fixed, by limited-memory BFGS on Lloyd's steps.

    Parameters
    ----------
    mesh : Triangulation
        Is changed.
    metric : callable
    isotropic : bool
        Whether the metric is that of a size alone: then flips need none.
    most : int
        Moves at most.
    tolerance : float
        Stop when no vertex is farther than this part of the wanted edge length from its center of mass.
    """
    at = _state(mesh, metric, isotropic)
    energies = [at.energy]
    memory: deque[tuple[Points, Points, float]] = deque(maxlen=_MEMORY)
    rested = False
    while len(energies) <= most and not rested:
        before = mesh.state()
        done = mesh.move(_capped(_direction(at, memory), at.sizes))
        there = _state(mesh, metric, isotropic)
        if memory and there.energy > at.energy * (1 + _RISE):
            memory.clear()
            mesh.restore(before)
            mesh.move(_capped(at.steps, at.sizes))
            there = _state(mesh, metric, isotropic)
        else:
            change = at.steps - there.steps
            product = there.dot(done, change)
            if product > 1e-12 * there.dot(done, done):
                memory.append((done, change, product))
        at = there
        energies.append(at.energy)
        rested = bool((np.hypot(*at.steps.T) <= tolerance * at.sizes).all())
    return Relaxed(tuple(energies), rested)


def _state(mesh: Triangulation, metric: Metric, isotropic: bool) -> _State:
    values = metric(mesh.points)
    mesh.flip(None if isotropic else values)
    energy, inertia, pull = mesh.moments(values)
    xx, xy, yy = inertia.T
    size = xx * yy - xy * xy
    sure = (size > 0) & (xx > 0) & (mesh.fixed == FREE)
    safe = np.where(sure, size, 1)
    steps = np.stack([yy * pull[:, 0] - xy * pull[:, 1], xx * pull[:, 1] - xy * pull[:, 0]], axis=1) / safe[:, None]
    steps[~sure] = 0
    # The longest edge that the metric wants is about twice its trace's root shorter than the least eigenvalue says.
    wanted = np.sqrt(2 / (values[:, 0] + values[:, 2])) if isotropic else _longest_edges(values)
    return _State(energy, steps, inertia, wanted)


def _longest_edges(values: Points) -> NDArray[np.float64]:
    """Edge lengths that metrics want along their direction of least change."""
    xx, xy, yy = values.T
    half, apart = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    least: NDArray[np.float64] = (xx * yy - xy * xy) / (half + apart)
    return 1 / np.sqrt(np.maximum(least, 1e-300))


def _capped(steps: Points, sizes: NDArray[np.float64]) -> Points:
    lengths = np.hypot(*steps.T)
    capped: Points = steps * np.minimum(1, _LONGEST * sizes / np.maximum(lengths, 1e-300))[:, None]
    return capped


def _direction(at: _State, memory: deque[tuple[Points, Points, float]]) -> Points:
    """Multiply Lloyd's steps by the inverse Hessian that is remembered: two loops over the memory."""
    rest, parts = at.steps.copy(), []
    for step, change, product in reversed(memory):
        part = at.dot(step, rest) / product
        rest -= part * change
        parts.append(part)
    if memory:
        _, change, product = memory[-1]
        rest *= min(max(product / at.dot(change, change), _LEAST_SCALE), _LARGEST_SCALE)
    for (step, change, product), part in zip(memory, reversed(parts), strict=True):
        rest += (part - at.dot(change, rest) / product) * step
    return rest
