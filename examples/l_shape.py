"""An adaptive loop for a singularity: the size of the next mesh lives on the vertices of the last.

Solves Laplace's equation in an L-shape, whose solution r^(2/3) sin(2/3 t) has a singularity at the inner corner, with
linear elements of scikit-fem. Sizes follow the recovered Hessian: h is proportional to |H|^(-1/2), which spreads the
error in H1 evenly. Prints vertices and errors, beside those of uniform meshes and bisection, and the slopes of errors
against vertices: -1 in L2 and -1/2 in H1 are optimal. Draws the last mesh.

    python examples/l_shape.py [l_shape.png]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from finite_elements import Row, Values, by_bisection, errors, linear_elements, print_table, residuals
from skfem import Basis, BilinearForm, MeshTri, condense, solve
from skfem.helpers import dot, grad

from cvtimg import mesh_region
from cvtimg.meshes import MeshSize, RecoveredHessian
from cvtimg.plotting import draw_mesh

L_SHAPE = [[0, 0], [0, -1], [1, -1], [1, 1], [-1, 1], [-1, 0]]
LEVELS = (100, 200, 400, 800, 1600, 3200, 6400)
#: No size below this part of the largest.
LEAST = 1e-5


def polar(x: Any, y: Any) -> tuple[Any, Any]:
    """Return radius and angle, which is 0 along one side of the inner corner and 3/2 pi along the other."""
    return np.hypot(x, y), (np.arctan2(y, x) + np.pi / 2) % (2 * np.pi)


def exact(x: Any, y: Any) -> Any:
    """Return the solution."""
    r, t = polar(x, y)
    return r ** (2 / 3) * np.sin(2 / 3 * t)


def slopes(x: Any, y: Any) -> tuple[Any, Any]:
    """Return the gradient of the solution."""
    r, t = polar(x, y)
    steep, turn = 2 / 3 * r ** (-1 / 3), t / 3
    # The angle is measured from the negative y axis.
    return steep * np.cos(turn), steep * np.sin(turn)


def solved(basis: Basis) -> tuple[Values, float, float]:
    """Return the solution at the vertices, and its errors in L2 and in the gradient."""

    @BilinearForm
    def form(u: Any, v: Any, _: Any) -> Any:
        return dot(grad(u), grad(v))

    edge = basis.get_dofs()
    values = basis.zeros()
    values[edge] = exact(*basis.doflocs[:, edge.flatten()])
    values = solve(*condense(form.assemble(basis), x=values, D=edge))
    return values, *errors(basis, values, exact, slopes)


def squared_residuals(mesh: MeshTri, values: Values) -> Values:
    """Estimate the squared error of the gradient on each triangle: inside, linear elements lack nothing."""
    return residuals(mesh, values, lambda x, y, found, along, up: 0 * x, lambda x, _: 1 + 0 * x)


def main(path: Path, levels: Sequence[int] = LEVELS) -> dict[str, list[Row]]:
    """Print and return tables of vertices and errors."""
    first = mesh_region(L_SHAPE, n=levels[0])
    mesh, values = first, solved(linear_elements(first))[0]
    rows: list[Row] = []
    for n in levels:
        hessian = RecoveredHessian(mesh.points, mesh.triangles, values)(mesh.points)
        sizes = np.maximum(np.linalg.norm(hessian, axis=(1, 2)), 1e-12) ** -0.5
        size = MeshSize(mesh.points, mesh.triangles, np.maximum(sizes, LEAST * sizes.max()))
        mesh = mesh_region(L_SHAPE, n=n, size=size)
        values, l2, h1 = solved(linear_elements(mesh))
        rows.append((n, l2, h1))
    tables = {
        "adaptive": rows,
        "uniform": [(n, *solved(linear_elements(mesh_region(L_SHAPE, n=n)))[1:]) for n in levels],
        "bisection": by_bisection(linear_elements(first).mesh, solved, squared_residuals, levels[-1]),
    }
    for name, table in tables.items():
        print_table(name, table)
    path.write_bytes(draw_mesh(mesh.points, mesh.triangles, mesh.qualities, mesh.edges, path.suffix))
    return tables


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "l_shape.png"))
