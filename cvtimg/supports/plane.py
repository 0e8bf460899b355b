"""Radii in the plane: exact reaches, tightened, with a proof."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.supports.proof import find_gaps
from cvtimg.supports.reach import find_reaches
from cvtimg.supports.repair import close_gaps
from cvtimg.supports.rows import overlaps
from cvtimg.supports.sight import Outline
from cvtimg.supports.tightening import tighten

_Floats = NDArray[np.float64]

#: Exact radii grow by so much, lest three circles meet in one place.
_INFLATION = 1e-6


def radii_in_plane(points: _Floats, outline: Outline, order: int, tightened: bool) -> tuple[_Floats, bool]:
    """Find the radii of disks around (n, 2) points that cover a region; tell whether that is proved."""
    full = find_reaches(points, outline, order) * (1 + _INFLATION)
    full, proved = close_gaps(points, full, outline, order)
    if order == 1 or not tightened or not proved:
        return full, proved
    floors = np.minimum(find_reaches(points, outline, 1) * (1 + _INFLATION), full)
    smaller = tighten(points, full, floors, outline, order)
    smaller, proved = close_gaps(points, smaller, outline, order)
    fewer = len(overlaps(points, smaller).items) < len(overlaps(points, full).items)
    return (smaller, True) if proved and fewer else (full, not len(find_gaps(points, full, outline, order).places))
