"""How the vertices of a mesh move until each is the center of mass of its own Voronoi cell.

It is the descent of `cvtimg.placement` but for three things: steps are limited so that no triangle turns over, cells
are those of a triangulation that flips with them, and the masses of cells are 2 x 2 matrices where the metric is not
that of a size alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from cvtimg._shared.progress import tell
from cvtimg._shared.types import Floats, Points
from cvtimg.meshes.fields import Field
from cvtimg.meshes.triangulation import FREE, PlaneTriangulation
from cvtimg.placement.descent import StepMemory


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """The energy, Lloyd's steps, what multiplies by the mass matrices, their inverses, and wanted edge lengths."""

    energy: float
    steps: Points
    masses: Callable[[Points], Points]
    to_lloyd: Floats  # (N, 3)
    sizes: Floats


def relax(mesh: PlaneTriangulation, field: Field, *, most: int, tolerance: float) -> tuple[tuple[float, ...], bool]:
    """Move the vertices that are not fixed, `most` times at most, by limited-memory BFGS on Lloyd's steps.

    None moves by more than half of the wanted edge length at once.

    They rest when none is farther than the part `tolerance` of the wanted edge length from its center of mass. Returns
    the energy at the start and after each move, and whether they came to rest.
    """
    at = _state(mesh, field)
    energies = [at.energy]
    memory = StepMemory()
    rested = False
    while len(energies) <= most and not rested:
        before, pulls = mesh.points.copy(), at.masses(at.steps)
        steps, longest = memory.step(pulls, at.to_lloyd), at.sizes / 2
        mesh.move(steps * (longest / np.maximum(_lengths(steps), longest))[:, None])
        there = _state(mesh, field)
        # Where a metric is interpolated, the energy may rise a little.
        if len(memory) and there.energy > at.energy * (1 + 1e-7):
            memory.clear()  # and the way goes on from there
        else:
            # The masses here, for both: with a density, that learns better than the change of the gradient.
            memory.learn(mesh.points, before, there.masses(at.steps), there.masses(there.steps))
        at = there
        energies.append(at.energy)
        tell((len(energies) - 1) / most)
        rested = bool((_lengths(at.steps) <= tolerance * at.sizes).all())
    return tuple(energies), rested


def _state(mesh: PlaneTriangulation, field: Field) -> _State:
    values = field.metric(mesh.points)
    mesh.flip(None if field.isotropic else values)
    energy, inertia, pull = mesh.moments(values)
    moves = mesh.fixed == FREE
    xx, xy, yy = inertia.T
    size = xx * yy - xy * xy
    per_size = np.divide(1, size, out=np.zeros_like(size), where=moves & (size > 0) & (xx > 0))
    inverse = inertia[:, ::-1] * [1, -1, 1] * per_size[:, None]
    return _State(energy, _times(inverse, pull), partial(_times, inertia), inverse, _longest(values))


def _times(matrices: Points, steps: Points) -> Points:
    """Multiply symmetric matrices (N, 3), xx, xy and yy, by steps (N, 2)."""
    (xx, xy, yy), (x, y) = matrices.T, steps.T
    return np.stack([xx * x + xy * y, xy * x + yy * y], axis=1)


def _longest(values: Points) -> Floats:
    """Edge lengths that metrics want along their direction of least change."""
    xx, xy, yy = values.T
    half, apart = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return 1 / np.sqrt(np.maximum((xx * yy - xy * xy) / (half + apart), 1e-300))


def _lengths(steps: Points) -> Floats:
    return np.sqrt(np.einsum("nk,nk->n", steps, steps))
