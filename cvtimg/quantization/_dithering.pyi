import numpy as np
from numpy.typing import NDArray

DIMS: int

def list_candidates(
    palette: NDArray[np.float32],
    names: NDArray[np.uint16],
    low: NDArray[np.float32],
    sides: NDArray[np.float32],
    outside: NDArray[np.float32],
    n_blocks: NDArray[np.int32],
    n_in_block: NDArray[np.int32],
    in_block: NDArray[np.uint16],
    in_cell: NDArray[np.uint16],
    bounds: NDArray[np.int32],
    candidates: NDArray[np.uint16],
    first: int,
) -> int: ...
def diffuse(
    places: NDArray[np.float32],
    kinds: NDArray[np.uint8],
    inverse: NDArray[np.int32],
    palette: NDArray[np.float32],
    low: NDArray[np.float32],
    cells_a_unit: NDArray[np.float32],
    strides: NDArray[np.int32],
    last: NDArray[np.int32],
    bounds: NDArray[np.int32],
    candidates: NDArray[np.uint16],
    strengths: NDArray[np.float32],
    most: float,
    clean: NDArray[np.uint8],
    rows: NDArray[np.float32],
    row_kinds: NDArray[np.uint8],
    labels: NDArray[np.int32],
) -> None: ...
def mix(
    places: NDArray[np.float32],
    kinds: NDArray[np.uint8],
    palette: NDArray[np.float32],
    low: NDArray[np.float32],
    cells_a_unit: NDArray[np.float32],
    strides: NDArray[np.int32],
    last: NDArray[np.int32],
    bounds: NDArray[np.int32],
    candidates: NDArray[np.uint16],
    strengths: NDArray[np.float32],
    most: float,
    ranks: NDArray[np.uint16],
    mixtures: NDArray[np.uint16],
) -> None: ...
def arrange(
    mixtures: NDArray[np.uint16],
    inverse: NDArray[np.int32],
    mask: NDArray[np.uint8],
    first: int,
    labels: NDArray[np.int32],
) -> None: ...
def measure(
    places: NDArray[np.float32],
    palette: NDArray[np.float32],
    inverse: NDArray[np.int32],
    labels: NDArray[np.int32],
    energies: NDArray[np.float64],
) -> None: ...
