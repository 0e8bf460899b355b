import numpy as np
from numpy.typing import NDArray

def cover_rows(
    centers: NDArray[np.float64],
    radii: NDArray[np.float64],
    starts: NDArray[np.int64],
    disks: NDArray[np.int32],
    first_row: int,
    stop_row: int,
    fine: int,
    coverage: NDArray[np.float32],
) -> None: ...
def add_colors(
    image: NDArray[np.float32],
    labels: NDArray[np.int32],
    first_row: int,
    stop_row: int,
    sums: NDArray[np.float64],
) -> None: ...
def add_border_gradient(
    image: NDArray[np.float32],
    labels: NDArray[np.int32],
    points: NDArray[np.float64],
    colors: NDArray[np.float64],
    first_row: int,
    stop_row: int,
    gradient: NDArray[np.float64],
) -> None: ...
def label_triangles(points: NDArray[np.float64], triangles: NDArray[np.int32], labels: NDArray[np.int32]) -> None: ...
def add_edge_gradient(
    image: NDArray[np.float32],
    points: NDArray[np.float64],
    edges: NDArray[np.int32],
    colors: NDArray[np.float64],
    gradient: NDArray[np.float64],
) -> None: ...
def join(pairs: NDArray[np.int32], links: NDArray[np.int32], parents: NDArray[np.int32]) -> int: ...
def walk(links: NDArray[np.int32], start: int, tour: NDArray[np.int32]) -> None: ...
def improve(
    points: NDArray[np.float64],
    near: NDArray[np.int32],
    tour: NDArray[np.int32],
    places: NDArray[np.int32],
    settled: NDArray[np.uint8],
    reach: int,
) -> int: ...
