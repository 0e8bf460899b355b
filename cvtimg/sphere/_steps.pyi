import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]

def split_moments(
    points: _Floats, start: int, stop: int, moments: _Floats, lengths: _Floats, along: _Floats
) -> None: ...
def learn(
    points: _Floats,
    before: _Floats,
    pulls: _Floats,
    stretches: _Floats,
    slot: int,
    n_steps: int,
    start: int,
    stop: int,
    rows: _Floats,
) -> None: ...
def sum_products(rows: _Floats, new: NDArray[np.intp], block: int, start: int, stop: int, sums: _Floats) -> None: ...
def move_points(
    points: _Floats,
    rows: _Floats,
    coefficients: _Floats,
    stretches: _Floats,
    areas: _Floats,
    longest: float,
    part: float,
    start: int,
    stop: int,
    there: _Floats,
) -> None: ...
