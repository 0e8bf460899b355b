"""Counts of small pixels, in a table with an entry for each value that a pixel can have."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.colors import _counting

#: Pixels of up to this many bytes are counted in a table.
TABLE_BYTES = 3


class CountTable:
    """Counts of pixels of up to three bytes: 2^24 counts, 64 MiB, in pages that take memory from their first use."""

    def __init__(self, n_bytes: int) -> None:
        n_pages = max(1, (1 << 8 * n_bytes) // _counting.PAGE_SIZE)
        self._key_bits = _interleave(n_bytes)
        self._pages = np.zeros(n_pages, np.uint16)
        self._counts = np.zeros((n_pages + 1, _counting.PAGE_SIZE), np.uint32)
        self._n_used = self._n_pixels = 0

    def has_room(self, n_more: int) -> bool:
        """Whether this many more pixels overflow no count."""
        return self._n_pixels + n_more < 1 << 32

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Count (N, B) pixels."""
        self._n_used = _counting.count_keys(pixels.reshape(-1), self._key_bits, self._pages, self._counts, self._n_used)
        self._n_pixels += len(pixels)

    def close(self) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
        """Return the (M, B) distinct pixels and their (M,) counts; from then on the table only looks up pixels."""
        n_most = min(self._n_pixels, self._n_used * _counting.PAGE_SIZE)
        keys, density = np.empty(n_most, np.uint32), np.empty(n_most)
        n_distinct = _counting.number_keys(self._pages, self._counts, keys, density)
        return _pixels_of(keys[:n_distinct], len(self._key_bits)), density[:n_distinct].copy()

    def look_up(self, pixels: NDArray[np.uint8]) -> NDArray[np.int32]:
        """Return the (N,) index of each of (N, B) pixels among the distinct ones."""
        n_pixels, n_bytes = pixels.shape
        flat, inverse = pixels.reshape(-1), np.empty(n_pixels, np.int32)

        def look_up(start: int, stop: int) -> None:
            part = flat[start * n_bytes : stop * n_bytes]
            _counting.look_up_keys(part, self._key_bits, self._pages, self._counts, inverse[start:stop])

        in_parts(look_up, n_pixels, work=n_pixels)
        return inverse


def _interleave(n_bytes: int) -> NDArray[np.uint32]:
    """Return the (B, 256) bits of the key that each byte sets; bits of equal rank are neighbors, as are near colors."""
    values = np.arange(256, dtype=np.uint32)
    key_bits = np.zeros((n_bytes, 256), np.uint32)
    for byte in range(n_bytes):
        for bit in range(8):
            key_bits[byte] |= (values >> bit & 1) << (n_bytes * bit + n_bytes - 1 - byte)
    return key_bits


def _pixels_of(keys: NDArray[np.uint32], n_bytes: int) -> NDArray[np.uint8]:
    """Return the (M, B) bytes of keys, by tables for their lower and upper 12 bits."""
    half = np.arange(1 << 12, dtype=np.uint32)
    lower, upper = _deinterleave(half, n_bytes), _deinterleave(half << np.uint32(12), n_bytes)
    return lower[keys & 0xFFF] | upper[keys >> 12]


def _deinterleave(keys: NDArray[np.uint32], n_bytes: int) -> NDArray[np.uint8]:
    """Return the (M, B) bytes of keys: the inverse of `_interleave`."""
    pixels = np.zeros((len(keys), n_bytes), np.uint8)
    for byte in range(n_bytes):
        for bit in range(8):
            pixels[:, byte] |= (keys >> (n_bytes * bit + n_bytes - 1 - byte) & 1).astype(np.uint8) << bit
    return pixels
