"""How points of the sphere move to the centers of mass of their cells, while edges of their triangulation flip."""

from functools import partial
from itertools import count

import numpy as np

import cvtimg.sphere._sphere as _sphere
from cvtimg._shared.iteration import Watch
from cvtimg._shared.threads import in_parts, in_stripes
from cvtimg._shared.types import Bools, Floats, Ints, Points
from cvtimg.placement.descent import Projection, StepMemory
from cvtimg.sphere.triangulation import WORK, Cells, SphereTriangulation, SumCells, unit

#: Sizes of its cell that a point moves at most: with more, more moves turn triangles over and are halved.
_LONGEST = 0.3
#: Part of a move down to which it is halved while it turns triangles over: with more, they are built anew more often.
_SHORTEST = 1e-3
#: Factor by which offsets grow in a move after which steps are forgotten: with more, bad ones are followed for longer.
_WORSE = 2.0
#: Degrees that angles are pushed between: bounds that are nearer to 60 keep farther from 90, and take more moves.
BOUNDS = (49.0, 77.0)
#: Degrees beyond a bound that count as within, as pushed angles hardly reach it: with more, polishing ends sooner.
_NEAR = 0.1
#: Triangles of a stripe in which angles are looked at.
_ROWS = 1 << 14
#: Step length of polishing per unit slope of what angles cost, in areas of cells, and the longest step, in their sizes.
_RATE, _LONGEST_POLISHING = 0.25, 0.05


def descend(
    mesh: SphereTriangulation,
    sum_cells: SumCells,
    most: int,
    tolerance: float,
    *,
    free: Bools | None = None,
    project: Projection | None = None,
    watch: Watch | None = None,
) -> Cells:
    """Move the points of a triangulation by limited-memory BFGS with capped steps; return the cells at the end.

    It ends when free points are no farther than `tolerance` from centers of mass, by the sizes of cells. The energy is
    not searched along a direction: the quadrature of a density is not exactly its own gradient, and where it is, the
    full step is nearly always taken.
    """
    memory, offset, watch = StepMemory(), np.inf, Watch() if watch is None else watch
    before, pulls = mesh.points, np.empty(0)
    for n_moves in count():
        cells = sum_cells(mesh, free)
        if n_moves == 0:
            # A point of a centroidal tessellation has a cell of mass density^(1/2), and that is its stiffness.
            stiffness = np.sqrt(cells.masses / cells.areas)
            loose = (stiffness.mean() / cells.masses.mean() / stiffness)[:, None]
        else:
            memory.learn(mesh.points, before, pulls, cells.pulls)
        last, offset = offset, cells.offset
        if offset > _WORSE * last:
            memory.clear()
        if n_moves == most or offset <= tolerance or watch(cells.energy):
            break
        before, pulls = mesh.points, cells.pulls
        _move(mesh, memory.step(pulls, loose), cells.areas, free, project)
    return cells


def _move(
    mesh: SphereTriangulation, step: Points, areas: Floats, free: Bools | None, project: Projection | None
) -> None:
    """Move points by a step, or as much of it as cells allow and turns no triangle over."""
    part, before = 1.0, mesh.points
    while True:
        there = np.empty(before.shape)
        in_parts(partial(_sphere.move, before, step, areas, part, _LONGEST, there), len(there), WORK * len(there))
        if project is not None:
            there = project(there, before)
        if free is not None:
            there[~free] = before[~free]
        if part < _SHORTEST:
            return mesh.replace(there)
        if mesh.move(there):
            return None
        part /= 2


def polish_angles(
    mesh: SphereTriangulation,
    sizes: Floats,
    most: int,
    *,
    bounds: tuple[float, float] = BOUNDS,
    free: Bools | None = None,
    project: Projection | None = None,
) -> None:
    """Descend the sum of squares by which cosines of angles are out of bounds, in degrees, with flips in between.

    Cells have `sizes` (N,), the roots of their areas. It ends when all angles are within bounds or near to them.
    """
    cosines = np.cos(np.radians(bounds[::-1]))
    ends = np.cos(np.radians([bounds[1] + _NEAR, bounds[0] - _NEAR]))
    n_triangles = len(mesh.triangles)

    def find_out(rows: slice) -> Ints:
        marks = np.empty(rows.stop - rows.start, np.uint8)
        _sphere.find_corners(mesh, *ends, marks, rows.start)
        return np.flatnonzero(marks).astype(np.int32) + np.int32(rows.start)

    for _ in range(most):
        out = np.concatenate(in_stripes(find_out, n_triangles, WORK * n_triangles, _ROWS))
        if not len(out):
            return
        slopes = _sphere.sum_corner_slopes(mesh, *cosines, out)
        moving = np.unique(mesh.triangles[out])
        if free is not None:
            moving = moving[free[moving]]
        step = (-_RATE * sizes[moving] ** 2)[:, None] * slopes[moving]
        lengths = np.sqrt(np.einsum("ij,ij->i", step, step)) / (_LONGEST_POLISHING * sizes[moving])
        step /= np.maximum(lengths, 1)[:, None]
        there = mesh.points.copy()
        there[moving] = unit(mesh.points[moving] + step)
        mesh.replace(there if project is None else project(there, mesh.points))
