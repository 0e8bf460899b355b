from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float32]
Ints: TypeAlias = NDArray[np.int32]
Shorts: TypeAlias = NDArray[np.uint16]
Bytes: TypeAlias = NDArray[np.uint8]

DIMS: int

def list_candidates(
    palette: Floats,
    names: Shorts,
    low: Floats,
    sides: Floats,
    outside: Floats,
    n_blocks: Ints,
    n_in_block: Ints,
    in_block: Shorts,
    in_cell: Shorts,
    bounds: Ints,
    candidates: Shorts,
    first: int,
) -> int: ...
def diffuse(
    places: Floats,
    kinds: Bytes,
    inverse: Ints,
    palette: Floats,
    low: Floats,
    cells_a_unit: Floats,
    strides: Ints,
    last: Ints,
    bounds: Ints,
    candidates: Shorts,
    strengths: Floats,
    most: float,
    clean: Bytes,
    rows: Floats,
    row_kinds: Bytes,
    labels: Ints,
) -> None: ...
def mix(
    places: Floats,
    kinds: Bytes,
    palette: Floats,
    low: Floats,
    cells_a_unit: Floats,
    strides: Ints,
    last: Ints,
    bounds: Ints,
    candidates: Shorts,
    strengths: Floats,
    most: float,
    ranks: Shorts,
    mixtures: Shorts,
) -> None: ...
def arrange(mixtures: Shorts, inverse: Ints, mask: Bytes, first: int, labels: Ints) -> None: ...
def measure(places: Floats, palette: Floats, inverse: Ints, labels: Ints, energies: NDArray[np.float64]) -> None: ...
