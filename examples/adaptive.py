"""Adaptive loops for four problems, beside uniform meshes and bisection.

Solves -div(k grad u) + b u = f with linear elements of scikit-fem, where u is known:

    peaks       two steep peaks; k = 10 cos y, b = x^2 + y^2
    interfaces  k = 5 and 1 in the quadrants of a square; u is like r^0.5354 where they meet
    gear        a front across a gear with holes
    snowflake   a front across Koch's snowflake

From round to round the residuals on the last mesh make the sizes of the next one, h being proportional to the power
-1/4 of (squared residual) / (area h^2), so that all triangles have the same error in the gradient; sizes live on the
vertices of the last mesh. Prints vertices, and the errors in L2 and of the gradient in L2, of all three kinds of
meshes, and the slopes of errors against vertices: -1 and -1/2 are the best that linear elements can have. Draws the
meshes.

    python examples/adaptive.py [peaks|interfaces|gear|snowflake]... [--most N]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from finite_elements import Row, Values, by_bisection, errors, linear_elements, print_table, residuals
from skfem import Basis, BilinearForm, LinearForm, MeshTri, condense, solve
from skfem.helpers import dot, grad

from cvtimg import mesh_labels, mesh_region
from cvtimg.meshes import Mesh, MeshSize
from cvtimg.plotting import draw_mesh

Function = Callable[[Any, Any], Any]
FIRST, GROWTH = 100, 1.8
#: Of the exponent of the singular solution; F. Kellogg, Applicable Analysis 4 (1974), doi 10.1080/00036817408839086.
ALPHA = 0.5354409456024725


def no_slope(x: Any, _: Any) -> tuple[Any, Any]:
    """Return the gradient of a constant."""
    return 0 * x, 0 * x


@dataclass(frozen=True)
class Problem:
    """An equation with a known solution, and how its region is meshed: by a number of vertices, and sizes."""

    mesh: Callable[..., Mesh]
    exact: Function
    slopes: Callable[[Any, Any], tuple[Any, Any]]
    source: Function
    conductivity: Function = lambda x, _: 1 + 0 * x
    conductivity_slopes: Callable[[Any, Any], tuple[Any, Any]] = no_slope
    reaction: Function = lambda x, _: 0 * x


def peaks() -> Problem:
    """Two peaks in a square."""
    places = ((0.5, 0.5), (-0.5, -0.5))

    def exact(x: Any, y: Any) -> Any:
        return sum(1 / ((x - a) ** 2 + (y - b) ** 2 + 0.01) for a, b in places)

    def slopes(x: Any, y: Any) -> tuple[Any, Any]:
        below = [(a, b, ((x - a) ** 2 + (y - b) ** 2 + 0.01) ** 2) for a, b in places]
        return sum(-2 * (x - a) / square for a, _, square in below), sum(
            -2 * (y - b) / square for _, b, square in below
        )

    def source(x: Any, y: Any) -> Any:
        curvature = 0
        for a, b in places:
            square = (x - a) ** 2 + (y - b) ** 2
            curvature = curvature - 4 / (square + 0.01) ** 2 + 8 * square / (square + 0.01) ** 3
        return 10 * (np.sin(y) * slopes(x, y)[1] - np.cos(y) * curvature) + (x**2 + y**2) * exact(x, y)

    square = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    return Problem(
        lambda n, size: mesh_region(square, n=n, size=size, effort="fast"), exact, slopes, source,
        lambda _, y: 10 * np.cos(y), lambda x, y: (0 * x, -10 * np.sin(y)), lambda x, y: x**2 + y**2,
    )  # fmt: skip


def interfaces() -> Problem:
    """Kellogg's singularity at (1, 1), where four materials meet."""
    sines = np.array([0.4472135955, -0.7453559925, -0.9441175905, -2.401702643])
    cosines = np.array([1.0, 7 / 3, 5 / 9, -13 / 27])

    def polar(x: Any, y: Any) -> tuple[Any, Any, Any]:
        angle = np.arctan2(y - 1, x - 1) % (2 * np.pi)
        return np.hypot(x - 1, y - 1), angle, np.minimum((angle / (np.pi / 2)).astype(int), 3)

    def exact(x: Any, y: Any) -> Any:
        r, angle, part = polar(x, y)
        return r**ALPHA * (sines[part] * np.sin(ALPHA * angle) + cosines[part] * np.cos(ALPHA * angle))

    def slopes(x: Any, y: Any) -> tuple[Any, Any]:
        r, angle, part = polar(x, y)
        steep = ALPHA * np.maximum(r, 1e-300) ** (ALPHA - 1)
        out = steep * (sines[part] * np.sin(ALPHA * angle) + cosines[part] * np.cos(ALPHA * angle))
        around = steep * (sines[part] * np.cos(ALPHA * angle) - cosines[part] * np.sin(ALPHA * angle))
        return out * np.cos(angle) - around * np.sin(angle), out * np.sin(angle) + around * np.cos(angle)

    quadrants = np.array([[1, 2], [3, 4]])
    return Problem(
        lambda n, size: mesh_labels(quadrants, n=n, size=size, tolerance=0, effort="fast"), exact, slopes,
        lambda x, _: 0 * x, lambda x, y: np.where((x - 1) * (y - 1) > 0, 5.0, 1.0),
    )  # fmt: skip


def front(region: Any) -> Problem:
    """A steep front along a circle, in any region."""
    steep, radius = 20.0, 0.6

    def exact(x: Any, y: Any) -> Any:
        return np.tanh(steep * (np.hypot(x - 0.3, y) - radius))

    def slopes(x: Any, y: Any) -> tuple[Any, Any]:
        r = np.maximum(np.hypot(x - 0.3, y), 1e-12)
        rise = steep * (1 - exact(x, y) ** 2) / r
        return rise * (x - 0.3), rise * y

    def source(x: Any, y: Any) -> Any:
        r, u = np.maximum(np.hypot(x - 0.3, y), 1e-12), exact(x, y)
        return steep * (1 - u**2) * (2 * steep * u - 1 / r)

    return Problem(lambda n, size: mesh_region(region, n=n, size=size, effort="fast"), exact, slopes, source)


def gear(n_teeth: int = 12) -> shapely.Polygon:
    """Return a gear with a bore and a ring of holes."""
    turns = 2 * np.pi * (np.arange(4 * n_teeth) + 0.5) / (4 * n_teeth)
    radii = np.tile([1.0, 1.0, 0.82, 0.82], n_teeth)
    whole = shapely.Polygon(np.stack([radii * np.cos(turns), radii * np.sin(turns)], axis=1))
    holes = [shapely.Point(0, 0).buffer(0.2, 16)]
    holes += [shapely.Point(0.5 * np.cos(t), 0.5 * np.sin(t)).buffer(0.11, 16) for t in np.arange(6) * np.pi / 3]
    return whole.difference(shapely.union_all(holes))


def snowflake(rounds: int = 2) -> shapely.Polygon:
    """Return Koch's snowflake."""
    turns = np.pi / 2 + 2 * np.pi * np.arange(3) / 3
    ring = np.exp(1j * turns)
    for _ in range(rounds):
        step = (np.roll(ring, -1) - ring) / 3
        ring = np.stack(
            [ring, ring + step, ring + step + step * np.exp(-1j * np.pi / 3), ring + 2 * step], axis=1
        ).ravel()
    return shapely.Polygon(np.stack([ring.real, ring.imag], axis=1))


PROBLEMS: dict[str, Callable[[], Problem]] = {
    "peaks": peaks,
    "interfaces": interfaces,
    "gear": lambda: front(gear()),
    "snowflake": lambda: front(snowflake()),
}


def solved(problem: Problem, basis: Basis) -> tuple[Values, float, float]:
    """Return the solution at the vertices, with the true one on the boundary, and its errors in L2 and H1."""

    @BilinearForm
    def form(u: Any, v: Any, w: Any) -> Any:
        return problem.conductivity(*w.x) * dot(grad(u), grad(v)) + problem.reaction(*w.x) * u * v

    @LinearForm
    def load(v: Any, w: Any) -> Any:
        return problem.source(*w.x) * v

    edge = basis.get_dofs().flatten()
    values = basis.zeros()
    values[edge] = problem.exact(*basis.doflocs[:, edge])
    found: Values = solve(*condense(form.assemble(basis), load.assemble(basis), x=values, D=edge))
    return found, *errors(basis, found, problem.exact, problem.slopes)


def squared_residuals(problem: Problem, mesh: MeshTri, values: Values) -> Values:
    """Estimate the squared error of the gradient on each triangle."""

    def lacks(x: Any, y: Any, found: Any, along: Any, up: Any) -> Any:
        k_along, k_up = problem.conductivity_slopes(x, y)
        return problem.source(x, y) + k_along * along + k_up * up - problem.reaction(x, y) * found

    return residuals(mesh, values, lacks, problem.conductivity)


def next_size(mesh: Mesh, squared: Values) -> MeshSize:
    """Make sizes at the vertices of a mesh from the squared residuals of its triangles."""
    corners = mesh.points[mesh.triangles]
    sides = corners[:, 1:] - corners[:, :1]
    areas = 0.5 * np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    density = squared / areas**2
    logs = -0.25 * np.log(density + 1e-9 * density.max())
    total, weights = np.zeros(len(mesh.points)), np.zeros(len(mesh.points))
    for k in range(3):
        np.add.at(total, mesh.triangles[:, k], areas * logs)
        np.add.at(weights, mesh.triangles[:, k], areas)
    return MeshSize(mesh.points, mesh.triangles, np.exp(total / weights))


def adaptive(problem: Problem, most: int) -> tuple[list[Row], Mesh]:
    """Run the adaptive loop; return vertices and errors, and the last mesh."""
    mesh, rows, n = problem.mesh(FIRST, None), [], float(FIRST)
    while True:
        basis = linear_elements(mesh)
        values, l2, h1 = solved(problem, basis)
        rows.append((len(mesh.points), l2, h1))
        if n >= most:
            return rows, mesh
        n = min(n * GROWTH, most)
        mesh = problem.mesh(round(n), next_size(mesh, squared_residuals(problem, basis.mesh, values)))


def uniform(problem: Problem, counts: list[int]) -> list[Row]:
    """Solve on meshes of one size."""
    return [(n, *solved(problem, linear_elements(problem.mesh(n, None)))[1:]) for n in counts]


def main(names: list[str], most: int, folder: Path) -> dict[str, dict[str, list[Row]]]:
    """Print the tables of some problems, and draw their last adaptive meshes."""
    tables = {}
    for name in names:
        problem = PROBLEMS[name]()
        rows, mesh = adaptive(problem, most)
        tables[name] = {
            "adaptive": rows,
            "uniform": uniform(problem, [row[0] for row in rows]),
            "bisection": by_bisection(
                linear_elements(problem.mesh(FIRST, None)).mesh,
                partial(solved, problem), partial(squared_residuals, problem), most,
            ),
        }  # fmt: skip
        for kind, found in tables[name].items():
            print_table(f"{name}, {kind}", found)
        drawn = draw_mesh(mesh.points, mesh.triangles, mesh.qualities, mesh.edges, ".png")
        (folder / f"adaptive_{name}.png").write_bytes(drawn)
    return tables


if __name__ == "__main__":
    read = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    read.add_argument("problems", nargs="*", default=list(PROBLEMS), metavar="PROBLEM", help="peaks, interfaces, ...")
    read.add_argument("--most", type=int, default=4920, help="vertices at most")
    read.add_argument("--folder", type=Path, default=Path(), help="for the drawings of meshes")
    given = read.parse_args()
    main(given.problems, given.most, given.folder)
