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
) -> NDArray[np.bool_]: ...
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
) -> _Ints: ...
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
    most_lines: int,
) -> _Floats: ...
def shrink_over_samples(
    turns: _Ints,
    part: float,
    floors: _Floats,
    starts: _Ints,
    samples: _Ints,
    distances: _Floats,
    order: int,
    taken: _Ints,
    radii: _Floats,
    depths: _Ints,
) -> None: ...

class DiskCover:
    def __init__(
        self,
        points: _Floats,
        pair_starts: _Ints,
        pairs: _Ints,
        gaps: _Floats,
        barriers: _Floats,
        n_boundary: int,
        near_starts: _Ints,
        near: _Ints,
        limits: _Floats,
        order: int,
        blocking: bool,
        tolerance: float,
        aside: float,
        radii: _Floats,
    ) -> None: ...
    def shrink(self, turns: _Ints, part: float, beyond: float, floors: _Floats) -> None: ...
    def exchange(
        self, turns: _Ints, n_trials: int, most_helpers: int, scale: float, beyond: float, floors: _Floats
    ) -> int: ...
