import numpy as np
from numpy.typing import NDArray

def follow_rings(
    corners: NDArray[np.uint8],
    width: int,
    steps_left: NDArray[np.uint8],
    path: NDArray[np.int64],
    starts: NDArray[np.int64],
) -> int: ...
