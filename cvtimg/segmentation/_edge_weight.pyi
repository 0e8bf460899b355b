import numpy as np
from numpy.typing import NDArray

from .edge_weight import Cells, Disc, Strip

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
    strip: Strip,
    cells: Cells,
    disc: Disc,
    counts: NDArray[np.int32],
    found: NDArray[np.int32],
    edge_weight: float,
    power: float,
    connected: bool,
    backward: bool,
) -> int: ...
