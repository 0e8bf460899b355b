"""Descents: how generators move until each is the center of mass of its own cell.

A descent knows nothing of pictures or polygons. It asks for the moments of cells, and lets a projection bring
generators back to where they may be after each move. The gradient of the energy by a generator is 2 m (z - c), for its
mass m and the center of mass c of its cell, so that Lloyd's move to c is a step along it.

Limited-memory BFGS: D. C. Liu, J. Nocedal, On the limited memory BFGS method for large scale optimization, Mathematical
Programming 45 (1989) 503-528, doi 10.1007/BF01589116.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import mul
from typing import Any

import numpy as np

import cvtimg.placement._descent as _descent
from cvtimg._shared.budgets import ROUNDING
from cvtimg._shared.iteration import Stopping, Watch, iterate
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Bools, Floats, Points
from cvtimg.placement.moments import CellMoments, Moments

#: Where generators (K, D) that have moved may be, given where they came from.
Projection = Callable[[Points, Points], Points]

#: Part of what the gradient promises that a step must lower the energy by, or it is halved, down to the shortest part.
_ENOUGH, _SHORTEST = 1e-4, 0.05
#: Steps of the kernels of a descent for each number and vector.
_STEPS = 5
#: Rows of a block: a dozen vectors of them stay in a cache of the second level.
_BLOCK = 1024


class StepMemory:
    """The inverse Hessian of limited-memory BFGS: the last 5 steps, and how they changed the gradient.

    On surfaces figures hardly change from 5 to 10 steps; in the plane from 4 to 12, and 3 need more moves. `pulls` are
    the gradient (N, D) with the other sign. Rows are in blocks, so that sums do not depend on the number of threads.
    """

    def __init__(self) -> None:
        self._kept: list[int] = []  # places of steps, from old to new
        self._steps = self._changes = np.empty((0, 0))  # (6, N D), one of them for a step that may not be kept
        self._products = np.zeros((6, 6))  # of changes with the steps up to their own
        self._along: list[float] = []  # products of steps with the last pulls

    def __len__(self) -> int:
        return len(self._kept)

    def clear(self) -> None:
        """Forget all steps."""
        self._kept = []

    def learn(self, after: Points, before: Points, old: Points, new: Points) -> None:
        """Remember a step and how pulls changed from old to new, unless the energy is not convex along it."""
        if not len(self._steps):
            self._steps, self._changes = np.empty((2, 6, after.size))
        kept = [*self._kept, min({*range(6)} - {*self._kept})]
        arrays = *map(np.ravel, (after, before, old, new)), self._steps, self._changes, np.array(kept, np.int32)
        *products, size, square = _sums(_descent.learn, arrays, len(after), 2 * len(kept) + 2)
        along, ahead = products[: len(kept)], products[len(kept) :]
        if along[-1] > ROUNDING * (size * square) ** 0.5:
            self._products[kept[-1], kept] = along
            self._kept, self._along = kept[-5:], ahead[-5:]
        else:
            self._along = ahead[:-1]

    def step(self, pulls: Points, inverse: Floats) -> Points:
        """Multiply the pulls that were learned last by the inverse Hessian.

        It starts as `inverse` at a scale that is learned: a factor (N, 1) of each vector, or matrices of those with two
        columns (N, 3), xx, xy and yy.
        """
        lower, kept = self._products[np.ix_(self._kept, self._kept)], np.array(self._kept, np.int32)
        # Both loops of the two-loop recursion, each solved for its factors.
        factors = _solved(lower.T[::-1, ::-1], self._along[::-1])[::-1] if kept.size else np.empty(0)
        out = np.empty(pulls.size)
        arrays = out, 1.0, pulls.ravel(), -factors, self._changes, kept, np.ascontiguousarray(inverse)
        *across, square = _sums(_descent.combine, arrays, len(pulls), len(kept) + 1)
        if kept.size:
            scale = lower[-1, -1] / square
            ends = _solved(lower, lower.diagonal() * factors - np.multiply(scale, across))
            _sums(_descent.combine, (out, scale, out, ends, self._steps, kept, None), len(pulls), len(kept) + 1)
        return out.reshape(pulls.shape)


def _sums(kernel: Callable[..., None], arrays: tuple[Any, ...], n_vectors: int, n: int) -> list[float]:
    """Return n sums over all vectors of what a kernel fills in for each block of them."""
    sums = np.zeros((-(-n_vectors // _BLOCK), n))
    in_parts(partial(kernel, *arrays, n_vectors, sums), len(sums), _STEPS * n * arrays[0].size)
    return list(sums.sum(axis=0).tolist())


def _solved(lower: Floats, right: Sequence[float] | Floats) -> Floats:
    """Solve a lower triangular system; a library's bits depend on the processor."""
    values: list[float] = []
    for row, value in zip(lower.tolist(), right, strict=True):
        values.append((value - sum(map(mul, row, values))) / row[len(values)])
    return np.array(values)


@dataclass(frozen=True, slots=True, eq=False)
class Descent:
    """The end of a descent.

    Attributes
    ----------
    generators : (K, D) float64 array
    moments : Moments
        Of their cells.
    energies : tuple of float
        At the start and after each move that was kept.
    converged : bool
        Whether the energy came to rest.
    """

    generators: Points
    moments: Moments
    energies: tuple[float, ...]
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """Conditions that a descent must respect.

    Attributes
    ----------
    stopping : Stopping
        When to stop.
    free : (K,) bool array or None
        Which generators may move; None lets all.
    project : callable or None
        Brings moved generators back to where they may be.
    may_rise : bool
        Whether a projection is known to raise the energy now and then, which then stops nothing.
    watch : Watch
        Called with the energy before each move.
    """

    stopping: Stopping
    free: Bools | None = None
    project: Projection | None = None
    may_rise: bool = False
    watch: Watch = field(default_factory=Watch)

    def moved(self, generators: Points, step: Points) -> Points:
        """Move the free generators, then project them to the allowed set."""
        there = generators + step
        if self.project is not None:
            there = self.project(there, generators)
        return there if self.free is None else np.where(self.free[:, None], there, generators)


class _MayRise(Stopping):
    """A rise is no rest: the next move may lower the energy."""

    def converged(self, energies: list[float]) -> bool:
        return not (len(energies) > 1 and energies[-1] > energies[-2]) and Stopping.converged(self, energies)


#: From the moments of cells, initial generators (K, D) and the terms to the end.
Descend = Callable[[CellMoments, Points, Terms], Descent]


def lloyd(moments: CellMoments, generators: Points, terms: Terms, factor: float = 1.0) -> Descent:
    """Move each generator to the center of mass of its cell: sure, and slow near the end; or `factor` times as far."""

    def move(at: _State) -> _State:
        there = _moved(moments, at, factor * at.to_centroids, terms)
        is_plain = factor == 1 or there.energy < at.energy
        return there if is_plain else _moved(moments, at, at.to_centroids, terms)

    return _follow(moments, generators, terms, move)


#: Takes about half of Lloyd's moves; nearer to 2, steps go to and fro.
over_relaxed: Descend = partial(lloyd, factor=1.8)


def l_bfgs(moments: CellMoments, generators: Points, terms: Terms) -> Descent:
    """Limited-memory BFGS that starts from Lloyd's step: a third of Lloyd's moves, and lower energies.

    Y. Liu, W. Wang, B. Levy, F. Sun, D.-M. Yan, L. Lu, C. Yang, On centroidal Voronoi tessellation: energy smoothness
    and fast computation, ACM Trans. Graphics 28 (2009), doi 10.1145/1559755.1559758.
    """
    return _follow(moments, generators, terms, _QuasiNewton(moments, terms))


#: The registry: names for `method`.
DESCENTS: dict[str, Descend] = {"l-bfgs": l_bfgs, "lloyd": lloyd, "over-relaxed": over_relaxed}


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """Generators and the moments of their cells."""

    generators: Points
    moments: Moments

    @property
    def energy(self) -> float:
        return self.moments.energy

    @property
    def to_centroids(self) -> Points:
        return self.moments.centroids - self.generators


def _follow(moments: CellMoments, generators: Points, terms: Terms, move: Callable[[_State], _State]) -> Descent:
    """Move until the energy rests. Cells without mass are refilled first: no gradient leads out of them."""
    at = _State(generators, moments(generators))
    stopping = terms.stopping
    if terms.may_rise:
        stopping = _MayRise(stopping.tolerance, stopping.max_iterations)

    def step() -> float | None:
        nonlocal at
        there = _refilled(moments, at, terms) or move(at)
        if there.energy >= at.energy and not terms.may_rise:
            return None
        at = there
        return at.energy

    history = iterate(at.energy, step, stopping, terms.watch)
    return Descent(at.generators, at.moments, tuple(history.energies), history.converged)


class _QuasiNewton:
    """Moves of limited-memory BFGS; towards Lloyd's where a search along the direction finds nothing."""

    def __init__(self, moments: CellMoments, terms: Terms) -> None:
        self._moments = moments
        self._terms = terms
        self._memory = StepMemory()
        self._last: tuple[_State, Points] | None = None
        self._next: _State | None = None

    def __call__(self, at: _State) -> _State:
        pulls = 2 * at.moments.masses[:, None] * at.to_centroids
        if self._terms.free is not None:
            pulls[~self._terms.free] = 0
        if self._last is None or at is not self._next:  # others have moved generators
            self._memory.clear()
        else:
            before, old = self._last
            self._memory.learn(at.generators, before.generators, old, pulls)
        self._last = at, pulls
        self._next = self._search(at, pulls)
        return self._next

    def _search(self, at: _State, pulls: Points) -> _State:
        masses, directions = at.moments.masses, [at.to_centroids]
        if self._memory:
            to_lloyd = np.divide(0.5, masses, out=np.zeros_like(masses), where=masses > 0)
            directions.insert(0, self._memory.step(pulls, to_lloyd[:, None]))
        for direction in directions:
            length = 1.0
            while length > _SHORTEST:
                there = _moved(self._moments, at, length * direction, self._terms)
                promised = max(float(np.einsum("nd,nd", pulls, there.generators - at.generators)), 0.0)
                if there.energy <= at.energy - _ENOUGH * promised:
                    return there
                length /= 2
            self._memory.clear()
        return _moved(self._moments, at, at.to_centroids, self._terms)


def _moved(moments: CellMoments, at: _State, step: Points, terms: Terms) -> _State:
    generators = terms.moved(at.generators, step)
    return _State(generators, moments(generators))


def each_with_cell(moments: CellMoments, generators: Points, project: Projection) -> tuple[Points, Moments]:
    """Place generators whose cells have no mass anew, in the heaviest cells, as long as that lowers the energy."""
    terms = Terms(Stopping.after(0), project=project)
    at: _State | None = _State(generators, moments(generators))
    while at is not None:
        last, at = at, _refilled(moments, at, terms)
    return last.generators, last.moments


def _refilled(moments: CellMoments, at: _State, terms: Terms) -> _State | None:
    """Move each free generator without mass into one of the heaviest cells; None if there is none, or it is no use."""
    free = np.ones(len(at.generators), bool) if terms.free is None else terms.free
    empty = np.flatnonzero(free & (at.moments.masses == 0))
    if not len(empty):
        return None
    heaviest = np.argsort(-at.moments.masses, kind="stable")[: len(empty)]
    heaviest = heaviest[at.moments.masses[heaviest] > 0]
    empty = empty[: len(heaviest)]
    from scipy.spatial import cKDTree

    centroids = at.moments.centroids[heaviest]
    kept = np.delete(at.generators, np.flatnonzero(at.moments.masses == 0), axis=0)
    gaps = cKDTree(kept).query(centroids, min(2, len(kept)))[0].reshape(len(centroids), -1)[:, -1]
    # On both sides of the center of mass, a quarter of the way to the next generator.
    aside = np.zeros_like(centroids)
    aside[np.arange(len(aside)), np.arange(len(aside)) % aside.shape[1]] = 0.25 * gaps
    step = np.zeros_like(at.generators)
    step[heaviest] = centroids - aside - at.generators[heaviest]
    step[empty] = centroids + aside - at.generators[empty]
    there = _moved(moments, at, step, terms)
    return there if there.energy < at.energy else None
