import numpy as np
from numpy.typing import NDArray

LONGEST: int
FARTHEST: int

def xyb(linear: NDArray[np.float32]) -> NDArray[np.float32]: ...
def blur(plane: NDArray[np.float32], weights: NDArray[np.float32]) -> NDArray[np.float32]: ...
def errors(
    a: NDArray[np.float32],
    b: NDArray[np.float32],
    mean_a: NDArray[np.float32],
    mean_b: NDArray[np.float32],
    square_a: NDArray[np.float32],
    square_b: NDArray[np.float32],
    product: NDArray[np.float32],
) -> NDArray[np.float64]: ...
def map_band(
    targets: NDArray[np.float32],
    visibility: NDArray[np.float32],
    entries: NDArray[np.float32],
    lengths: NDArray[np.float32],
    distances: NDArray[np.float32],
    per_byte: int,
    price: float,
    literal: float,
    strength: float,
    longest: float,
    indices: NDArray[np.uint8],
) -> None: ...
