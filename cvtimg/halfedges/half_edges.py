"""Triangles and the half-edges between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.halfedges._halfedges import find_twins

__all__ = ["HalfEdges", "boundary_edges", "find_twins", "half_edges_out"]

Points = NDArray[np.float64]
Triangles = NDArray[np.int32]


class HalfEdges:
    """Triangles; half-edge 3 t + k leads from corner k of triangle t to the next one.

    Attributes
    ----------
    points : (N, 2) or (N, 3) float64 array
    triangles : (T, 3) int32 array
        Indices of points, counterclockwise.
    twins : (T, 3) int32 array
        For each half-edge that which leads back, or -1 on a boundary.
    """

    def __init__(self, points: Points, triangles: Triangles, twins: Triangles | None = None) -> None:
        self.points = np.ascontiguousarray(points)
        self.triangles = np.ascontiguousarray(triangles, np.int32)
        self.twins = find_twins(self.triangles, len(points)) if twins is None else twins

    @property
    def is_closed(self) -> bool:
        """Whether there is no boundary."""
        return bool((self.twins >= 0).all())

    @property
    def euler_characteristic(self) -> int:
        """Vertices minus edges plus triangles: 2 for a sphere, 0 for a torus."""
        n_edges = (self.triangles.size + np.count_nonzero(self.twins < 0)) // 2
        return int(len(self.points) - n_edges + len(self.triangles))

    @property
    def edges(self) -> Triangles:
        """The two ends (3 T, 2) of each half-edge."""
        return np.stack([self.triangles.ravel(), self.triangles[:, [1, 2, 0]].ravel()], axis=1)


def half_edges_out(first: Triangles, twins: Triangles, degrees: Triangles) -> Triangles:
    """List the half-edges (N, M) out of each vertex of a closed surface, counterclockwise from the first; then -1."""
    current = first.copy()
    found = np.full((len(degrees), int(degrees.max())), -1, np.int32)
    for j in range(found.shape[1]):
        some = np.flatnonzero(degrees > j)
        found[some, j] = current[some]
        current[some] = turn_left(current[some], twins)
    return found


def turn_left(half_edges: Triangles, twins: Triangles) -> Triangles:
    """Return the next half-edges out of the same vertices, counterclockwise; -1 at a boundary."""
    return twins.ravel()[np.where(half_edges % 3 == 0, half_edges + 2, half_edges - 1)]


def boundary_edges(triangles: Triangles) -> Triangles:
    """Return the (B, 2) edges that only one triangle has, as it goes around."""
    edges = np.stack([triangles.ravel(), triangles[:, [1, 2, 0]].ravel()], axis=1)
    _, inverse, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    return edges[counts[inverse.reshape(-1)] == 1]
