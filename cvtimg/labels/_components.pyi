import numpy as np
from numpy.typing import NDArray

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
