"""Images that are read and written a band of rows at a time, and the height of a band."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["BAND_PIXELS", "SAMPLES", "Band", "Bands", "Form", "band_height", "in_heights"]

#: Approximate number of pixels in a band; a few bands are in memory at a time.
BAND_PIXELS = 1 << 23
#: Sample types that can be read in bands.
SAMPLES = (*(f"{kind}{bits}" for bits in (8, 16, 32, 64) for kind in ("uint", "int")), "float32", "float64")

Band: TypeAlias = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """Shape, sample type and metadata of an image file.

    Attributes
    ----------
    shape : tuple of int
        (H, W) or (H, W, C).
    dtype : numpy.dtype
        Any integer type, float32 or float64.
    alpha : bool
        Whether the last of several bands is transparency.
    icc : bytes or None
        Color profile; colors are not converted, and are written with the same profile.
    geo : mapping of int
        Georeferencing tags of a GeoTIFF, as in `Metadata`.
    nodata : float or None
        Value that marks missing pixels in a GeoTIFF.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    alpha: bool = False
    icc: bytes | None = None
    geo: Mapping[int, Any] = field(default_factory=dict)
    nodata: float | None = None

    @property
    def n_pixels(self) -> int:
        """Number of pixels."""
        return self.shape[0] * self.shape[1]


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """An image on disk; each iteration reads it from top to bottom, one band of rows at a time."""

    form: Form
    read: Callable[[], Iterator[Band]]

    def __iter__(self) -> Iterator[Band]:
        return self.read()


def band_height(width: int, piece: int) -> int:
    """Return the number of rows of a band: a multiple of the tile height, for about `BAND_PIXELS` pixels."""
    return max(1, BAND_PIXELS // (width * piece)) * piece


def in_heights(bands: Iterable[Band], height: int) -> Iterator[Band]:
    """Regroup rows into bands of the given height; the last may be shorter."""
    left: list[Band] = []
    for band in bands:
        rows = np.concatenate([*left, band]) if left else band
        n_whole = len(rows) // height * height
        yield from (rows[top : top + height] for top in range(0, n_whole, height))
        left = [rows[n_whole:]] if n_whole < len(rows) else []
    yield from left
