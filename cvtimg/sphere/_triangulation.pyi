import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_Indices = NDArray[np.int32]
_Flags = NDArray[np.uint8]

def insert(
    points: _Floats,
    order: _Indices,
    inside: _Floats,
    least: float,
    most: int,
    triangles: _Indices,
    twins: _Indices,
    stack: _Indices,
) -> int: ...
def find_twins(triangles: _Indices, twins: _Indices, heads: _Indices, following: _Indices) -> int: ...
def sort_triangles(
    triangles: _Indices,
    twins: _Indices,
    counts: _Indices,
    places: _Indices,
    sorted_triangles: _Indices,
    sorted_twins: _Indices,
) -> None: ...
def half_arcs_of_edges(points: _Floats, triangles: _Indices, start: int, stop: int, arcs: _Floats) -> int: ...
def find_wrong(
    points: _Floats, triangles: _Indices, twins: _Indices, arcs: _Floats, start: int, stop: int, wrong: _Flags
) -> None: ...
def flip(
    points: _Floats,
    triangles: _Indices,
    twins: _Indices,
    arcs: _Floats,
    stack: _Indices,
    depth: int,
    waiting: _Flags,
    most: int,
) -> int: ...
def circumcenters(points: _Floats, triangles: _Indices, start: int, stop: int, centers: _Floats) -> None: ...
def first_edges(triangles: _Indices, firsts: _Indices) -> None: ...
def sum_uniform(
    points: _Floats,
    triangles: _Indices,
    twins: _Indices,
    arcs: _Floats,
    firsts: _Indices,
    start: int,
    stop: int,
    moments: _Floats,
) -> None: ...
def sum_weighted(
    points: _Floats,
    triangles: _Indices,
    twins: _Indices,
    centers: _Floats,
    firsts: _Indices,
    at_points: _Floats,
    at_centers: _Floats,
    start: int,
    stop: int,
    masses: _Floats,
    moments: _Floats,
    energies: _Floats,
) -> None: ...
def list_corners(
    triangles: _Indices, twins: _Indices, firsts: _Indices, offsets: _Indices, corners: _Indices
) -> None: ...
def sum_neighbors(triangles: _Indices, vectors: _Floats, sums: _Floats) -> None: ...
def shortest_edge(points: _Floats, triangles: _Indices) -> tuple[float, int]: ...
def sum_corner_slopes(
    points: _Floats, triangles: _Indices, least_cosine: float, largest_cosine: float, slopes: _Floats
) -> int: ...
