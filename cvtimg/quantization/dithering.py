"""Dithering: the colors of a palette mixed from pixel to pixel, so that areas have the color of the original.

Both methods look for exact nearest colors at places that the pixels of the picture are not at. A grid over the space
lists for each of its cells the entries that are nearest to some place in it, so that a search is over very few.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_in_unit_range
from cvtimg._shared.threads import in_parts
from cvtimg.quantization import _dithering

#: The part of the error that is handed on by default: nearly all, since the last of it costs most of the grain.
STRENGTH = 0.9
#: Of large palettes some entries tell how far from each other they are: so many comparisons.
_COMPARISONS = 1 << 22
#: Most coordinates of a place.
MAX_DIMS = _dithering.DIMS
#: Cells for each entry of the palette: with fewer a cell has more candidates, with more listing them takes longer.
_CELLS_AN_ENTRY = 64
_MOST_CELLS = 1 << 18
#: Cells on a side of a block, whose candidates are found together.
_BLOCK = 4
#: Entries that blue noise mixes for a color.
_N_MIXED = 16


class Grid(NamedTuple):
    """A box around all places, cut into cells that know their candidates, in the order that the kernels take.

    Attributes
    ----------
    palette : (K, 4) float32 array
        Places of the entries.
    low : (4,) float32 array
        Its lowest corner.
    cells_a_unit : (4,) float32 array
    strides : (4,) int32 array
        From a cell to the next in each direction.
    bounds : (n_kinds, n_cells, 2) int32 array
        First and last + 1 of a cell's candidates, for each kind of color.
    candidates : (n,) uint16 array
    """

    palette: NDArray[np.float32]
    low: NDArray[np.float32]
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
    strength: float = STRENGTH,
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
        "floyd-steinberg" hands the error of each pixel to its neighbors, there and back, row after row. "blue-noise"
        lists 16 entries for each color, each the nearest to the color and to what those before it missed, and takes
        one by a mask of void and cluster: coarser, but a pixel depends on its color and its place alone, so that
        what rests from frame to frame stays as it is.
    strength : float
        The part of the error that is handed on, in 0..1. At 0 each pixel gets its nearest entry; at 1 no error is
        lost, at the price of more grain.
    kinds : (M,) array of int, optional
        Kind of each color, where not every color may take every entry.
    allowed : (n_kinds, K) array of bool, optional
        Which entries a color of each kind may take, one at least. A kind with one entry to take hands on no error.

    Returns
    -------
    (H, W) int32 array
        For each pixel the index of its entry. Of entries at the same distance the first is taken.

    References
    ----------
    R. W. Floyd, L. Steinberg, "An adaptive algorithm for spatial grey scale", Proc. Society for Information Display
    17 (1976) 75-77. R. Ulichney, "The void-and-cluster method for dither array generation", Proc. SPIE 1913 (1993)
    332-343, doi 10.1117/12.152707.

    Examples
    --------
    >>> import numpy as np
    >>> grey = np.zeros((4, 8), np.int32)
    >>> chosen = dither(np.array([[0.25]]), grey, np.array([[0.0], [1.0]]), strength=1)
    >>> float(chosen.mean())
    0.25
    """
    chosen = DITHERS[check_choice("method", method, DITHERS)]
    strength = check_in_unit_range("strength", strength)
    kinds = np.zeros(len(places), np.uint8) if kinds is None else np.asarray(kinds, np.uint8)
    allowed = np.ones((1, len(palette)), bool) if allowed is None else np.asarray(allowed, bool)
    strengths = np.where(allowed.sum(axis=1) > 1, strength, 0).astype(np.float32)
    (wide, entries), _ = _inward(places, palette)
    most = _usual_step(entries)
    return chosen(wide, kinds, inverse, _grid(wide, entries, allowed, most), strengths, most)


def energy_of(
    places: NDArray[Any], inverse: NDArray[np.int32], palette: NDArray[Any], labels: NDArray[np.int32]
) -> float:
    """Sum over the pixels of the squared distance to their entry; arrays as `dither` takes and returns them."""
    (wide, entries), scale = _inward(places, palette)
    energies = np.empty(len(inverse))

    def measure(start: int, stop: int) -> None:
        _dithering.measure(wide, entries, inverse[start:stop], labels[start:stop], energies[start:stop])

    in_parts(measure, len(inverse), work=4 * inverse.size)
    return float(energies.sum()) / scale**2


def _floyd_steinberg(
    places: NDArray[np.float32],
    kinds: NDArray[np.uint8],
    inverse: NDArray[np.int32],
    grid: Grid,
    strengths: NDArray[np.float32],
    most: float,
) -> NDArray[np.int32]:
    """Hand on what a pixel misses to those that come after it: 7/16 ahead, 3/16, 5/16 and 1/16 to the next row."""
    labels = np.empty(inverse.shape, np.int32)
    width = inverse.shape[1]
    rows, row_kinds = np.zeros((2, width + 2, MAX_DIMS), np.float32), np.empty(width, np.uint8)
    _dithering.diffuse(places, kinds, inverse, *grid, strengths, most, rows, row_kinds, labels)
    return labels


def _blue_noise(
    places: NDArray[np.float32],
    kinds: NDArray[np.uint8],
    inverse: NDArray[np.int32],
    grid: Grid,
    strengths: NDArray[np.float32],
    most: float,
) -> NDArray[np.int32]:
    """Mix entries for each color, and let a mask choose among them: the same choice wherever the color is there."""
    mixtures = _mixtures(places, kinds, grid, strengths, most, _N_MIXED)
    labels, levels = np.empty(inverse.shape, np.int32), _levels()

    def arrange_part(start: int, stop: int) -> None:
        _dithering.arrange(mixtures, inverse[start:stop], levels, start, labels[start:stop])

    in_parts(arrange_part, len(inverse), work=inverse.size)
    return labels


#: The registry: names for `dither` and ``--dither``.
DITHERS: dict[str, Callable[..., NDArray[np.int32]]] = {
    "floyd-steinberg": _floyd_steinberg,
    "blue-noise": _blue_noise,
}


def _mixtures(
    places: NDArray[np.float32],
    kinds: NDArray[np.uint8],
    grid: Grid,
    strengths: NDArray[np.float32],
    most: float,
    n_mixed: int,
) -> NDArray[np.uint16]:
    """(M, n_mixed) entries whose mean is the color, each the nearest to it and to what those before it missed."""
    mixtures = np.empty((len(places), n_mixed), np.uint16)
    ranks = _ranks(grid.palette)

    def mix(start: int, stop: int) -> None:
        _dithering.mix(places[start:stop], kinds[start:stop], *grid, strengths, most, ranks, mixtures[start:stop])

    in_parts(mix, len(places), work=32 * mixtures.size)
    return mixtures


def _usual_step(palette: NDArray[np.float32]) -> float:
    """Root of the mean squared distance from an entry to the nearest other one.

    Longer errors come from colors that no mixture of the palette reaches. They would add up, and end in spots of far
    colors: no more than this is handed on.
    """
    some = np.arange(0, len(palette), max(1, len(palette) ** 2 // _COMPARISONS))
    norms = np.einsum("kd,kd->k", palette, palette, dtype=np.float64)
    squares = norms[some, None] + norms - 2 * (palette[some].astype(np.float64) @ palette.T.astype(np.float64))
    squares[np.arange(len(some)), some] = np.inf
    nearest = squares.min(axis=1)
    return float(np.sqrt(np.maximum(nearest, 0).mean())) if len(palette) > 1 else 0.0


def _ranks(palette: NDArray[np.float32]) -> NDArray[np.uint16]:
    """(K,) where each entry stands along the main axis of the palette, which is mostly that of brightness."""
    steps = palette - palette.mean(axis=0, dtype=np.float64)
    axis = np.linalg.eigh(steps.T @ steps)[1][:, -1]
    ranks = np.empty(len(palette), np.uint16)
    ranks[np.argsort(steps @ axis, kind="stable")] = np.arange(len(palette))
    return ranks


@cache
def _levels() -> NDArray[np.uint8]:
    """(S, S) which entry of a mixture a pixel takes, from the mask that docs/make_blue_noise.py makes."""
    mask = np.load(Path(__file__).parent / "blue_noise.npy")
    levels: NDArray[np.uint8] = (mask.astype(np.int64) * _N_MIXED // mask.size).astype(np.uint8)
    return levels


def _inward(*arrays: NDArray[Any]) -> tuple[list[NDArray[np.float32]], float]:
    """Bring (n, D) places to four coordinates, from 0 up, at a scale whose squares float32 holds; tell the scale."""
    n_dims = arrays[0].shape[1]
    if n_dims > MAX_DIMS:
        raise ValueError(f"places of {n_dims} coordinates cannot be dithered: at most {MAX_DIMS} can")
    low = np.min([array.min(axis=0) for array in arrays], axis=0).astype(np.float64)
    size = float((np.max([array.max(axis=0) for array in arrays], axis=0) - low).max())
    scale = 1.0 if size == 0 or 1e-6 < size < 1e6 else float(2.0 ** -np.round(np.log2(size)))
    inside = [np.zeros((len(array), MAX_DIMS), np.float32) for array in arrays]
    for places, array in zip(inside, arrays, strict=True):
        places[:, :n_dims] = (array - low) * scale
    return inside, scale


def _grid(places: NDArray[np.float32], palette: NDArray[np.float32], allowed: NDArray[np.bool_], most: float) -> Grid:
    """Put cells around all places, and list the candidates of each: again where there was too little room for them."""
    low, high = places.min(axis=0), places.max(axis=0)
    varies = np.minimum(low, palette.min(axis=0)) < np.maximum(high, palette.max(axis=0))
    # What is handed to a pixel, a part by each of its neighbors, is not longer than what one of them hands on at most.
    margin = np.where(varies, np.float32(1.01 * most) + np.float32(1e-5) * high.max(), np.float32(0))
    low, size = low - margin, high - low + 2 * margin
    n_blocks = np.where(varies, _blocks_on_a_side(len(palette), int(varies.sum())), 1).astype(np.int32)
    n_in_block = np.where(varies, _BLOCK, 1).astype(np.int32)
    n_cells = n_blocks * n_in_block
    sides = (size / n_cells).astype(np.float32)
    cells_a_unit = np.divide(n_cells.astype(np.float32), size, out=np.zeros_like(size), where=size > 0)
    strides = np.append(np.cumprod(n_cells[:0:-1])[::-1], 1).astype(np.int32)
    bounds = np.empty((len(allowed), int(n_cells.prod()), 2), np.int32)
    in_block, in_cell = np.empty((2, len(palette)), np.uint16)
    entries = [np.flatnonzero(may_take).astype(np.uint16) for may_take in allowed]
    n_candidates = 4 * bounds.size
    while True:
        candidates, end = np.empty(n_candidates, np.uint16), 0
        for names, of_kind in zip(entries, bounds, strict=True):
            end = _dithering.list_candidates(
                palette, names, low, sides, n_blocks, n_in_block, in_block, in_cell, of_kind, candidates, end
            )  # fmt: skip
        if end <= n_candidates:
            return Grid(palette, low, cells_a_unit, strides, bounds, candidates)
        n_candidates = end


def _blocks_on_a_side(n_entries: int, n_dims: int) -> int:
    n_cells = min(_CELLS_AN_ENTRY * n_entries, _MOST_CELLS)
    return max(int(n_cells ** (1 / max(n_dims, 1))) // _BLOCK, 1)
