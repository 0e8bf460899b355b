import numpy as np
from numpy.typing import NDArray

def sort_into_buckets(
    points: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
    side: int,
    columns: int,
    first: NDArray[np.int32],
    order: NDArray[np.int32],
    places: NDArray[np.float64],
) -> None: ...
def sum_cells(
    density: NDArray[np.float32],
    first: NDArray[np.int32],
    places: NDArray[np.float64],
    side: int,
    columns: int,
    heaviest: float,
    bands: NDArray[np.int32],
    start: int,
    stop: int,
    sums: NDArray[np.float64],
    touched: NDArray[np.int32],
) -> None: ...
def add_parts(
    sums: NDArray[np.float64],
    touched: NDArray[np.int32],
    order: NDArray[np.int32],
    total: NDArray[np.float64],
) -> None: ...
def label_pixels(
    labels: NDArray[np.int32],
    order: NDArray[np.int32],
    first: NDArray[np.int32],
    places: NDArray[np.float64],
    side: int,
    columns: int,
    heaviest: float,
    start: int,
    stop: int,
) -> None: ...
def place_along_curve(weights: NDArray[np.float32], each: float, places: NDArray[np.float64]) -> int: ...
