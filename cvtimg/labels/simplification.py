"""Simplification of lines that keeps them from crossing each other.

A simplified line sweeps over the area between it and the original. If no point of any line lies in that area, the line
has crossed no other, and nothing has moved to its other side.

A. Saalfeld, Topologically consistent line simplification with the Douglas-Peucker algorithm, Cartography and
Geographic Information Science 26 (1999) 7-18, doi 10.1559/152304099782424901.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

_Points = NDArray[np.float64]

#: Below this tolerance, in pixels, a line stays as it is.
_LEAST_TOLERANCE = 1 / 16
#: A point within this distance of a line is on it, in pixels: more than rounding in files moves a point.
_ON_LINE = 1e-3


def simplify(
    lines: Sequence[_Points], tolerance: float, spoiled: Callable[[Sequence[_Points]], NDArray[np.intp]]
) -> list[_Points]:
    """Leave out points within `tolerance` of the line that remains, by the method of Douglas and Peucker."""
    # Lines that sweep over a point of another line, or are `spoiled`, are simplified again with half the tolerance
    # until they are neither. First and last points stay.
    tolerances = np.full(len(lines), float(tolerance))
    simple = [_shorter(line, tolerance) for line in lines]
    suspects = list(range(len(lines)))
    while True:
        again = {*_sweeping(lines, simple, suspects), *spoiled(simple).tolist()}
        suspects = sorted(number for number in again if len(simple[number]) < len(lines[number]))
        if not suspects:
            return simple
        for number in suspects:
            tolerances[number] /= 2
            simple[number] = _shorter(lines[number], tolerances[number])


def _shorter(line: _Points, tolerance: float) -> _Points:
    from skimage.measure import approximate_polygon

    if len(line) == 2 or tolerance < _LEAST_TOLERANCE:
        return line
    return approximate_polygon(line, tolerance)  # type: ignore[no-untyped-call]


def _sweeping(lines: Sequence[_Points], simple: Sequence[_Points], suspects: Sequence[int]) -> Iterator[int]:
    """Find the lines among `suspects` that sweep over a point of any line."""
    from scipy.spatial import cKDTree

    swept = [(number, chain) for number in suspects for chain in _left_out(lines[number], simple[number])]
    if not swept:
        return
    places = np.concatenate(lines)
    low, high = (np.array([end(chain, axis=0) for _, chain in swept]) for end in (np.min, np.max))
    radii = np.hypot(*(high - low).T) / 2 + _ON_LINE
    near = cKDTree(places).query_ball_point((low + high) / 2, radii)
    for (number, chain), candidates in zip(swept, near, strict=True):
        if len(candidates) > len(chain) and _is_over(chain, places[candidates]):
            yield number


def _left_out(line: _Points, simple: _Points) -> Iterator[_Points]:
    """Return the stretches of a line between points that remain, where points between them were left out."""
    numbers = line.view(np.complex128)[:, 0]
    kept = np.flatnonzero(np.isin(numbers, simple.view(np.complex128)[:, 0]))
    return (line[start : end + 1] for start, end in pairwise(kept.tolist()) if end > start + 1)


def _is_over(chain: _Points, places: _Points) -> bool:
    """Tell whether a point of another line lies between a chain and the step from its first point to its last."""
    from skimage.measure import points_in_poly

    others = places[~np.isin(places.view(np.complex128)[:, 0], chain.view(np.complex128)[:, 0])]
    if not len(others):
        return False
    if points_in_poly(others, chain).any():  # type: ignore[no-untyped-call]
        return True
    first, step = chain[0], chain[-1] - chain[0]
    length = np.hypot(*step)
    if not length:
        return False
    along, across = (others - first) @ step / length, (others - first) @ (step[1], -step[0]) / length
    return bool(((abs(across) < _ON_LINE) & (along > 0) & (along < length)).any())
