"""Dithering: the colors of a palette mixed from pixel to pixel, so that areas have the color of the original."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg import _dither
from cvtimg._checks import check_choice

#: Cells for each entry of the palette: with fewer a cell has more candidates, with more listing them takes longer.
_CELLS_AN_ENTRY = 64
_MOST_CELLS = 1 << 18
#: Cells on a side of a block, whose candidates are found together.
_BLOCK = 4


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """A box around all places in cells, each with the entries of the palette that are nearest to some place in it.

    Attributes
    ----------
    palette : (K, 4) float32 array
        Places of the entries.
    box : (2, 4) float32 array
        Lowest and highest place.
    cells_a_unit : (4,) float32 array
    strides : (4,) int32 array
        From a cell to the next in each direction.
    bounds : (n_kinds, n_cells, 2) int32 array
        First and last + 1 of a cell's candidates, for each kind of color.
    candidates : (n,) uint16 array
    """

    palette: NDArray[np.float32]
    box: NDArray[np.float32]
    cells_a_unit: NDArray[np.float32]
    strides: NDArray[np.int32]
    bounds: NDArray[np.int32]
    candidates: NDArray[np.uint16]


def dither(
    places: NDArray[Any],
    inverse: NDArray[np.int32],
    palette: NDArray[Any],
    *,
    method: str = "floyd-steinberg",
    strength: float = 1.0,
    kinds: ArrayLike | None = None,
    allowed: ArrayLike | None = None,
) -> NDArray[np.int32]:
    """Choose entries of a palette for the pixels of a picture, so that their mean over an area is that of the picture.

    Parameters
    ----------
    places : (M, D) array
        Place of each distinct color of the picture in the space where distances are measured, D in 1..4.
    inverse : (H, W) int32 array
        For each pixel the index of its color, as in `ColorSamples`.
    palette : (K, D) array
        Place of each entry of the palette, K in 1..65536.
    method : {"floyd-steinberg", "blue-noise"}
        One of `DITHERS`.
    strength : float
        In 0..1: 0 gives each pixel its nearest entry, 1 keeps the mean.
    kinds : (M,) array of int, optional
        Kind of each color, where not every color may take every entry.
    allowed : (n_kinds, K) array of bool, optional
        Which entries a color of each kind may take, one at least. Colors with one entry to take hand on no error.

    Returns
    -------
    (H, W) int32 array
        For each pixel the index of its entry.
    """
    chosen = DITHERS[check_choice("method", method, DITHERS)]
    kinds = np.zeros(len(places), np.uint8) if kinds is None else np.asarray(kinds, np.uint8)
    allowed = np.ones((1, len(palette)), bool) if allowed is None else np.asarray(allowed, bool)
    wide = _widened(places)
    return chosen(wide, kinds, inverse, _grid(wide, _widened(palette), allowed), strength)


def _floyd_steinberg(
    places: NDArray[np.float32], kinds: NDArray[np.uint8], inverse: NDArray[np.int32], grid: Grid, strength: float
) -> NDArray[np.int32]:
    labels = np.empty(inverse.shape, np.int32)
    errors = np.zeros((2, inverse.shape[1] + 2, _dither.DIMS), np.float32)
    _dither.diffuse(
        places,
        kinds,
        inverse,
        grid.palette,
        grid.box,
        grid.cells_a_unit,
        grid.strides,
        grid.bounds,
        grid.candidates,
        strength,
        errors,
        labels,
    )
    return labels


#: The registry: names for `dither` and ``--dither``.
DITHERS: dict[str, Callable[..., NDArray[np.int32]]] = {"floyd-steinberg": _floyd_steinberg}


def _widened(places: NDArray[Any]) -> NDArray[np.float32]:
    """Fill up to four coordinates with 0."""
    wide = np.zeros((len(places), _dither.DIMS), np.float32)
    wide[:, : places.shape[1]] = places
    return wide


def _grid(places: NDArray[np.float32], palette: NDArray[np.float32], allowed: NDArray[np.bool_]) -> Grid:
    """Put cells around all places, and list the candidates of each: again where there was too little room for them."""
    box = np.stack([np.minimum(places.min(0), palette.min(0)), np.maximum(places.max(0), palette.max(0))])
    size = box[1] - box[0]
    varies = size > 0
    n_blocks = np.where(varies, _blocks_on_a_side(len(palette), int(varies.sum())), 1).astype(np.int32)
    n_in_block = np.where(varies, _BLOCK, 1).astype(np.int32)
    n_cells = n_blocks * n_in_block
    low, sides = box[0], (size / n_cells).astype(np.float32)
    # The highest place belongs to the last cell.
    cells_a_unit = np.divide(n_cells * np.float32(1 - 1e-6), size, out=np.zeros_like(size), where=varies)
    strides = np.append(np.cumprod(n_cells[:0:-1])[::-1], 1).astype(np.int32)
    bounds = np.empty((len(allowed), int(n_cells.prod()), 2), np.int32)
    in_block, in_cell = np.empty((2, len(palette)), np.uint16)
    entries = [np.flatnonzero(may_take).astype(np.uint16) for may_take in allowed]
    n_candidates = 4 * bounds.size
    while True:
        candidates, end = np.empty(n_candidates, np.uint16), 0
        for names, of_kind in zip(entries, bounds, strict=True):
            end = _dither.list_candidates(
                palette, names, low, sides, n_blocks, n_in_block, in_block, in_cell, of_kind, candidates, end
            )  # fmt: skip
        if end <= n_candidates:
            return Grid(palette, box, cells_a_unit, strides, bounds, candidates)
        n_candidates = end


def _blocks_on_a_side(n_entries: int, n_dims: int) -> int:
    n_cells = min(_CELLS_AN_ENTRY * n_entries, _MOST_CELLS)
    return max(int(n_cells ** (1 / max(n_dims, 1))) // _BLOCK, 1)
