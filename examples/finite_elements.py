"""Linear elements of scikit-fem on meshes of cvtimg, and their errors where the solution is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementTriP1, Functional, MeshTri

from cvtimg.meshes import Mesh


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
