import numpy as np
from numpy.typing import NDArray

def join(pairs: NDArray[np.int32], links: NDArray[np.int32], parents: NDArray[np.int32]) -> int: ...
def walk(links: NDArray[np.int32], start: int, tour: NDArray[np.int32]) -> None: ...
def improve(
    points: NDArray[np.float64],
    near: NDArray[np.int32],
    tour: NDArray[np.int32],
    places: NDArray[np.int32],
    settled: NDArray[np.uint8],
    reach: int,
) -> int: ...
