import numpy as np
from numpy.typing import NDArray

def find_twins(triangles: NDArray[np.int32], n_points: int) -> NDArray[np.int32]: ...
