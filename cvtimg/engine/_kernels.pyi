from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Doubles: TypeAlias = NDArray[np.float64]
Floats: TypeAlias = NDArray[np.float32]
Ints: TypeAlias = NDArray[np.int32]

SIMD_LEVELS: tuple[str, ...]
TILE: int
MAX_GROUPED_DIMS: int
simd: str

def pack_tiles(rows: NDArray[Any], center: Doubles, scale: float, first: int, tiles: Floats) -> None: ...
def assign(tiles: Floats, generators: Floats, half_norms: Floats, labels: Ints) -> None: ...
def assign_grouped(
    tiles: Floats, boxes: Floats, columns: Floats, generators: Floats, half_norms: Floats, labels: Ints
) -> None: ...
def assign_two(
    tiles: Floats, generators: Floats, half_norms: Floats, labels: Ints, seconds: Ints, gaps: Floats
) -> None: ...
def accumulate(tiles: Floats, density: Doubles, labels: Ints, sums: Doubles) -> None: ...
def move_often(
    tiles: Floats,
    density: Doubles,
    generators: Doubles,
    sums: Doubles,
    single: Floats,
    half_norms: Floats,
    labels: Ints,
    energies: Doubles,
) -> None: ...
def measure(tiles: Floats, density: Doubles, generators: Doubles, labels: Ints, energies: Doubles) -> None: ...
def transfer(
    tiles: Floats,
    density: Doubles,
    labels: Ints,
    masses: Doubles,
    means: Doubles,
    energies: Doubles,
    squares: Doubles,
    n_locked: int,
    power: float,
    total: float,
) -> int: ...
def squared_distances(tiles: Floats, generator: Floats, bound: Floats, distances: Floats) -> None: ...
def divide_cells(
    tiles: Floats,
    density: Doubles,
    labels: Ints,
    children: Ints,
    axes: Doubles,
    offsets: Doubles,
    counts: NDArray[np.int64],
    moments: Doubles,
) -> None: ...
def draw_means(
    tiles: Floats,
    drawn: NDArray[np.int64],
    weights: Doubles,
    means: Doubles,
    counts: Doubles,
    squares: Doubles,
    n_locked: int,
) -> None: ...
def cut_levels(
    moments: Doubles, price: float, costs: Doubles, firsts: Ints, queue: Ints, since: Ints, bounds: Ints
) -> int: ...
