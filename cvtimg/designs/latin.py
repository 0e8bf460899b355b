"""Latin points, one in every slice of every axis, and swaps of coordinates that make them more even.

Two points that are neighbors along an axis exchange their coordinates there if that lowers the L2 discrepancy: the
centered one, or the one wrapped around the torus (F. Hickernell, Math. Comp. 67 (1998) 299-322, doi
10.1090/S0025-5718-98-00894-1, and Lecture Notes in Statistics 138 (1998) 109-166, doi 10.1007/978-1-4612-1702-2_3).
Points stay Latin, move by a slice at a time and keep apart, so that their cells stay nearly what they were. Swaps of
points that are farther apart along the axis would halve the discrepancy once more, at the cost of uneven cells.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice
from cvtimg.designs import _designs
from cvtimg.designs.cells import check_unit_points

_Floats = NDArray[np.float64]
#: Where in its slice a point lies.
PLACES = ("center", "random")
#: No swap brings two points nearer than this times the least distance before, so that cells stay round.
_APART = 1.15
#: How often each pair of neighbors is tried.
_TRIES = 10


def latinize(points: ArrayLike, *, place: str = "center", rng: int | np.random.Generator = 0) -> _Floats:
    """Move points as little as keeps their order along each axis, so that each slice of each axis has one.

    Parameters
    ----------
    points : (n, d) array
        In the unit cube. Of equal coordinates those of earlier points come first.
    place : {"center", "random"}
        Where each point lies in its slice, which is 1/n wide.
    rng : int or numpy.random.Generator
        Seed of random places.

    Returns
    -------
    (n, d) float64 array

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    See Also
    --------
    cvtimg.design

    References
    ----------
    Y. Saka, M. Gunzburger, J. Burkardt, Int. J. Numerical Analysis and Modeling 4 (2007) 729-743 (Latinized CVT).

    Examples
    --------
    >>> from cvtimg import latinize
    >>> latinize([[0.9, 0.2], [0.8, 0.1]]).tolist()
    [[0.75, 0.75], [0.25, 0.25]]
    """
    array = check_unit_points("points", points)
    check_choice("place", place, PLACES)
    offsets = np.full(array.shape, 0.5) if place == "center" else np.random.default_rng(rng).random(array.shape)
    return (ranks(array) + offsets) / len(array)


def ranks(points: _Floats) -> NDArray[np.intp]:
    """(n, d) rank of each coordinate along its axis, from 0."""
    order = np.argsort(points, axis=0, kind="stable")
    return np.argsort(order, axis=0, kind="stable")


def latinize_beside(points: _Floats, existing: _Floats) -> _Floats:
    """Latinize points among n + L slices, of which those that have some of L existing points are not taken.

    Along each axis the sum of squared moves is least; the order may change where it must.
    """
    from scipy.optimize import linear_sum_assignment

    n_slices = len(points) + len(existing)
    moved = np.empty_like(points)
    for axis in range(points.shape[1]):
        taken = np.minimum((existing[:, axis] * n_slices).astype(int), n_slices - 1)
        free = (np.setdiff1d(np.arange(n_slices), taken) + 0.5) / n_slices
        rows, columns = linear_sum_assignment((points[:, axis, None] - free) ** 2)
        moved[rows, axis] = free[columns]
    return moved


def even_out(points: _Floats, existing: _Floats, periodic: bool, work: int, rng: np.random.Generator) -> _Floats:
    """Swap coordinates of (n, d) Latin points in the unit cube, beside (L, d) that exist and stay.

    At most `work` pairs of points are compared along an axis.
    """
    n_points, n_dims = points.shape
    if n_points == 1:
        return points
    n_all = n_points + len(existing)
    n_tries = min(_TRIES * n_points * n_dims, work // (n_all * n_dims))
    tries = np.stack([rng.integers(n_dims, size=n_tries), rng.integers(n_points - 1, size=n_tries)], axis=1)
    places = np.concatenate([points, existing])
    least = (_APART * _least_distance(places, periodic)) ** 2
    places -= 0.5
    order = np.ascontiguousarray(np.argsort(points, axis=0).T, np.int32)
    _designs.swap_coordinates(places, order, tries.astype(np.int32), least, periodic)
    return places[:n_points] + 0.5


def _least_distance(points: _Floats, periodic: bool) -> float:
    from scipy.spatial import cKDTree

    tree = cKDTree(points % 1.0, boxsize=1.0) if periodic else cKDTree(points)
    return float(tree.query(tree.data, 2)[0][:, 1].min())
