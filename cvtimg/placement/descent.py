"""Descents: how generators move until each is the center of mass of its own cell.

A descent knows nothing of pictures or polygons. It asks for the moments of cells, and lets a projection bring
generators back to where they may be after each move. The gradient of the energy by a generator is 2 m (z - c), for its
mass m and the center of mass c of its cell, so that Lloyd's move to c is a step along it.

Limited-memory BFGS: D. C. Liu, J. Nocedal, On the limited memory BFGS method for large scale optimization, Mathematical
Programming 45 (1989) 503-528, doi 10.1007/BF01589116.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from cvtimg._shared.iteration import Stopping, Watch, iterate
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Array, Bools, Floats, Points
from cvtimg.placement.moments import CellMoments, Moments

#: Where generators (K, D) that have moved may be, given where they came from.
Projection = Callable[[Points, Points], Points]

#: A step is kept if it lowers the energy by this part of what the gradient promises; else halved, down to the shortest.
_ENOUGH, _SHORTEST = 1e-4, 0.05
#: Steps of a kernel that NumPy needs for each number that it is given.
_STEPS = 8


class StepMemory:
    """The inverse Hessian of limited-memory BFGS: the last 5 steps, and how they changed the gradient.

    On surfaces figures hardly change from 5 to 10 steps; in the plane from 4 to 12, and 3 need more moves.
    """

    def __init__(self) -> None:
        self._pairs: deque[tuple[Points, Points, float]] = deque(maxlen=5)  # steps, changes, and their products

    def __len__(self) -> int:
        return len(self._pairs)

    def clear(self) -> None:
        """Forget all steps."""
        self._pairs.clear()

    def learn(self, step: Points, change: Points) -> None:
        """Remember a step and the change of the gradient, unless the energy is not convex along it."""
        along = product_of(step, change)
        if along > 1e-12 * (product_of(step, step) * product_of(change, change)) ** 0.5:
            self._pairs.append((step, change, along))

    def times(self, gradient: Points, start: Callable[[Points], Points]) -> Points:
        """Multiply a gradient by the inverse Hessian, which starts as `start`, at a scale that is learned."""
        rest, factors = gradient, list[float]()
        for step, change, along in reversed(self._pairs):
            factors.append(product_of(step, rest) / along)
            rest = rest - factors[-1] * change
        rest = start(rest)
        if self._pairs:
            _, change, along = self._pairs[-1]
            rest = (along / product_of(start(change), change)) * rest
        for (step, change, along), factor in zip(self._pairs, reversed(factors), strict=True):
            rest = rest + (factor - product_of(change, rest) / along) * step
        return rest


def by_rows(function: Callable[..., Points], first: Array, *others: Array, **options: Any) -> Points:
    """Return what a function makes of the rows of arrays, each row by itself, in the shape of the first array."""
    arrays, result = (first, *others), np.empty(first.shape)

    def compute(start: int, stop: int) -> None:
        result[start:stop] = function(*(array[start:stop] for array in arrays), **options)

    in_parts(compute, len(result), _STEPS * sum(array.size for array in arrays))
    return result


def product_of(first: Points, second: Points) -> float:
    """Sum the products of two (N, D) arrays. The threads of a BLAS would change bits."""
    return float(np.einsum("nd,nd", first, second))


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


def lloyd(moments: CellMoments, generators: Points, terms: Terms) -> Descent:
    """Move each generator to the center of mass of its cell: sure, and slow near the end."""
    return _follow(moments, generators, terms, partial(_relaxed, moments, terms, 1.0))


def over_relaxed(moments: CellMoments, generators: Points, terms: Terms, factor: float = 1.8) -> Descent:
    """Move each generator `factor` times the way to the center of mass of its cell: about half of Lloyd's moves."""
    return _follow(moments, generators, terms, partial(_relaxed, moments, terms, factor))


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


def _relaxed(moments: CellMoments, terms: Terms, factor: float, at: _State) -> _State:
    """Move as Lloyd's method does, `factor` times as far; where that raises the energy, as far."""
    there = _moved(moments, at, factor * at.to_centroids, terms)
    if factor == 1 or there.energy < at.energy:
        return there
    return _moved(moments, at, at.to_centroids, terms)


class _QuasiNewton:
    """Moves of limited-memory BFGS; towards Lloyd's where a search along the direction finds nothing."""

    def __init__(self, moments: CellMoments, terms: Terms) -> None:
        self._moments = moments
        self._terms = terms
        self._memory = StepMemory()
        self._last: tuple[_State, Points] | None = None
        self._next: _State | None = None

    def __call__(self, at: _State) -> _State:
        gradient = -2 * at.moments.masses[:, None] * at.to_centroids
        if self._terms.free is not None:
            gradient[~self._terms.free] = 0
        self._learn(at, gradient)
        self._last = at, gradient
        self._next = self._search(at, gradient)
        return self._next

    def _learn(self, at: _State, gradient: Points) -> None:
        """Remember the last move and how it changed the gradient; forget all when others have moved generators."""
        if self._last is None or at is not self._next:
            self._memory.clear()
            return
        before, old = self._last
        self._memory.learn(at.generators - before.generators, gradient - old)

    def _search(self, at: _State, gradient: Points) -> _State:
        directions = [self._step(gradient, at.moments.masses)] if self._memory else []
        for direction in (*directions, at.to_centroids):
            length = 1.0
            while length > _SHORTEST:
                there = _moved(self._moments, at, length * direction, self._terms)
                promised = min(product_of(gradient, there.generators - at.generators), 0.0)
                if there.energy <= at.energy + _ENOUGH * promised:
                    return there
                length /= 2
            self._memory.clear()
        return _moved(self._moments, at, at.to_centroids, self._terms)

    def _step(self, gradient: Points, masses: Floats) -> Points:
        """Multiply the gradient by the inverse Hessian, which starts from Lloyd's steps."""
        to_lloyd = np.divide(0.5, masses, out=np.zeros_like(masses), where=masses > 0)[:, None]
        return -self._memory.times(gradient, lambda vectors: to_lloyd * vectors)


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
