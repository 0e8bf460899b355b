import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int32]

def see(
    points: _Floats,
    own: _Ints,
    places: _Floats,
    barriers: _Floats,
    starts: _Ints,
    near: _Ints,
    tolerance: float,
    slack: float,
    seen: NDArray[np.uint8],
) -> None: ...
def count_depths(
    places: _Floats,
    owners: _Ints,
    without: _Ints,
    points: _Floats,
    radii: _Floats,
    row_starts: _Ints,
    meets: _Ints,
    barriers: _Floats,
    starts: _Ints,
    near: _Ints,
    tolerance: float,
    slack: float,
    enough: int,
    depths: _Ints,
) -> None: ...
def find_reaches(
    points: _Floats,
    who: _Ints,
    order: int,
    windows: _Floats,
    bounds: _Floats,
    other_starts: _Ints,
    others: _Ints,
    barriers: _Floats,
    n_boundary: int,
    near_starts: _Ints,
    near: _Ints,
    tips: _Floats,
    tip_starts: _Ints,
    near_tips: _Ints,
    blocking: bool,
    tolerance: float,
    slack: float,
    lines: _Floats,
    reaches: _Floats,
) -> None: ...
