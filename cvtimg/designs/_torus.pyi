import numpy as np
from numpy.typing import NDArray

def assign_on_torus(
    samples: NDArray[np.float32],
    generators: NDArray[np.float32],
    squares: NDArray[np.float32],
    labels: NDArray[np.int32],
) -> None: ...
