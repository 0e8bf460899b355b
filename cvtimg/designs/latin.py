"""Latin points, one in every slice of every axis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.types import Bools, Floats, Floats32
from cvtimg.designs.cells import check_unit_points


def latinize(points: ArrayLike) -> Floats:
    """Move points to the middles of slices, one in each of n slices of each axis, where their order is kept.

    Parameters
    ----------
    points : (n, d) array
        In the unit cube. Of equal coordinates those of earlier points come first.

    Returns
    -------
    (n, d) float64 array

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
    order = np.argsort(array, axis=0, kind="stable")
    return (np.argsort(order, axis=0, kind="stable") + 0.5) / len(array)


class Slices:
    """Slices of each axis (d, n), by the edges between them (d, n - 1) and their middles (d, n)."""

    def __init__(self, edges: Floats, middles: Floats) -> None:
        self._edges, self._middles = edges, middles

    @classmethod
    def even(cls, n_dims: int, n_slices: int) -> Slices:
        """Make slices of equal width."""
        levels = np.tile(np.arange(1, 2 * n_slices) / (2 * n_slices), (n_dims, 1))
        return cls(levels[:, 1::2], levels[:, ::2])

    @classmethod
    def of_region(cls, samples: Floats32, n_slices: int) -> Slices:
        """Make slices that have equal shares of the samples of a region."""
        # At the quantiles k / 2 n are, in turns, edges and middles.
        levels = np.quantile(samples, np.arange(1, 2 * n_slices) / (2 * n_slices), axis=0).T.astype(float)
        return cls(levels[:, 1::2], levels[:, ::2])

    def free(self, axis: int, points: Floats) -> Floats:
        """Return the middles of the slices of an axis in which none of (n, d) points is."""
        taken = np.searchsorted(self._edges[axis], points[:, axis], "right")
        return np.delete(self._middles[axis], taken)

    def n_empty(self, points: Floats) -> int:
        """Count the slices of all axes in which no point is."""
        return sum(len(self.free(axis, points)) for axis in range(points.shape[1]))

    def latinize(self, points: Floats, existing: Floats, allowed: Callable[[Floats], Bools]) -> Floats:
        """Move points along each axis in turn into slices that have none, as long as that leads to allowed places.

        The sum of squared moves is least; the order may change where it must.
        """
        from scipy.optimize import linear_sum_assignment

        moved, (n_points, n_dims) = points.copy(), points.shape
        for axis in range(n_dims):
            middles = self.free(axis, existing)
            there = np.repeat(moved[:, None], len(middles), axis=1)
            there[..., axis] = middles
            fits = allowed(there.reshape(-1, n_dims)).reshape(n_points, -1)
            # A move to where no point may be costs more than all others together.
            squares = np.where(fits, (moved[:, axis, None] - middles) ** 2, n_points + 1)
            rows, columns = linear_sum_assignment(squares)
            fit = fits[rows, columns]
            moved[rows[fit], axis] = middles[columns[fit]]
        return moved
