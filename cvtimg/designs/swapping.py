"""Swaps of coordinates that make Latin points more even.

Two points that are neighbors along an axis exchange their coordinates there if that lowers the L2 discrepancy: the
centered one, or the one wrapped around the torus (F. Hickernell, Math. Comp. 67 (1998) 299-322, doi
10.1090/S0025-5718-98-00894-1, and Lecture Notes in Statistics 138 (1998) 109-166, doi 10.1007/978-1-4612-1702-2_3).
Points stay Latin, move by a slice at a time and keep apart, so that their cells stay nearly what they were. Swaps of
points that are farther apart along the axis would halve the discrepancy once more, at the cost of uneven cells.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import EffortName
from cvtimg.designs import _swaps

_Floats = NDArray[np.float64]

#: No swap brings two points nearer than this times the least distance before, so that cells stay round.
_APART = 1.15
#: How often each pair of neighbors is tried, and comparisons of points along an axis at most.
_TRIES, _WORK = 10, {"fast": 10_000_000, "balanced": 100_000_000, "best": 1_000_000_000}


def even_out(
    points: _Floats, existing: _Floats, periodic: bool, effort: EffortName, rng: np.random.Generator
) -> _Floats:
    """Swap coordinates of (n, d) Latin points in the unit cube, beside (L, d) that exist and stay."""
    n_points, n_dims = points.shape
    if n_points == 1:
        return points
    n_all = n_points + len(existing)
    n_tries = min(_TRIES * n_points * n_dims, _WORK[effort] // (n_all * n_dims))
    tries = np.stack([rng.integers(n_dims, size=n_tries), rng.integers(n_points - 1, size=n_tries)], axis=1)
    places = np.concatenate([points, existing])
    least = (_APART * _least_distance(places, periodic)) ** 2
    places -= 0.5
    order = np.ascontiguousarray(np.argsort(points, axis=0).T, np.int32)
    _swaps.swap_coordinates(places, order, tries.astype(np.int32), least, periodic)
    return places[:n_points] + 0.5


def _least_distance(points: _Floats, periodic: bool) -> float:
    from scipy.spatial import cKDTree

    tree = cKDTree(points % 1.0, boxsize=1.0) if periodic else cKDTree(points)
    return float(tree.query(tree.data, 2)[0][:, 1].min())
