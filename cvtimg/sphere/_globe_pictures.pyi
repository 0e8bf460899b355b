import numpy as np
from numpy.typing import NDArray

def limit_growth(sizes: NDArray[np.float64], growth: float) -> None: ...
