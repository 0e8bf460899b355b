import numpy as np
from numpy.typing import NDArray

def count_others(
    labels: NDArray[np.int32],
    steps: NDArray[np.int32],
    margin: int,
    first: int,
    last: int,
    others: NDArray[np.uint16],
) -> None: ...
def measure_cells(
    values: NDArray[np.float32],
    weights: NDArray[np.float32] | None,
    labels: NDArray[np.int32],
    margin: int,
    means: NDArray[np.float64],
    moments: NDArray[np.float64],
) -> None: ...
def sweep(
    values: NDArray[np.float32],
    weights: NDArray[np.float32] | None,
    labels: NDArray[np.int32],
    others: NDArray[np.uint16],
    stale: NDArray[np.uint8],
    steps: NDArray[np.int32],
    margin: int,
    masses: NDArray[np.float64],
    means: NDArray[np.float64],
    energies: NDArray[np.float64],
    counts: NDArray[np.int32],
    found: NDArray[np.int32],
    edge_weight: float,
    power: float,
    total: float,
    connected: bool,
    backward: bool,
) -> int: ...
