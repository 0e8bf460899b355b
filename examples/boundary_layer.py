"""Meshes for a boundary layer: vertices of one size, and anisotropic ones that follow the recovered Hessian.

Solves -a Laplace(u) + v . grad(u) + b u = f in the unit square with linear elements of scikit-fem, for a = 0.01, v =
(2, 3) and b = 1; the solution has layers at x = 1 and y = 1. At each level some meshes are made, one after the other:
the Hessian of the last solution makes the metric of the next mesh. Prints vertices and errors, beside those of uniform
meshes and of bisection, and draws the last mesh of a few vertices.

    python examples/boundary_layer.py [boundary_layer.png]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from finite_elements import Row, Values, by_bisection, errors, linear_elements, print_table, residuals
from skfem import Basis, BilinearForm, LinearForm, MeshTri, condense, solve
from skfem.helpers import dot, grad

from cvtimg import mesh_region
from cvtimg.meshes import HuangMetric, RecoveredHessian
from cvtimg.placement import Box
from cvtimg.plotting import draw_mesh

DIFFUSION, WIND = 0.01, (2.0, 3.0)
SQUARE = Box([0, 0], [1, 1])
LEVELS = (25, 63, 170, 515, 1524, 4817, 14_200)
#: Meshes made at each level.
ROUNDS = 2


def layers(x: Any, y: Any) -> tuple[Any, Any]:
    """Return the two exponentials that make the layers."""
    return np.exp(40 * (x - 1)), np.exp(60 * (y - 1))


def exact(x: Any, y: Any) -> Any:
    """Return the solution, which is 0 where x or y is 1, and nearly 0 where they are 0."""
    right, top = layers(x, y)
    return (x - right) * (y**2 - top)


def slopes(x: Any, y: Any) -> tuple[Any, Any]:
    """Return the gradient of the solution."""
    right, top = layers(x, y)
    return (y**2 - top) * (1 - 40 * right), (x - right) * (2 * y - 60 * top)


def source(x: Any, y: Any) -> Any:
    """Return the right-hand side."""
    right, top = layers(x, y)
    curvature = (y**2 - top) * -1600 * right + (x - right) * (2 - 3600 * top)
    along, up = slopes(x, y)
    return -DIFFUSION * curvature + WIND[0] * along + WIND[1] * up + exact(x, y)


def solved(basis: Basis) -> tuple[Values, float, float]:
    """Return the solution at the vertices, and its errors in L2 and in H1."""

    @BilinearForm
    def form(u: Any, v: Any, _: Any) -> Any:
        return DIFFUSION * dot(grad(u), grad(v)) + (WIND[0] * grad(u)[0] + WIND[1] * grad(u)[1] + u) * v

    @LinearForm
    def load(v: Any, w: Any) -> Any:
        return source(*w.x) * v

    values = solve(*condense(form.assemble(basis), load.assemble(basis), D=basis.get_dofs()))
    l2, slope = errors(basis, values, exact, slopes)
    return values, l2, float(np.hypot(l2, slope))


def squared_residuals(mesh: MeshTri, values: Values) -> Values:
    """Estimate the squared error of the gradient on each triangle."""

    def lacks(x: Any, y: Any, found: Any, along: Any, up: Any) -> Any:
        return source(x, y) - WIND[0] * along - WIND[1] * up - found

    return residuals(mesh, values, lacks, lambda x, _: DIFFUSION + 0 * x)


def main(path: Path, levels: Sequence[int] = LEVELS) -> dict[str, list[Row]]:
    """Print and return tables of vertices and errors."""
    first = mesh_region(SQUARE, n=levels[0])
    mesh, (values, l2, h1) = first, solved(linear_elements(first))
    rows: list[Row] = [(levels[0], l2, h1)]
    for n in levels[1:]:
        for _ in range(ROUNDS):
            metric = HuangMetric(RecoveredHessian(mesh.points, mesh.triangles, values), SQUARE)
            mesh = mesh_region(SQUARE, n=n, metric=metric)
            values, l2, h1 = solved(linear_elements(mesh))
        rows.append((n, l2, h1))
        if n <= 2000:
            path.write_bytes(draw_mesh(mesh.points, mesh.triangles, mesh.qualities, mesh.edges, path.suffix))
    tables = {
        "anisotropic": rows,
        "uniform": [(n, *solved(linear_elements(mesh_region(SQUARE, n=n)))[1:]) for n in levels],
        "bisection": by_bisection(linear_elements(first).mesh, solved, squared_residuals, levels[-1]),
    }
    for name, table in tables.items():
        print_table(name, table)
    return tables


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "boundary_layer.png"))
