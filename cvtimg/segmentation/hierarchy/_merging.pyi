import numpy as np
from numpy.typing import NDArray

def merge(
    ends: NDArray[np.int32],
    lengths: NDArray[np.float64],
    strengths: NDArray[np.float64],
    sizes: NDArray[np.float64],
    perimeters: NDArray[np.float64],
    histograms: NDArray[np.float64],
    blocks: NDArray[np.int32],
    color: float,
    texture: float,
    shared: float,
    size_power: float,
    heads: NDArray[np.int32],
    following: NDArray[np.int32],
    heap: NDArray[np.int32],
    places: NDArray[np.int32],
    costs: NDArray[np.float64],
    joined: NDArray[np.int32],
    numbers: NDArray[np.int32],
    degrees: NDArray[np.int32],
    marks: NDArray[np.int32],
    merges: NDArray[np.int32],
    altitudes: NDArray[np.float64],
) -> int: ...
def label_pixels(leaves: NDArray[np.int32], labels: NDArray[np.int32], pixels: NDArray[np.int32]) -> None: ...
