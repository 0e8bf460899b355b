import numpy as np
from numpy.typing import NDArray

def greatest_gap(
    counts: NDArray[np.int32],
    down: NDArray[np.float64],
    right: NDArray[np.float64],
    depth: float,
    share: float,
    sign: float,
) -> float: ...
def walk_boxes(
    points: NDArray[np.float64],
    sides: NDArray[np.float64],
    corner: NDArray[np.int32],
    moves: NDArray[np.int32],
    thresholds: NDArray[np.float64],
) -> float: ...
def swap_coordinates(
    places: NDArray[np.float64], order: NDArray[np.int32], tries: NDArray[np.int32], least: float, periodic: bool
) -> int: ...
def assign_on_torus(
    samples: NDArray[np.float32],
    generators: NDArray[np.float32],
    labels: NDArray[np.int32],
) -> None: ...
