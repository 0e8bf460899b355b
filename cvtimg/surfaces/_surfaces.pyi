import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_Indices = NDArray[np.int32]

def collapse(
    points: _Floats,
    normals: _Floats,
    sizes: _Floats,
    part: float,
    stretch: float,
    most: int,
    triangles: _Indices,
    twins: _Indices,
) -> int: ...
def flip(
    points: _Floats,
    normals: _Floats,
    triangles: _Indices,
    twins: _Indices,
    most: int,
    stack: _Indices,
    waiting: NDArray[np.uint8],
) -> int: ...
def find_inward(points: _Floats, normals: _Floats, triangles: _Indices, wrong: NDArray[np.uint8]) -> int: ...
def sum_cells(
    points: _Floats, density: _Floats, triangles: _Indices, twins: _Indices, masses: _Floats, pulls: _Floats
) -> None: ...
def nearest(
    points: _Floats,
    triangles: _Indices,
    twins: _Indices,
    start: int,
    stop: int,
    places: _Floats,
    faces: _Indices,
) -> None: ...
