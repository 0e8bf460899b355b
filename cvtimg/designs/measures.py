"""How evenly points fill the unit cube: discrepancy, and the measures of their Voronoi cells.

The star discrepancy says how far the share of points in a box from the origin is from the box's volume, at worst. In
one to three dimensions it is counted exactly. In more that is NP-hard, and threshold accepting finds a lower bound,
which is often the value itself: P. Winker, K.-T. Fang, SIAM J. Numerical Analysis 34 (1997) 2028-2042,
doi 10.1137/S0036142995286076.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import cvtimg.designs._designs as _designs
from cvtimg._shared.budgets import ENOUGH_SAMPLES
from cvtimg._shared.checks import check_shape, check_that
from cvtimg._shared.types import Floats, Indices, Ints
from cvtimg.designs.cells import MOST_EXACT_DIMS, Cube, check_unit_points, exact_cells, nearest_distances, sobol_samples
from cvtimg.placement.cells import regularity


def star_discrepancy(points: ArrayLike, *, rng: int | np.random.Generator = 0) -> tuple[float, bool]:
    """Compute the star discrepancy of points in the unit cube.

    Parameters
    ----------
    points : (n, d) array
        In the unit cube. For d = 3 the cost grows as n^3: 1,000 points take some ten seconds.
    rng : int or numpy.random.Generator
        Seed of the walks in four and more dimensions.

    Returns
    -------
    float, bool
        The discrepancy, and whether it is exact; if not it is a lower bound.

    Examples
    --------
    >>> from cvtimg.designs import star_discrepancy
    >>> star_discrepancy([[0.25, 0.75], [0.75, 0.25]])
    (0.5625, True)
    """
    array = check_unit_points("points", points)
    if array.shape[1] <= MOST_EXACT_DIMS:
        return _exact(array), True
    return _lower_bound(array, np.random.default_rng(rng)), False


def _exact(points: Floats) -> float:
    """Visit all corners that coordinates of points span: boxes with and without their upper sides."""
    from scipy.stats import kstest

    n_points, n_dims = points.shape
    if n_dims == 1:
        return float(kstest(points[:, 0], "uniform").statistic)
    sides = [np.unique(np.append(axis, 1.0)) for axis in points.T]
    at = [np.searchsorted(side, axis) for side, axis in zip(sides, points.T, strict=True)]
    # An open box has the points up to the corner before its own: the first row and column stay 0.
    counts = np.zeros((len(sides[0]) + 1, len(sides[1]) + 1), np.int32)
    closed_counts, open_counts = counts[1:, 1:], counts[:-1, :-1]
    areas = np.multiply.outer(*sides[:2])

    def gap(of: Ints, depth: float, sign: int) -> float:
        return float((sign * (of / n_points - depth * areas)).max())

    def add(members: Indices) -> None:
        for point in members:
            closed_counts[at[0][point] :, at[1][point] :] += 1

    if n_dims == 2:
        add(np.arange(n_points))
        return max(gap(closed_counts, 1.0, 1), gap(open_counts, 1.0, -1))
    greatest = 0.0
    for layer, depth in enumerate(sides[2]):
        greatest = max(greatest, gap(open_counts, depth, -1))
        add(np.flatnonzero(at[2] == layer))
        greatest = max(greatest, gap(closed_counts, depth, 1))
    return greatest


def _lower_bound(points: Floats, rng: np.random.Generator) -> float:
    n_points, n_dims = points.shape
    sides = np.concatenate([np.sort(points, axis=0), np.ones((1, n_dims))]).T.copy()
    # Comparisons of points with boxes in each walk take about a tenth of a second.
    n_steps = int(np.clip(20_000_000 // (n_points * n_dims), 1000, 50_000))
    left = np.linspace(1, 0, n_steps)
    greatest = 0.0
    for _ in range(10):  # walks, which end in different corners
        # Large boxes matter most: start with sides whose product is spread evenly.
        corner = np.floor(rng.random(n_dims) ** (1 / n_dims) * n_points).astype(np.int32)
        reach = (1 + left * n_points / 8).astype(np.int64)[:, None]
        moves = rng.integers(-reach, reach + 1, (n_steps, n_dims))
        moves[rng.random((n_steps, n_dims)) > 2 / n_dims] = 0
        thresholds = left**2 / (2 * np.sqrt(n_points))
        greatest = max(greatest, _designs.walk_boxes(points, sides, corner, moves.astype(np.int32), thresholds))
    return greatest


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
    check_shape("points", array.shape, len(array) >= 2, "at least two")
    nearest = nearest_distances(array, periodic)
    first = int(np.argmin(nearest))
    twice = f"differ from each other: number {first}, {array[first].tolist()}, is there twice"
    check_that("points", nearest[first] > 0, twice)
    discrepancy, is_exact = star_discrepancy(array, rng=rng)
    if exact := array.shape[1] <= MOST_EXACT_DIMS:
        cells = exact_cells(array, periodic)
    else:
        cells = Cube(sobol_samples(8 * ENOUGH_SAMPLES, array.shape[1], rng), periodic=periodic).cells(array)
    return PointMeasures(
        discrepancy=discrepancy,
        **regularity(cells, nearest),
        energy=cells.energy,
        exact_discrepancy=is_exact,
        exact_cells=exact,
    )
