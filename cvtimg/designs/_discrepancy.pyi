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
    trial: NDArray[np.int32],
    inner: NDArray[np.float64],
    moves: NDArray[np.int32],
    thresholds: NDArray[np.float64],
) -> float: ...
