import numpy as np
from numpy.typing import NDArray

N_LEVELS: int
N_TEXTONS: int
REACH: int
HIDDEN: int

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
