import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int32]

class Buckets:
    n_generators: int
    side: int
    rows: int
    def __init__(self, points: _Floats, weights: _Floats | None, height: int, width: int, side: int) -> None: ...
    def sum_cells(
        self, density: NDArray[np.float32], bands: _Ints, start: int, stop: int, sums: _Floats, touched: _Ints
    ) -> None: ...
    def add_parts(self, sums: _Floats, touched: _Ints) -> _Floats: ...
    def label_pixels(self, labels: _Ints, start: int, stop: int) -> None: ...

def place_along_curve(weights: NDArray[np.float32], each: float, places: _Floats) -> int: ...
