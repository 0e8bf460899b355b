import numpy as np
from numpy.typing import NDArray

def follow_rings(
    corners: NDArray[np.uint8],
    width: int,
    steps_left: NDArray[np.uint8],
    path: NDArray[np.int64],
    starts: NDArray[np.int64],
) -> int: ...
def absorb(
    ends: NDArray[np.int32],
    lengths: NDArray[np.float64],
    sizes: NDArray[np.int64],
    means: NDArray[np.float64],
    min_size: int,
    length_price: float,
) -> NDArray[np.int32]: ...
def merge(
    ends: NDArray[np.int32],
    lengths: NDArray[np.float64],
    steps: NDArray[np.float64],
    sizes: NDArray[np.float64],
    sums: NDArray[np.float64],
    limit: float,
    blocks: NDArray[np.int32] | None = None,
    color: float = 0,
    texture: float = 0,
    shared: float = 0,
    size_power: float = 0,
) -> tuple[NDArray[np.int32], NDArray[np.float64]]: ...
