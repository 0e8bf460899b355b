import numpy as np
from numpy.typing import NDArray

PAGE_SIZE: int

def count_keys(
    pixels: NDArray[np.uint8],
    key_bits: NDArray[np.uint32],
    pages: NDArray[np.uint16],
    counts: NDArray[np.uint32],
    used: int,
) -> int: ...
def number_keys(
    pages: NDArray[np.uint16],
    counts: NDArray[np.uint32],
    keys: NDArray[np.uint32],
    density: NDArray[np.float64],
) -> int: ...
def look_up_keys(
    pixels: NDArray[np.uint8],
    key_bits: NDArray[np.uint32],
    pages: NDArray[np.uint16],
    ranks: NDArray[np.uint32],
    inverse: NDArray[np.int32],
) -> None: ...
def count_rows(
    rows: NDArray[np.uint8],
    start: int,
    slots: NDArray[np.int32],
    firsts: NDArray[np.int64],
    counts: NDArray[np.float64],
    ranks: NDArray[np.int32],
    found: int,
) -> tuple[int, int]: ...
def rehash(rows: NDArray[np.uint8], firsts: NDArray[np.int64], slots: NDArray[np.int32]) -> None: ...
