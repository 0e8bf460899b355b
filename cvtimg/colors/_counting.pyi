from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Ints: TypeAlias = NDArray[np.int32]
UInts: TypeAlias = NDArray[np.uint32]
Shorts: TypeAlias = NDArray[np.uint16]
Bytes: TypeAlias = NDArray[np.uint8]

PAGE_SIZE: int

def count_keys(pixels: Bytes, key_bits: UInts, pages: Shorts, counts: UInts, used: int) -> int: ...
def number_keys(pages: Shorts, counts: UInts, keys: UInts, density: NDArray[np.float64]) -> int: ...
def look_up_keys(pixels: Bytes, key_bits: UInts, pages: Shorts, ranks: UInts, inverse: Ints) -> None: ...
def count_rows(
    rows: Bytes,
    start: int,
    slots: Ints,
    firsts: NDArray[np.int64],
    counts: NDArray[np.float64],
    ranks: Ints,
    found: int,
) -> tuple[int, int]: ...
def rehash(rows: Bytes, firsts: NDArray[np.int64], slots: Ints) -> None: ...
