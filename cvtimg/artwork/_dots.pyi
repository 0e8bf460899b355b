import numpy as np
from numpy.typing import NDArray

def cover_rows(
    centers: NDArray[np.float64],
    radii: NDArray[np.float64],
    starts: NDArray[np.int64],
    disks: NDArray[np.int32],
    first_row: int,
    stop_row: int,
    raster: NDArray[np.uint8],
    coverage: NDArray[np.float32],
) -> None: ...
