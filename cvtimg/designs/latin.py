"""Latin points, one in every slice of every axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice
from cvtimg.designs.cells import check_unit_points

_Floats = NDArray[np.float64]
#: Where in its slice a point lies.
PLACES = ("center", "random")


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


def free_slices(coordinates: _Floats, n_slices: int) -> _Floats:
    """Return the centers of slices of an axis that have none of the coordinates."""
    taken = np.minimum((coordinates * n_slices).astype(int), n_slices - 1)
    return np.asarray((np.setdiff1d(np.arange(n_slices), taken) + 0.5) / n_slices)


def latinize_beside(points: _Floats, existing: _Floats) -> _Floats:
    """Latinize points among n + L slices, of which those that have some of L existing points are not taken.

    Along each axis the sum of squared moves is least; the order may change where it must.
    """
    from scipy.optimize import linear_sum_assignment

    n_slices = len(points) + len(existing)
    moved = np.empty_like(points)
    for axis in range(points.shape[1]):
        free = free_slices(existing[:, axis], n_slices)
        rows, columns = linear_sum_assignment((points[:, axis, None] - free) ** 2)
        moved[rows, axis] = free[columns]
    return moved
