"""Meshes whose edges are longer in some directions: metrics, and Huang's from the Hessian of what is approximated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import SAMPLES_OF_FIGURE
from cvtimg._shared.checks import check_shape, check_that
from cvtimg._shared.types import Floats, Ints, Points
from cvtimg.meshes.outlines import Outline
from cvtimg.meshes.sizes import MeshValues, estimated_factor
from cvtimg.meshes.trees import CellField, Cells, divide
from cvtimg.placement import as_region

#: From (M, 2) points to (M, 2, 2) symmetric matrices.
MatrixFunction = Callable[[Points], Any]


@dataclass(frozen=True, slots=True, eq=False)
class MetricField(CellField):
    """A metric at all places of a region, by a function, which says itself how it changes, wherever borders are."""

    isotropic: ClassVar[bool] = False

    function: Callable[[Points], Points]  # From (N, 2) points to metrics (N, 3): xx, xy, yy
    cells: Cells  # Of a quadtree as fine as the metric asks for, by area
    factor: float = 1.0  # By which edges are longer than the function says

    @classmethod
    def of(cls, metric: MatrixFunction, outline: Outline, n: int | None, probes: Points) -> MetricField:
        """Sample a function that the user gave, with edges scaled to about `n` vertices."""

        def checked(points: Points) -> Points:  # at each call; outside of the region metrics may be anything
            matrices, values = _matrices("metric", metric(points), len(points))
            sure = np.isfinite(values).all(axis=1) & (values[:, 0] > 0)
            sure[sure] = _determinants(values[sure]) > 0
            outline.check_inside("metric", points, matrices, sure, "be finite and positive definite in the region")
            values[~sure] = values[sure].min(axis=0) if sure.any() else [1.0, 0.0, 1.0]
            return values

        def sizes(points: Points, factor: float = 1.0) -> Floats:
            return factor * _determinants(checked(points)) ** -0.25

        factor = 1.0 if n is None else estimated_factor(sizes, outline, n, probes)
        field = cls(checked, divide(lambda points: sizes(points, factor), outline, probes), factor)
        return field if n is None else field.scaled((field.count / n) ** 0.5)

    def metric(self, points: Points) -> Points:
        return self.function(points) / self.factor**2

    def scaled(self, factor: float) -> MetricField:
        return replace(self, factor=self.factor * factor)

    def limited(self, grade: float, least: float) -> MetricField:
        return self

    def lowered(self, points: Points, sizes: Floats, grade: float) -> MetricField:
        return self

    def _masses(self) -> tuple[Cells, Floats]:
        return self.cells, self.cells.masses(lambda points: np.sqrt(_determinants(self.metric(points))))


class HuangMetric:
    """W. Huang's metric for the error of linear interpolation, by the Hessian of what is interpolated.

    The metric is det(S)^(-1/6) S for S = I + |H| / alpha, with alpha so that the mean of det(S)^(1/3) is 2^(4/3): then
    about as many vertices are where the Hessian is large as elsewhere.

    Parameters
    ----------
    hessian : callable
        From (M, 2) points to (M, 2, 2) Hessians, such as a `RecoveredHessian`.
    region : Region, polygon coordinates, GeoJSON or shapely geometry
        What `cvtimg.placement.as_region` takes.

    References
    ----------
    W. Huang, Metric tensors for anisotropic mesh generation, Journal of Computational Physics 204 (2005) 633-665, doi
    10.1016/j.jcp.2004.10.024.

    Examples
    --------
    >>> from cvtimg import mesh_region
    >>> from cvtimg.meshes import HuangMetric
    >>> from cvtimg.placement import Box
    >>> def hessian(points):
    ...     layer = 100 * np.exp(-20 * points[:, 0])
    ...     return layer[:, None, None] * np.diag([1.0, 0.0])
    >>> square = Box([0, 0], [1, 1])
    >>> len(mesh_region(square, n=200, metric=HuangMetric(hessian, square), effort="fast").points)
    200
    """

    def __init__(self, hessian: MatrixFunction, region: object) -> None:
        self._hessian = hessian
        absolute = self._absolute(as_region(region).draw(SAMPLES_OF_FIGURE))
        largest = float(np.abs(absolute).max())
        check_that("hessian", 0 < largest < np.inf, "be finite and not 0 everywhere")

        def excess(power: float) -> float:  # half of the vertices go where the Hessian is large
            regular = absolute / (np.exp(power) * largest) + np.array([1.0, 0.0, 1.0])
            return float((_determinants(regular) ** (1 / 3)).mean()) - 2 ** (4 / 3)

        from scipy.optimize import bisect

        low, high = np.log([1e-9, 1e3])
        self._alpha = largest * float(np.exp(low if excess(low) < 0 else bisect(excess, low, high)))

    def __call__(self, points: Points) -> Floats:
        """Return metrics (M, 2, 2) at (M, 2) points, but for a factor."""
        regular = self._absolute(points) / self._alpha + np.array([1.0, 0.0, 1.0])
        return _as_matrices(regular * _determinants(regular)[:, None] ** (-1 / 6))

    def _absolute(self, points: Points) -> Points:
        """Hessians (M, 3) with positive eigenvalues."""
        values, vectors = np.linalg.eigh(_matrices("hessian", self._hessian(points), len(points))[0])
        whole = np.einsum("nik,nk,njk->nij", vectors, np.abs(values), vectors)
        return _matrices("hessian", whole, len(points))[1]


class RecoveredHessian(MeshValues):
    """The Hessian of a function that is known at the vertices of a mesh: least squares over two rings of neighbors.

    Parameters
    ----------
    points : (N, 2) array
    triangles : (T, 3) integer array
    values : (N,) array
        At the points.

    Examples
    --------
    >>> from cvtimg import mesh_region
    >>> from cvtimg.meshes import RecoveredHessian
    >>> mesh = mesh_region([[0, 0], [1, 0], [1, 1], [0, 1]], n=60)
    >>> hessian = RecoveredHessian(mesh.points, mesh.triangles, mesh.points[:, 0] ** 2)
    >>> np.abs(hessian(np.array([[0.5, 0.5]]))).round(6).tolist()
    [[[2.0, 0.0], [0.0, 0.0]]]
    """

    def __init__(self, points: ArrayLike, triangles: ArrayLike, values: ArrayLike) -> None:
        super().__init__(points, triangles, "values", values)
        self.values = _fitted_hessians(self.mesh.points, self.mesh.triangles, self.values)

    def __call__(self, points: Points) -> Floats:
        """Return Hessians (M, 2, 2) at (M, 2) points; outside of the mesh, that of the nearest vertex."""
        return _as_matrices(super().__call__(points))


def _fitted_hessians(points: Points, triangles: Ints, values: Floats) -> Points:
    """Fit a quadratic around each vertex; return its second derivatives (N, 3)."""
    from scipy.sparse import coo_array

    pairs = triangles[:, [[0, 1], [1, 2], [2, 0], [1, 0], [2, 1], [0, 2]]].reshape(-1, 2)
    ring = coo_array((np.ones(len(pairs)), pairs.T), (len(points), len(points))).tocsr()
    rings = (ring @ ring + ring).tocsr()
    hessians = np.zeros((len(points), 3))
    for vertex in range(len(points)):
        near = rings.indices[rings.indptr[vertex] : rings.indptr[vertex + 1]]
        steps = points[near] - points[vertex]
        scale = np.maximum(np.abs(steps).max(axis=0), 1e-300)
        x, y = (steps / scale).T
        terms = np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2], axis=1)
        fit = np.linalg.lstsq(terms, values[near], rcond=1e-8)[0]
        hessians[vertex] = fit[3:] / [scale[0] ** 2, scale[0] * scale[1], scale[1] ** 2]
    return hessians


def _matrices(name: str, given: object, n: int) -> tuple[Points, Points]:
    """Return n matrices (N, 2, 2), and their entries (N, 3): xx, xy and yy."""
    matrices = np.asarray(given, np.float64)
    check_shape(name, matrices.shape, matrices.shape == (n, 2, 2), f"({n}, 2, 2)")
    return matrices, np.stack([matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]], axis=1)


def _determinants(values: Points) -> Floats:
    return values[:, 0] * values[:, 2] - values[:, 1] ** 2


def _as_matrices(values: Points) -> Floats:
    return values[:, [[0, 1], [1, 2]]]
