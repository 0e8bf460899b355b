"""Place points on surfaces with a boundary: their cells are sums over samples, and end where the surface does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.sums import sum_by_label
from cvtimg.engine.samples import WeightedSamples
from cvtimg.engine.tessellation import tessellate
from cvtimg.surfaces.surface import Surface
from cvtimg.surfaces.triangulation import Points, SurfaceTriangulation, Triangles

Values = NDArray[np.float64]

#: Cosine of the angle from which on a triangle is flat.
_FLAT = -0.5


def place_by_samples(
    surface: Surface, fine: SurfaceTriangulation, weights: Values, n: int, moves: int, least: float
) -> tuple[Points, Triangles, Values, float, int]:
    """Move points to the centers of mass of the samples nearest to them, projected to the surface.

    Parameters
    ----------
    surface : Surface
    fine : SurfaceTriangulation
        Triangles that are small beside cells; the samples are their vertices.
    weights : (N,) array
        Of the samples.
    n : int
        Number of points.
    moves, least : int and float
        Moves at most, and the offset at which they end.

    Returns
    -------
    points, triangles, masses, offset, n_iter
    """
    from scipy.spatial import KDTree

    # Centers of mass in space, near the surface, to start from; then those that are on it.
    points = tessellate(WeightedSamples(fine.points.copy(), weights.copy(), in_order=False), n).generators
    face = fine.face_of_each()
    whole = KDTree(fine.points)
    sizes, move = np.ones(n), 0
    points, _, _ = surface.nearest(points, face[whole.query(points)[1]], fine)
    area = fine.vertex_areas()
    while True:
        _, labels = KDTree(points).query(fine.points)
        masses = sum_by_label(labels, weights, n)
        heavy = masses > 0
        sums = sum_by_label(labels, fine.points, n, weights)
        centers = np.where(heavy[:, None], sums / np.where(heavy, masses, 1)[:, None], points)
        sizes = np.sqrt(np.maximum(sum_by_label(labels, area, n), 1e-300))
        there, _, _ = surface.nearest(centers, face[whole.query(centers)[1]], fine)
        offset = float(np.sqrt(np.mean((np.linalg.norm(there - points, axis=1) / sizes) ** 2)))
        if offset <= least or move == moves:
            return points, _without_flat(points, _dual(labels, fine.triangles)), masses, offset, move
        points, move = there, move + 1


def _dual(labels: NDArray[np.intp], triangles: Triangles) -> Triangles:
    """Join points whose cells meet in a triangle.

    Where the same three cells meet in several triangles, those that go around in opposite directions cancel out: what
    is left has no holes, as it is the image of a surface that has none.
    """
    corners = labels[triangles]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    first = np.argmin(corners, axis=1)
    turned = np.take_along_axis(corners, (first[:, None] + np.arange(3)) % 3, axis=1)
    direction = np.where(turned[:, 1] < turned[:, 2], 1, -1)
    keys, where = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True)
    sums = np.bincount(where.ravel(), direction, len(keys))
    found = np.where((sums < 0)[:, None], keys[:, [0, 2, 1]], keys)
    return np.ascontiguousarray(found[np.abs(sums) > 0.5], np.int32)


def _without_flat(points: Points, triangles: Triangles) -> Triangles:
    """Leave out flat triangles at the boundary, where cells that are long beside it meet far outside of them."""
    while len(triangles):
        mesh = SurfaceTriangulation(points, triangles)
        corner = np.flatnonzero(mesh.twins.ravel() < 0)  # where an edge of the boundary begins
        face, k = corner // 3, corner % 3
        start, end, apex = (triangles[face, (k + step) % 3] for step in range(3))
        one, other = points[start] - points[apex], points[end] - points[apex]
        lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
        # An apex inside comes to the boundary; one that is there would be its end on both sides.
        flat = (np.einsum("ij,ij->i", one, other) < _FLAT * lengths) & ~np.isin(apex, start)
        _, first = np.unique(apex[flat], return_index=True)
        if not len(first):
            break
        triangles = np.delete(triangles, face[flat][first], axis=0)
    return triangles
