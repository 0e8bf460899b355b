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
    """

    # (3 T,): of each half-edge.
    twins: Indices
    edge_of: Indices
    halves: Indices  # (E,): the half-edge from the first cell of each edge to the second
    degrees: Indices  # (N,): number of neighbors
    outgoing: Indices  # (N, M): half-edges from each generator to its neighbors
    # (N, M).
    cells_on_cell: Indices
    edges_on_cell: Indices
    vertices_on_cell: Indices
    # (E, 2).
    cells_on_edge: Indices
    vertices_on_edge: Indices
    # (T, 3): edge k is that between cells k and k + 1.
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
