import numpy as np
from numpy.typing import NDArray

from .edge_weight import Cells, Disc, Strip

N_LEVELS: int
N_TEXTONS: int
REACH: int
HIDDEN: int

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
    edge_weight: float,
    power: float,
    connected: bool,
    backward: bool,
) -> int: ...
def orient(
    places: NDArray[np.int32],
    starts: NDArray[np.int32],
    first: int,
    last: int,
    radius: float,
    n_angles: int,
    angles: NDArray[np.int32],
) -> None: ...
def half_disc_distances(
    bins: NDArray[np.uint8],
    places: NDArray[np.int32],
    turns: NDArray[np.int32],
    steps: NDArray[np.int32],
    counts: NDArray[np.int32],
    taps: NDArray[np.float32],
    first: int,
    last: int,
    distances: NDArray[np.float32],
) -> None: ...
def label_pixels(leaves: NDArray[np.int32], labels: NDArray[np.int32]) -> NDArray[np.int32]: ...
