import numpy as np
from numpy.typing import NDArray

def swap_coordinates(
    places: NDArray[np.float64], order: NDArray[np.int32], tries: NDArray[np.int32], least: float, periodic: bool
) -> int: ...
