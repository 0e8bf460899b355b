"""Arrays on disk, with some rows in memory at a time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

__all__ = ["DiskRows"]


class DiskRows:
    """An array of zeros in a file of its own.

    It is not mapped into memory, because a full disk must be an error, not a signal that ends the program.
    """

    def __init__(self, path: Path, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        self.shape, self.dtype = shape, np.dtype(dtype)
        self._n_bytes = int(np.prod(shape[1:], dtype=np.int64)) * self.dtype.itemsize
        self._file = path.open("w+b", buffering=0)
        self._file.truncate(shape[0] * self._n_bytes)

    def read(self, first: int, last: int) -> NDArray[Any]:
        """Return a copy of some rows."""
        rows = np.empty((last - first, *self.shape[1:]), self.dtype)
        left = rows.reshape(-1).view(np.uint8).data
        self._file.seek(first * self._n_bytes)
        while left:
            n_read = self._file.readinto(left)
            if not n_read:
                raise OSError("a file of unfinished work was cut short")
            left = left[n_read:]
        return rows

    def write(self, first: int, rows: NDArray[Any]) -> None:
        """Replace rows from `first` on."""
        left = np.ascontiguousarray(rows, self.dtype).reshape(-1).view(np.uint8).data
        self._file.seek(first * self._n_bytes)
        while left:
            left = left[self._file.write(left) :]

    def close(self) -> None:
        """Close the file."""
        self._file.close()
