"""Triangles of a surface: their flips and cells, and splitting of long edges."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

import cvtimg.surfaces._surfaces as _surfaces
from cvtimg._shared.checks import check_that
from cvtimg._shared.sums import sum_by_label
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Bools, Floats, Indices, Points, Triangles
from cvtimg.halfedges import MOST_FLIPS, HalfEdges, connected_parts, edge_keys, edges_around, find_twins
from cvtimg.meshes.trees import LAST_LEVEL


class SurfaceTriangulation(HalfEdges):
    """Triangles of a surface in space, counterclockwise from outside."""

    def areas(self) -> Floats:
        """Return the areas (T,) of triangles."""
        a, b, c = (self.points[self.triangles[:, k]] for k in range(3))
        return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2

    def edge_lengths(self) -> Floats:
        """Return the lengths (3 T,) of half-edges."""
        return np.linalg.norm(np.subtract(*self.points[self.edges.T]), axis=1)

    def vertex_areas(self) -> Floats:
        """Return a third of the areas (N,) of the triangles at each vertex."""
        return sum_by_label(self.triangles.ravel(), np.repeat(self.areas() / 3, 3), len(self.points))

    def face_normals(self, faces: Triangles | slice = slice(None)) -> Points:
        """Return outward unit normals of triangles, of all by default."""
        a, b, c = (self.points[corners] for corners in self.triangles[faces].T)
        return unit(np.cross(b - a, c - a))

    def normals(self) -> Points:
        """Return outward unit normals (N, 3) at the vertices: the mean of their triangles."""
        return unit(sum_by_label(self.triangles.ravel(), np.repeat(self.face_normals(), 3, axis=0), len(self.points)))

    def flip(self, normals: Points) -> None:
        """Flip edges until opposite angles add up to at most 180 degrees, but fold nothing."""
        _surfaces.flip(self, normals, MOST_FLIPS * len(self.triangles))

    def moments(self, density: Floats) -> tuple[Floats, Points]:
        """Return the masses (N,) of the cells of points, and the steps (N, 3) to their centers of mass."""
        masses, pulls = _surfaces.sum_cells(self, density)
        # A cell of no mass, or of a negative one where angles are obtuse, stays.
        heavy = masses > 1e-9 * masses.mean()
        return masses, np.where(heavy[:, None], pulls / np.where(heavy, masses, 1)[:, None], 0)

    def nearest(self, places: Points, faces: Triangles) -> tuple[Points, Triangles]:
        """Walk from faces to the nearest points to places; return them and their faces."""
        feet, last = np.ascontiguousarray(places).copy(), faces.copy()
        in_parts(partial(_surfaces.walk, self, feet, last), len(feet), 300.0 * len(feet))  # steps of the kernel
        return feet, last

    def cut(self, features: Bools) -> tuple[SurfaceTriangulation, Indices]:
        """Cut along half-edges (3 T,), so that each side has vertices of its own; return what these were, too."""
        edge = np.where(features, -1, number_edges(self.triangles, len(self.points)))
        sites, triangles = divide_fans(self.triangles, edge)
        return SurfaceTriangulation(self.points[sites], triangles), sites

    def on_boundary(self) -> Bools:
        """Tell which vertices (N,) are on the boundary."""
        is_outer = np.zeros(len(self.points), np.bool_)
        is_outer[self.edges[self.twins.ravel() < 0]] = True
        return is_outer

    def face_of_each(self) -> Triangles:
        """Return a triangle (N,) at each vertex; any number for vertices without one."""
        face = np.zeros(len(self.points), np.int32)
        face[self.triangles.ravel()] = np.arange(self.triangles.size, dtype=np.int32) // 3
        return face


def unit(vectors: Points) -> Points:
    """Scale (N, 3) vectors to length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


def number_edges(triangles: Triangles, n_points: int) -> Triangles:
    """Return the edge (3 T,) of each half-edge, numbered by one of its half-edges, of which it may have many."""
    twins = find_twins(triangles, n_points).ravel()
    edge = np.maximum(np.arange(triangles.size, dtype=np.int32), twins)
    alone = np.flatnonzero(twins < 0)
    keys = edge_keys(edges_around(triangles)[alone], n_points)
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    edge[alone] = alone[first][which]
    return edge


def check_directions(points: Points, triangles: Triangles) -> None:
    """Refuse two triangles at an edge that go around in different directions."""
    edge = number_edges(triangles, len(points))
    wrong = np.flatnonzero((np.bincount(edge)[edge] == 2) & (find_twins(triangles, len(points)).ravel() < 0))
    for half in wrong[:1].tolist():
        ends = [tuple(points[triangles[half // 3, (half + step) % 3]].tolist()) for step in range(2)]
        demand = "go around in one direction: turn one, or cut the surface if it has one side only"
        check_that(f"faces at the edge from {ends[0]} to {ends[1]}", False, demand)


def divide_fans(triangles: Triangles, edge: Triangles) -> tuple[Indices, Triangles]:
    """Give each fan of triangles a vertex of its own where several meet in one; return what these were, and triangles.

    Fans go on across edges that are numbered alike (3 T,), but not across those of number -1. Unused vertices vanish.
    """
    vertices, halves = triangles.ravel(), np.arange(triangles.size)
    following = halves.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    order = np.argsort(edge, kind="stable")
    is_same = (edge[order[1:]] == edge[order[:-1]]) & (edge[order[1:]] >= 0)
    corner, other = order[:-1][is_same], order[1:][is_same]
    turned = vertices[corner] == vertices[other]
    starts, ends = np.where(turned, other, following[other]), np.where(turned, following[other], other)
    links = np.concatenate([corner, following[corner]]), np.concatenate([starts, ends])
    n_fans, fan = connected_parts(links, len(halves))
    origin = np.empty(n_fans, np.intp)
    origin[fan] = vertices
    return origin, fan.astype(np.int32).reshape(-1, 3)


def divided(points: Points, triangles: Triangles) -> SurfaceTriangulation:
    """Give each fan of triangles a vertex of its own where several meet in one, and leave out unused vertices."""
    origin, triangles = divide_fans(triangles, number_edges(triangles, len(points)))
    return SurfaceTriangulation(points[origin], triangles)


def split_long_edges(
    mesh: SurfaceTriangulation, limits: Callable[[Points], Floats], on_surface: Callable[[Points], Points]
) -> SurfaceTriangulation:
    """Halve edges until none is longer than `limits` allow at points (N, 3); their middles go to the surface."""
    points, triangles = mesh.points, np.ascontiguousarray(mesh.triangles)
    allowed = limits(points)
    for _ in range(LAST_LEVEL):  # each halves the longest edges
        edge = number_edges(triangles, len(points))
        first = np.flatnonzero(edge == np.arange(len(edge)))
        a, b = triangles.ravel()[first], triangles[:, [1, 2, 0]].ravel()[first]
        is_long = np.linalg.norm(points[a] - points[b], axis=1) > (allowed[a] + allowed[b]) / 2
        if not is_long.any():
            break
        a, b = a[is_long], b[is_long]
        middles = on_surface((points[a] + points[b]) / 2)
        number = np.full(triangles.size, -1, np.int32)
        number[first[is_long]] = np.arange(len(points), len(points) + len(middles), dtype=np.int32)
        triangles = _split(triangles, number[edge].reshape(-1, 3))
        points = np.concatenate([points, middles])
        allowed = np.concatenate([allowed, limits(middles)])
    return SurfaceTriangulation(points, triangles)


def _split(triangles: Triangles, middles: Triangles) -> Triangles:
    """Divide triangles at the middles of their sides 0-1, 1-2 and 2-0, where these are >= 0."""
    n_split = (middles >= 0).sum(axis=1)
    # Turn each so that side 0-1 is split and, of two, 1-2 as well; of one or two there is one such turn.
    first = np.where(n_split == 2, (np.argmin(middles, axis=1) + 1) % 3, np.argmax(middles, axis=1))
    turns = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, turns, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, turns, axis=1).T
    patterns = (
        [(a, b, c)],
        [(a, ab, c), (ab, b, c)],
        [(ab, b, bc), (a, ab, bc), (a, bc, c)],
        [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    )
    parts = [
        np.stack([corner[n_split == count] for corner in part], axis=1)
        for count, pattern in enumerate(patterns)
        for part in pattern
    ]
    return np.ascontiguousarray(np.concatenate(parts), np.int32)
