"""Which cells, edges and vertices of a grid of the sphere touch each other.

Cells belong to generators, edges to pairs of neighbors, and vertices to Delaunay triangles. A half-edge h = 3 t + k
leads from corner k of triangle t to the next one; its twin leads back, in the triangle beyond.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg.halfedges import find_twins, half_edges_out

Indices = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Connectivity:
    """Indices from 0, and -1 where a cell has fewer than M neighbors.

    All orders are counterclockwise, seen from outside: around a cell, edge j is that with neighbor j, and vertex j lies
    between edges j and j + 1. The vertices of an edge follow each other as seen along the way from its first cell to
    its second: from the right to the left.

    Attributes
    ----------
    twins, edge_of : (3 T,) int32 arrays
        Of each half-edge.
    halves : (E,) int32 array
        The half-edge from the first cell of each edge to the second.
    degrees : (N,) int32 array
        Number of neighbors.
    outgoing : (N, M) int32 array
        Half-edges from each generator to its neighbors.
    cells_on_cell, edges_on_cell, vertices_on_cell : (N, M) int32 arrays
    cells_on_edge, vertices_on_edge : (E, 2) int32 arrays
    cells_on_vertex, edges_on_vertex : (T, 3) int32 arrays
        Edge k is that between cells k and k + 1.
    """

    twins: Indices
    edge_of: Indices
    halves: Indices
    degrees: Indices
    outgoing: Indices
    cells_on_cell: Indices
    edges_on_cell: Indices
    vertices_on_cell: Indices
    cells_on_edge: Indices
    vertices_on_edge: Indices
    cells_on_vertex: Indices
    edges_on_vertex: Indices


def connect(triangles: Indices, n: int) -> Connectivity:
    """Find out what touches what in a closed triangulation of `n` points."""
    starts = triangles.ravel()
    ends = triangles[:, [1, 2, 0]].ravel()
    twins = find_twins(triangles, n).ravel()
    numbers = np.arange(len(starts), dtype=np.int32)
    closed = (twins >= 0).all() and (twins[twins] == numbers).all()
    check_that("triangles", closed, "close the sphere, each edge in two triangles that go around in the same direction")
    halves = numbers[numbers < twins]
    edge_of = np.empty(len(starts), np.int32)
    edge_of[halves] = edge_of[twins[halves]] = np.arange(len(halves), dtype=np.int32)
    degrees = np.bincount(starts, minlength=n).astype(np.int32)
    first = np.empty(n, np.int32)
    first[starts[::-1]] = numbers[::-1]
    outgoing = half_edges_out(first, twins, degrees)
    there = outgoing >= 0
    return Connectivity(
        twins,
        edge_of,
        halves,
        degrees,
        outgoing,
        cells_on_cell=np.where(there, ends[outgoing], -1).astype(np.int32),
        edges_on_cell=np.where(there, edge_of[outgoing], -1).astype(np.int32),
        vertices_on_cell=np.where(there, outgoing // 3, -1).astype(np.int32),
        cells_on_edge=np.stack([starts[halves], ends[halves]], axis=1),
        vertices_on_edge=np.stack([twins[halves] // 3, halves // 3], axis=1),
        cells_on_vertex=triangles,
        edges_on_vertex=edge_of.reshape(-1, 3),
    )
