"""Distances of points on a surface: by a density, growing gradually, and shorter where the surface bends."""

from __future__ import annotations

from dataclasses import dataclass
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg._shared.sums import sum_by_label
from cvtimg.meshes.trees import limited_along_edges
from cvtimg.placement.densities import Density
from cvtimg.surfaces.features import Mask
from cvtimg.surfaces.surface import VertexDensity
from cvtimg.surfaces.triangulation import Points, SurfaceTriangulation, Triangles, number_edges, unit

Values = NDArray[np.float64]

#: Area of a regular hexagon whose neighbors are at distance 1.
HEXAGON = 0.75**0.5


@dataclass(frozen=True, slots=True)
class Grading:
    """How distances of points grow, and how they are found."""

    sparsest: float = 30.0  # points may be so much farther from each other than where the density is largest
    most_zeros: float = 0.01  # a density that is 0 at more places is warned of
    grade: float = 0.3  # distances grow by so much for each unit of length, at most,
    too_steep: float = 1.25  # unless they are by less than this factor too long
    near: float = 0.01  # as a logarithm: what is near enough to those with which there are as many points as wanted
    most: float = 20.0  # and what is beyond them
    missed: float = 0.8  # on a finer mesh they are made shorter where they come out less by this factor
    least_passes: int = 2  # curvatures are means around vertices, passed on to neighbors so often:
    most_passes: int = 64  # about half as far as points are apart
    triangle: float = 1 / 4  # how far one with corners on a ball is from it, by (distance of points)^2 / radius,
    edge: float = 1 / 6  # and an edge with ends on a circle: 1/6 and 1/8 if no edge were longer than that
    corner: float = 0.7  # curves have one where two directions add up to a longer sum


_GRADING = Grading()


class Sizes:
    """Distances of n points by a density, looked at on a mesh; no more than limits (N,) at its vertices allow."""

    def __init__(self, mesh: SurfaceTriangulation, n: int, density: Density, limits: Values | None = None) -> None:
        from scipy.optimize import brentq

        self._n, self.given, self._lower = n, density, None
        values = density(mesh.points)
        self._top = float(values.max())
        check_that("density", self._top > 0, "be > 0 somewhere on the surface")
        if (zeros := float((values <= 0).mean())) > _GRADING.most_zeros:
            gap = f"cells there are up to {_GRADING.sparsest:g} times as wide as the finest"
            warn(f"the density is 0 on about {zeros:.0%} of the surface: {gap}", stacklevel=5)
        areas, relative = mesh.vertex_areas(), self.relative(mesh.points)
        self.distance = _scale(areas, relative, n)
        limits = np.full(len(areas), np.inf) if limits is None else limits
        wanted = self.distance * relative
        is_gradual = (limited_along_edges(mesh, wanted, _GRADING.grade) * _GRADING.too_steep >= wanted).all()
        if is_gradual and (limits >= wanted).all():
            return

        def graded(power: float) -> Values:
            return limited_along_edges(mesh, np.minimum(np.exp(power) * wanted, limits), _GRADING.grade)

        power = brentq(lambda power: np.log(_scale(areas, graded(power), n)), -1, _GRADING.most, xtol=_GRADING.near)
        self.distance, sizes = float(self.distance * np.exp(power)), graded(power)
        self._lower = VertexDensity(mesh.points, mesh.triangles, sizes / self.distance)

    def relative(self, places: Points) -> Values:
        """Return the distances (N,) of points around (N, 3) places, by that where the density is largest."""
        sizes = np.minimum(
            (np.maximum(self.given(places), 0) / self._top + _GRADING.sparsest**-4) ** -0.25, _GRADING.sparsest
        )
        return sizes if self._lower is None else np.minimum(sizes, self._lower(places))

    def __call__(self, places: Points) -> Values:
        """Return the distances (N,) of points around (N, 3) places."""
        return self.distance * self.relative(places)

    def density(self, places: Points) -> Values:
        """Return the density (N,) by which points have these distances."""
        return self.given(places) if self._lower is None else self.relative(places) ** -4

    def fits(self, mesh: SurfaceTriangulation) -> bool:
        """Tell whether distances come to the number of points on a finer mesh, too; make them shorter otherwise."""
        factor = _scale(mesh.vertex_areas(), self(mesh.points), self._n)
        is_near = factor > _GRADING.missed
        self.distance *= 1 if is_near else factor
        return is_near


def _scale(areas: Values, sizes: Values, n: int) -> float:
    """Return by how much sizes (N,) have to be longer for n points."""
    return float((areas / sizes**2).sum() / (HEXAGON * n)) ** 0.5


def least_number(mesh: SurfaceTriangulation, limits: Values) -> int:
    """Return about how many points have distances within limits (N,)."""
    return int(np.ceil(_scale(mesh.vertex_areas(), limited_along_edges(mesh, limits, _GRADING.grade), 1) ** 2))


def limits_within(mesh: SurfaceTriangulation, features: Mask, depth: float, n: int) -> Values:
    """Return how far points (N,) may be apart so that triangles and edges on features are within a depth.

    Curvatures are means as far as n points are apart, but not beyond features.
    """
    apart = (mesh.areas().sum() / (HEXAGON * n)) ** 0.5
    n_passes = int(
        np.clip((apart / (2 * mesh.edge_lengths().mean())) ** 2, _GRADING.least_passes, _GRADING.most_passes)
    )
    parts, sites = mesh.cut(features)
    bends = _curvatures(parts, n_passes)
    limits = np.full(len(mesh.points), np.inf)
    np.minimum.at(limits, sites, np.sqrt(depth / (_GRADING.triangle * np.maximum(bends, 1e-300))))
    on_curves = np.sqrt(depth / (_GRADING.edge * np.maximum(_turns(mesh, features, n_passes), 1e-300)))
    return np.minimum(np.minimum(limits, on_curves), mesh.areas().sum() ** 0.5)


def _curvatures(mesh: SurfaceTriangulation, n_passes: int) -> Values:
    """Return the largest principal curvature (N,) at each vertex: angles between faces sum up to a tensor.

    D. Cohen-Steiner, J.-M. Morvan, Restricted Delaunay triangulations and normal cycle, Symposium on Computational
    Geometry (2003) 312-321, doi 10.1145/777792.777839.
    """
    twins, normals = mesh.twins.ravel(), mesh.face_normals()
    own = np.flatnonzero(twins > np.arange(len(twins)))
    a, b = mesh.edges[own].T
    along = mesh.points[b] - mesh.points[a]
    one, other = normals[own // 3], normals[twins[own] // 3]
    across = np.einsum("ij,ij->i", np.cross(one, other), unit(along))
    angles = np.arctan2(across, np.einsum("ij,ij->i", one, other))
    tensors = (angles / 2)[:, None, None] * along[:, :, None] * unit(along)[:, None]
    at = np.concatenate([a, b])
    sums = sum_by_label(at, np.tile(tensors.reshape(-1, 9), (2, 1)), len(mesh.points))
    sums, areas = _passed_on(mesh.edges, np.column_stack([sums, mesh.vertex_areas()]), n_passes)
    return np.abs(np.linalg.eigvalsh((sums / areas).reshape(-1, 3, 3))).max(axis=1)


def _turns(mesh: SurfaceTriangulation, features: Mask, n_passes: int) -> Values:
    """Return the curvature (N,) of curves of features, 0 at corners and elsewhere."""
    edge = number_edges(mesh.triangles, len(mesh.points))
    ends = mesh.edges[features & (edge == np.arange(len(edge)))]
    steps = mesh.points[ends[:, 1]] - mesh.points[ends[:, 0]]
    lengths = np.linalg.norm(steps, axis=1)
    at, n = ends.T.ravel(), len(mesh.points)
    # What leads away from a vertex adds up to its turn.
    away = np.concatenate([unit(steps), -unit(steps)])
    turns, halves = sum_by_label(at, away, n), sum_by_label(at, np.tile(lengths / 2, 2), n)
    smooth = (np.bincount(at, minlength=n) == 2) & (np.linalg.norm(turns, axis=1) < _GRADING.corner)
    turns[~smooth] = 0
    turns, halves = _passed_on(ends, np.column_stack([turns, halves]), n_passes)
    return np.linalg.norm(turns, axis=1) / np.maximum(halves[:, 0], 1e-300)


def _passed_on(edges: Triangles, values: Points, n_passes: int) -> tuple[Points, Points]:
    """Give parts of values (N, ...) to neighbors over edges (E, 2), in passes; return them and the last column."""
    from scipy.sparse import coo_array, eye_array

    n = len(values)
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T
    links = coo_array((np.ones(len(rows)), (rows, columns)), (n, n)).tocsr()
    links.data[:] = 1
    links = links + eye_array(n, format="csr")
    links = links.multiply(1 / np.asarray(links.sum(axis=0))).tocsr()
    for _ in range(n_passes):
        values = links @ values
    return values[:, :-1], values[:, -1:]
