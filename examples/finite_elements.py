"""Linear elements of scikit-fem on meshes of cvtimg, their errors where the solution is known, and bisection.

Bisection is the rival of all examples: the worst triangles of the last mesh are bisected, again and again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementTriP0, ElementTriP1, Functional, InteriorFacetBasis, MeshTri, adaptive_theta

from cvtimg.meshes import Mesh

Values = NDArray[np.float64]
#: Vertices, and the errors in L2 and in H1 or of the gradient.
Row = tuple[int, float, float]


def linear_elements(mesh: Mesh) -> Basis:
    """Return the basis of linear elements on a mesh."""
    triangles = MeshTri(*map(np.ascontiguousarray, (mesh.points.T, mesh.triangles.T.astype(np.int64))))
    return Basis(triangles, ElementTriP1(), intorder=6)


def errors(
    basis: Basis,
    values: NDArray[np.float64],
    exact: Callable[[Any, Any], Any],
    slopes: Callable[[Any, Any], tuple[Any, Any]],
) -> tuple[float, float]:
    """Return the errors in L2 of a solution and of its gradient.

    Parameters
    ----------
    basis : skfem.Basis
    values : (N,) array
        The solution at the vertices.
    exact, slopes : callable
        The true solution and its gradient, from coordinates x and y.
    """

    @Functional
    def in_values(w: Any) -> Any:
        return (w.found - exact(*w.x)) ** 2

    @Functional
    def in_slopes(w: Any) -> Any:
        along, up = slopes(*w.x)
        return (w.found.grad[0] - along) ** 2 + (w.found.grad[1] - up) ** 2

    found = basis.interpolate(values)
    of_values, of_slopes = (float(square.assemble(basis, found=found) ** 0.5) for square in (in_values, in_slopes))
    return of_values, of_slopes


def residuals(
    mesh: MeshTri, values: Values, lacks: Callable[..., Any], conductivity: Callable[[Any, Any], Any]
) -> Values:
    """Estimate the squared error of the gradient on each triangle: what the equation lacks, and jumps of the flux.

    Parameters
    ----------
    mesh : skfem.MeshTri
    values : (N,) array
        The solution at the vertices.
    lacks : callable
        From x, y, the solution and its two slopes to what the equation lacks inside of triangles.
    conductivity : callable
        From x and y.
    """
    basis = Basis(mesh, ElementTriP1(), intorder=4)
    found = basis.interpolate(values)

    @Functional
    def inside(w: Any) -> Any:
        return (w.h * lacks(*w.x, found, *found.grad)) ** 2

    sides = [InteriorFacetBasis(mesh, ElementTriP1(), side=side) for side in (0, 1)]
    of_triangles = conductivity(*mesh.p[:, mesh.t].mean(axis=1))

    @Functional
    def jumps(w: Any) -> Any:
        flux = w.k0 * w.u0.grad - w.k1 * w.u1.grad
        return w.h * (flux[0] * w.n[0] + flux[1] * w.n[1]) ** 2

    fields = {f"u{i}": side.interpolate(values) for i, side in enumerate(sides)}
    fields |= {f"k{i}": side.with_element(ElementTriP0()).interpolate(of_triangles) for i, side in enumerate(sides)}
    of_edges = np.zeros(mesh.facets.shape[1])
    np.add.at(of_edges, sides[0].find, jumps.elemental(sides[0], **fields))
    squared: Values = (inside.elemental(basis) + 0.5 * of_edges[mesh.t2f].sum(axis=0)) / of_triangles
    return squared


def by_bisection(
    mesh: MeshTri,
    solved: Callable[[Basis], tuple[Values, float, float]],
    squared: Callable[[MeshTri, Values], Values],
    most: int,
) -> list[Row]:
    """Bisect the worst triangles, with half of the squared residuals, until there are more than `most` vertices.

    Returns a row for each mesh that has at least 1.4 times as many vertices as that of the last row, and for the last.
    """
    rows: list[Row] = []
    while (n := mesh.p.shape[1]) <= most:
        values, l2, h1 = solved(Basis(mesh, ElementTriP1(), intorder=6))
        if len(rows) > 1 and n < 1.4 * rows[-2][0]:
            rows.pop()
        rows.append((n, l2, h1))
        mesh = bisected(mesh, adaptive_theta(squared(mesh, values), theta=0.5))
    return rows


def bisected(mesh: MeshTri, marked: NDArray[np.intp]) -> MeshTri:
    """Bisect triangles across their longest edges, and others where needed so that triangles meet edge to edge.

    It is M.-C. Rivara's refinement, International Journal for Numerical Methods in Engineering 20 (1984) 745-756, doi
    10.1002/nme.1620200412.
    """
    points, triangles = mesh.p.T, mesh.t.T
    sides = np.linalg.norm(points[triangles[:, [1, 2, 0]]] - points[triangles[:, [2, 0, 1]]], axis=2)
    turned = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
    triangles = np.take_along_axis(triangles, turned, axis=1)  # the longest edge is opposite to the first corner
    pairs = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    ends, edges = np.unique(pairs, axis=0, return_inverse=True)
    edges = edges.reshape(-1, 3)
    cut = np.zeros(len(ends), bool)
    cut[edges[marked, 0]] = True
    while (more := cut[edges].any(axis=1) & ~cut[edges[:, 0]]).any():
        cut[edges[more, 0]] = True
    middles = len(points) + np.cumsum(cut) - 1
    (a, b, c), (m, ca, ab) = triangles.T, middles[edges].T
    first, second, third = cut[edges].T
    parts = [
        triangles[~first],
        np.stack((m, a, b), axis=1)[first & ~third],
        *(np.stack(three, axis=1)[first & third] for three in ((m, a, ab), (m, ab, b))),
        np.stack((m, c, a), axis=1)[first & ~second],
        *(np.stack(three, axis=1)[first & second] for three in ((m, c, ca), (m, ca, a))),
    ]
    places = np.concatenate([points, points[ends[cut]].mean(axis=1)])
    return MeshTri(np.ascontiguousarray(places.T), np.ascontiguousarray(np.concatenate(parts).T))


def slope(rows: list[Row] | NDArray[np.float64], column: int) -> float:
    """Return the slope of a column of errors against vertices, both as logarithms, in the second half of the rows."""
    half = np.log(np.asarray(rows)[len(rows) // 2 :])
    return float(np.polyfit(half[:, 0], half[:, column], 1)[0])


def print_table(title: str, rows: list[Row]) -> None:
    """Print vertices and errors, and the slopes of errors: -1 in L2 and -1/2 in H1 are the best that elements have."""
    print(f"{title}\nvertices      in L2       in H1")
    for n, l2, h1 in rows:
        print(f"{n:8d}  {l2:.3e}   {h1:.3e}")
    print(f"slopes    {slope(rows, 1):9.2f}   {slope(rows, 2):9.2f}")
