import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float32]
_Doubles = NDArray[np.float64]

def halve_groups(
    features: _Floats,
    order: NDArray[np.int32],
    starts: NDArray[np.int64],
    stops: NDArray[np.int64],
    cuts: NDArray[np.int64],
    first: int,
    last: int,
) -> None: ...
def measure_groups(
    image: _Floats,
    order: NDArray[np.int32],
    bounds: NDArray[np.int64],
    means: _Floats,
    covariances: _Doubles,
    first: int,
    last: int,
) -> None: ...
def make_filters(covariances: _Doubles, variances: _Doubles, filters: _Floats, first: int, last: int) -> None: ...
def filter_groups(
    image: _Floats,
    change: _Floats,
    steps: _Doubles,
    order: NDArray[np.int32],
    bounds: NDArray[np.int64],
    means: _Floats,
    filters: _Floats,
    patches: _Floats,
    first: int,
    last: int,
) -> None: ...
def join_patches(
    patches: _Floats,
    group_of: NDArray[np.int32],
    trust: _Floats,
    sums: _Floats,
    weights: _Floats,
    first: int,
    last: int,
) -> None: ...
