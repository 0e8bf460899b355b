import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_Indices = NDArray[np.int32]
_Flags = NDArray[np.uint8]

def join(triangles: _Indices, twins: _Indices, first: _Indices, after: _Indices) -> None: ...
def flip(
    points: _Floats,
    metric: _Floats | None,
    triangles: _Indices,
    twins: _Indices,
    borders: _Flags,
    corners: _Indices,
    most: int,
    stack: _Indices,
    waiting: _Flags,
) -> int: ...
def sum_cells(
    points: _Floats,
    metric: _Floats,
    triangles: _Indices,
    twins: _Indices,
    borders: _Flags,
    corners: _Indices,
    inertia: _Floats,
    pull: _Floats,
) -> float: ...
def move(
    points: _Floats,
    fixed: _Flags,
    steps: _Floats,
    triangles: _Indices,
    twins: _Indices,
    borders: _Flags,
    corners: _Indices,
    least: _Floats,
    is_late: _Flags,
) -> None: ...
def mean_square(points: _Floats, metric: _Floats, triangles: _Indices, twins: _Indices) -> float: ...
def even(
    points: _Floats,
    metric: _Floats,
    fixed: _Flags,
    steps: _Floats,
    mean: float,
    share: float,
    triangles: _Indices,
    twins: _Indices,
    borders: _Flags,
    corners: _Indices,
) -> None: ...
def smooth(
    points: _Floats,
    metric: _Floats,
    fixed: _Flags,
    power: int,
    triangles: _Indices,
    twins: _Indices,
    borders: _Flags,
    corners: _Indices,
) -> None: ...
def locate(
    points: _Floats,
    triangles: _Indices,
    twins: _Indices,
    places: _Floats,
    found: _Indices,
    shares: _Floats,
) -> None: ...
