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
def absorb(
    sizes: NDArray[np.int64],
    means: NDArray[np.float64],
    heads: NDArray[np.int32],
    tails: NDArray[np.int32],
    following: NDArray[np.int32],
    others: NDArray[np.int32],
    lengths: NDArray[np.float64],
    parents: NDArray[np.int32],
    queues: NDArray[np.int32],
    entries: NDArray[np.int32],
    queued: NDArray[np.int32],
    n_entries: int,
    length_price: float,
    touching: NDArray[np.float64],
    found: NDArray[np.int32],
) -> None: ...
