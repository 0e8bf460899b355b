import numpy as np
from numpy.typing import NDArray

from cvtimg.halfedges import HalfEdges
from cvtimg.sphere.triangulation import SphereTriangulation

_Floats = NDArray[np.float64]
_Indices = NDArray[np.int32]
_Flags = NDArray[np.uint8]

def insert(mesh: HalfEdges, order: _Indices, inside: _Floats, least: float, most: int) -> int: ...
def fill_half_arcs(points: _Floats, triangles: _Indices, arcs: _Floats, start: int, stop: int) -> int: ...
def find_wrong(mesh: SphereTriangulation, arcs: _Floats, wrong: _Flags, start: int, stop: int) -> None: ...
def flip(mesh: SphereTriangulation, arcs: _Floats, wrong: _Flags, most: int) -> bool: ...
def fill_circumcenters(mesh: SphereTriangulation, centers: _Floats, start: int, stop: int) -> None: ...
def first_edges(triangles: _Indices, n_points: int) -> _Indices: ...
def sum_uniform(
    mesh: SphereTriangulation, arcs: _Floats, firsts: _Indices, moments: _Floats, start: int, stop: int
) -> None: ...
def sum_weighted(
    mesh: SphereTriangulation,
    centers: _Floats,
    firsts: _Indices,
    at_points: _Floats,
    at_centers: _Floats,
    masses: _Floats,
    moments: _Floats,
    energies: _Floats,
    start: int,
    stop: int,
) -> None: ...
def sum_corner_slopes(mesh: SphereTriangulation, least_cosine: float, largest_cosine: float) -> tuple[_Floats, int]: ...
def split_moments(
    points: _Floats, moments: _Floats, lengths: _Floats, along: _Floats, start: int, stop: int
) -> None: ...
def sum_products(rows: _Floats, new: NDArray[np.intp], block: int, sums: _Floats, start: int, stop: int) -> None: ...
def move_points(
    points: _Floats,
    rows: _Floats,
    coefficients: _Floats,
    stretches: _Floats,
    areas: _Floats,
    longest: float,
    part: float,
    there: _Floats,
    start: int,
    stop: int,
) -> None: ...
def limit_growth(sizes: NDArray[np.float64], growth: float) -> None: ...
