"""How evenly points fill the unit cube: discrepancy, and the measures of their Voronoi cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_shape, check_that
from cvtimg.designs._unit import check_unit_points
from cvtimg.designs.discrepancy import star_discrepancy
from cvtimg.designs.exact_cells import MOST_EXACT_DIMS, Cells, exact_cells
from cvtimg.designs.sampled_cells import sampled_cells

#: Number of samples of the cube in more dimensions.
_N_SAMPLES = 1 << 20


@dataclass(frozen=True, slots=True)
class PointMeasures:
    """Measures of points in the unit cube; of each, less is more even.

    Attributes
    ----------
    discrepancy : float
        Star discrepancy, D*: the greatest difference between the share of points in a box from the origin and the
        volume of the box.
    h : float
        Mesh norm: the greatest distance from a point of the cube to the nearest point.
    chi : float
        Point distribution ratio: the greatest of twice the reach of a cell over the distance to the nearest neighbor.
    tau : float
        Greatest deviation of the trace of a cell's moment matrix, per volume, from the mean of all cells.
    d : float
        Greatest determinant of the deviatoric part of a cell's moment matrix, per volume.
    energy : float
        Integral over the cube of the squared distance to the nearest point.
    exact_discrepancy, exact_cells : bool
        Whether these were computed exactly: in one to three dimensions. Otherwise the discrepancy is a lower bound,
        and the others come from 2^20 quasi-random samples.
    """

    discrepancy: float
    h: float
    chi: float
    tau: float
    d: float
    energy: float
    exact_discrepancy: bool
    exact_cells: bool


def point_measures(points: ArrayLike, *, periodic: bool = False, rng: int | np.random.Generator = 0) -> PointMeasures:
    """Measure how evenly points fill the unit cube.

    Parameters
    ----------
    points : (n, d) array
        In the unit cube, n >= 2, no two of them equal.
    periodic : bool
        Measure cells on the torus, where opposite walls meet. The discrepancy is that of the cube in any case.
    rng : int or numpy.random.Generator
        Seed of samples and walks in four and more dimensions.

    Returns
    -------
    PointMeasures

    Raises
    ------
    TypeError, ValueError
        If `points` is not what is said here.

    References
    ----------
    V. Romero, J. Burkardt, M. Gunzburger, J. Peterson, Reliability Engineering and System Safety 91 (2006) 1266-1280,
    doi 10.1016/j.ress.2005.11.023.

    Examples
    --------
    >>> from cvtimg import point_measures
    >>> measures = point_measures([[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.75, 0.75]])
    >>> round(measures.h, 4), round(measures.energy, 4), measures.discrepancy
    (0.3536, 0.0417, 0.4375)
    """
    array = check_unit_points("points", points)
    nearest = _nearest_distances(array, periodic)
    discrepancy, is_exact = star_discrepancy(array, rng=rng)
    exact = array.shape[1] <= MOST_EXACT_DIMS
    cells = exact_cells(array, periodic) if exact else sampled_cells(array, _N_SAMPLES, periodic, rng)
    traces, deviators = _moments(cells)
    return PointMeasures(
        discrepancy=discrepancy,
        h=float(cells.reaches.max()),
        chi=float((2 * cells.reaches / nearest).max()),
        tau=float(np.abs(traces - traces.mean()).max()),
        d=float(np.abs(np.linalg.det(deviators)).max()),
        energy=cells.energy,
        exact_discrepancy=is_exact,
        exact_cells=exact,
    )


def _moments(cells: Cells) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n,) traces of the cells' moment matrices per volume, and (n, d, d) their deviatoric parts."""
    n_dims = cells.firsts.shape[1]
    matrices = np.divide(
        cells.seconds,
        cells.volumes[:, None, None],
        out=np.zeros_like(cells.seconds),
        where=cells.volumes[:, None, None] > 0,
    )
    traces = np.einsum("ndd->n", matrices)
    return traces, matrices - traces[:, None, None] / n_dims * np.eye(n_dims)


def _nearest_distances(points: NDArray[np.float64], periodic: bool) -> NDArray[np.float64]:
    from scipy.spatial import cKDTree

    check_shape("points", points.shape, len(points) >= 2, "at least two")
    inside = points % 1.0 if periodic else points
    distances: NDArray[np.float64] = cKDTree(inside, boxsize=1.0 if periodic else None).query(inside, 2)[0][:, 1]
    first = int(np.argmin(distances))
    twice = f"differ from each other: number {first}, {points[first].tolist()}, is there twice"
    check_that("points", distances[first] > 0, twice)
    return distances
