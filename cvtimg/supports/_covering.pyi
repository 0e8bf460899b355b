import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int32]

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
def shrink(
    turns: _Ints,
    part: float,
    beyond: float,
    floors: _Floats,
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
    meeting: _Ints,
    radii: _Floats,
) -> None: ...
def exchange(
    turns: _Ints,
    n_trials: int,
    most_helpers: int,
    scale: float,
    beyond: float,
    floors: _Floats,
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
    meeting: _Ints,
    radii: _Floats,
    changed: _Ints,
    before: _Floats,
) -> int: ...
