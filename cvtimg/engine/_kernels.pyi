from typing import Any

import numpy as np
from numpy.typing import NDArray

SIMD_LEVELS: tuple[str, ...]
TILE: int
MAX_GROUPED_DIMS: int
simd: str

def pack_tiles(
    rows: NDArray[Any], center: NDArray[np.float64], scale: float, first: int, tiles: NDArray[np.float32]
) -> None: ...
def assign(
    tiles: NDArray[np.float32],
    generators: NDArray[np.float32],
    half_norms: NDArray[np.float32],
    labels: NDArray[np.int32],
) -> None: ...
def assign_grouped(
    tiles: NDArray[np.float32],
    boxes: NDArray[np.float32],
    columns: NDArray[np.float32],
    generators: NDArray[np.float32],
    half_norms: NDArray[np.float32],
    labels: NDArray[np.int32],
) -> None: ...
def assign_two(
    tiles: NDArray[np.float32],
    generators: NDArray[np.float32],
    half_norms: NDArray[np.float32],
    labels: NDArray[np.int32],
    seconds: NDArray[np.int32],
    gaps: NDArray[np.float32],
) -> None: ...
def accumulate(
    tiles: NDArray[np.float32],
    density: NDArray[np.float64],
    labels: NDArray[np.int32],
    sums: NDArray[np.float64],
) -> None: ...
def move_often(
    tiles: NDArray[np.float32],
    density: NDArray[np.float64],
    generators: NDArray[np.float64],
    sums: NDArray[np.float64],
    single: NDArray[np.float32],
    half_norms: NDArray[np.float32],
    labels: NDArray[np.int32],
    energies: NDArray[np.float64],
) -> None: ...
def measure(
    tiles: NDArray[np.float32],
    density: NDArray[np.float64],
    generators: NDArray[np.float64],
    labels: NDArray[np.int32],
    energies: NDArray[np.float64],
) -> None: ...
def transfer(
    tiles: NDArray[np.float32],
    density: NDArray[np.float64],
    labels: NDArray[np.int32],
    masses: NDArray[np.float64],
    means: NDArray[np.float64],
    energies: NDArray[np.float64],
    squares: NDArray[np.float64],
    n_locked: int,
    power: float,
    total: float,
) -> int: ...
def squared_distances(
    tiles: NDArray[np.float32],
    generator: NDArray[np.float32],
    bound: NDArray[np.float32],
    distances: NDArray[np.float32],
) -> None: ...
def divide_cells(
    tiles: NDArray[np.float32],
    density: NDArray[np.float64],
    labels: NDArray[np.int32],
    children: NDArray[np.int32],
    axes: NDArray[np.float64],
    offsets: NDArray[np.float64],
    counts: NDArray[np.int64],
    moments: NDArray[np.float64],
) -> None: ...
def draw_means(
    tiles: NDArray[np.float32],
    drawn: NDArray[np.int64],
    weights: NDArray[np.float64],
    means: NDArray[np.float64],
    counts: NDArray[np.float64],
    squares: NDArray[np.float64],
    n_locked: int,
) -> None: ...
def cut_levels(
    moments: NDArray[np.float64],
    price: float,
    costs: NDArray[np.float64],
    firsts: NDArray[np.int32],
    queue: NDArray[np.int32],
    since: NDArray[np.int32],
    bounds: NDArray[np.int32],
) -> int: ...
