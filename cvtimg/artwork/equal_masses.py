"""Power cells of equal mass, whose generators are near their centers of mass.

M. Balzer, T. Schloemer, O. Deussen, Capacity-constrained point distributions: a variant of Lloyd's method, ACM Trans.
Graphics 28 (2009), doi 10.1145/1531326.1531392; by weights as in F. de Goes, K. Breeden, V. Ostromoukhov, M. Desbrun,
Blue noise through optimal transport, ACM Trans. Graphics 31 (2012), doi 10.1145/2366145.2366190; and by Newton's
method on them, with steps halved where masses would be less equal, as in J. Kitagawa, Q. Merigot, B. Thibert,
Convergence of a Newton algorithm for semi-discrete optimal transport, J. Eur. Math. Soc. 21 (2019), doi
10.4171/JEMS/889.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.placement import PixelMoments

Floats = NDArray[np.float64]

#: Steps of Newton's method after the last move.
_LAST_STEPS = 4
#: How often a step is halved that makes masses less equal, as between lines with paper around them.
_HALVED = 6
#: What neighbors exchange at least, as a part of what they would in a lattice: across paper all cells hang together.
_LEAST_EXCHANGE = 0.1 / (2 * np.sqrt(3))
#: Points nearer to each other than this, in pixels, exchange no more.
_NEAR = 0.05
#: Steps of the solver, and the residual, as a part of the first, at which it ends.
_SOLVER_STEPS, _SOLVED = 60, 1e-2


def share_equally(moments: PixelMoments, points: Floats, n_moves: int) -> tuple[Floats, Floats]:
    """Return points and the weights of power cells that share the mass of a picture.

    Points make `n_moves` moves to the centers of mass of such cells. A move carries ink over long ways, after which
    weights begin anew.
    """
    weights = np.zeros(len(points))
    if len(points) == 1:
        return points, weights
    for _ in range(n_moves):
        points = moments(points, _balanced(moments, points, np.zeros(len(points)))).centroids
    for _ in range(_LAST_STEPS):
        weights = _balanced(moments, points, weights)
    return points, weights


def _balanced(moments: PixelMoments, points: Floats, weights: Floats) -> Floats:
    """Step towards weights whose power cells have equal masses, or stay where no step leads there."""
    share = moments.mass / len(points)
    lack = share - moments(points, weights).masses
    step = _solve(_exchange(moments, points, weights), lack)
    for _ in range(_HALVED):
        there = weights + step
        if np.square(share - moments(points, there).masses).sum() < np.square(lack).sum():
            return there
        step /= 2
    return weights


def _exchange(moments: PixelMoments, points: Floats, weights: Floats) -> Any:
    """Return the (N, N) sparse matrix of how masses change with weights.

    A border between generators at distance d moves by 1 / (2 d) for each unit of weight. In a row of pixels it moves
    by 1 / (2 dx), so that the density there over 2 dx, summed over rows, is what two cells exchange; over columns for
    borders that run more along rows.
    """
    from scipy.sparse import csr_array, dia_array
    from scipy.spatial import cKDTree

    n_points = len(points)
    labels, density = moments.labels(points, weights), moments.density
    found = [_crossings(labels, density, points), _crossings(labels.T, density.T, points[:, ::-1])]
    one, other, flow = (np.concatenate(parts) for parts in zip(*found, strict=True))
    # Weights are in squared units and dx in units; a border moves by pixels, of which a unit has as many as the scale.
    borders = csr_array((flow * moments.scale, (one, other)), shape=(n_points, n_points))
    gaps, near = cKDTree(points).query(points, min(7, n_points))
    own, others = np.repeat(np.arange(n_points), near.shape[1] - 1), near[:, 1:].ravel()
    least = _LEAST_EXCHANGE * moments.mass / n_points / np.maximum(gaps[:, 1] ** 2, 1e-6)
    close = csr_array((least[own], (own, others)), shape=(n_points, n_points))
    both_ways = (borders + borders.T).maximum(close.maximum(close.T))
    return dia_array((both_ways.sum(axis=1)[np.newaxis] * (1 + 1e-4), [0]), shape=both_ways.shape) - both_ways


def _crossings(
    labels: NDArray[np.int32], density: NDArray[np.float32], points: Floats
) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats]:
    """List where borders that run more along columns cross rows: the cells on both sides, and what they exchange."""
    y, x = np.nonzero(labels[:, 1:] != labels[:, :-1])
    left, right = labels[y, x], labels[y, x + 1]
    step_x, step_y = np.abs(points[right] - points[left]).T
    steep = step_x >= step_y
    y, x, left, right, step_x = y[steep], x[steep], left[steep], right[steep], step_x[steep]
    here = 0.5 * (density[y, x] + density[y, x + 1])
    return left, right, here / (2 * np.maximum(step_x, _NEAR))


def _solve(matrix: Any, right: Floats) -> Floats:
    """Solve a positive definite system by conjugate gradients, roughly.

    Not by SciPy, whose products go through a BLAS: its threads change bits, and spin while they wait.
    """
    scale = 1 / matrix.diagonal()
    solution = np.zeros_like(right)
    rest = right.copy()
    direction = scale * rest
    product = first = float(np.einsum("k,k", rest, direction))
    for _ in range(_SOLVER_STEPS):
        if product <= _SOLVED**2 * first:
            break
        image = matrix @ direction
        length = product / float(np.einsum("k,k", direction, image))
        solution += length * direction
        rest -= length * image
        scaled = scale * rest
        before, product = product, float(np.einsum("k,k", rest, scaled))
        direction = scaled + product / before * direction
    return solution
