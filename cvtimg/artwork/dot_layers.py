"""The dots of one pen: where they lie and how large they are, for the ink that each pixel asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.placement import PixelMoments, place_in_picture
from cvtimg.placement.pictures import picture_moments

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

DOTS = ("equal", "equal-mass", "sized")
#: Moves of dots to the centers of their power cells, steps of Newton's method after the last, and how far each goes.
_MOVES, _LAST_STEPS, _DAMPING = 8, 4, 0.8
#: How often a step is halved that makes masses less equal, as between lines with paper around them.
_HALVED = 4
#: Ink between dots that have paper between them, as a part of their own, so that all dots hang together.
_LEAST_INK = 0.1
#: Steps of the solver, and the residual, as a part of the first, at which it ends.
_SOLVER_STEPS, _SOLVED = 60, 1e-2
#: Steps of the tones that sizes of dots are told by, and of the search for how they grow.
_TONES, _HALVINGS = 1024, 40


@dataclass(frozen=True, slots=True, eq=False)
class DotLayer:
    """Dots of one pen.

    Attributes
    ----------
    points : (N, 2) float64 array
    radii, masses, weights : (N,) float64 arrays
        As in `Stipples`.
    energy : float
    """

    points: Floats
    radii: Floats
    masses: Floats
    weights: Floats
    energy: float


def place_dots(ink: Floats32, n_dots: int, dots: str, radius_range: tuple[float, float] | None) -> DotLayer:
    """Place dots whose areas add up to the ink everywhere.

    Parameters
    ----------
    ink : (H, W) float32 array
        Area of disks that each pixel asks for.
    n_dots : int
        Number of dots.
    dots : {"equal", "equal-mass", "sized"}
        Dots of one size where the density tells; of one size and cells of one mass; or each as large as its mass.
    radius_range : (float, float) or None
        Least and greatest radius, for "sized".
    """
    total = float(ink.sum(dtype=np.float64))
    if n_dots == 0 or total == 0:
        return DotLayer(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0), 0.0)
    # In a tessellation of density rho there are rho^(1/2) dots in an area. Dots of one size must be as many as the ink.
    amount = ink if radius_range is None else ink / _disk_areas(ink, n_dots, radius_range)
    placement = place_in_picture(amount * amount, n_dots, effort="balanced" if dots == "equal" else "fast")
    points, weights, energy = placement.points, np.zeros(n_dots), placement.energy
    if dots == "equal-mass":
        points, weights, energy = _share_equally(ink, points)
    points = into_ink(points, ink)
    masses = picture_moments(ink, n_dots)(points, weights).masses
    radii = np.full(n_dots, np.sqrt(total / n_dots / np.pi))
    if dots == "sized":
        radii = np.sqrt(masses / np.pi)
        if radius_range is not None:
            radii = np.clip(radii, *radius_range)
    return DotLayer(points, radii, masses, weights, energy)


def share_dots(dots: DotLayer, inks: Sequence[Floats32], order: NDArray[np.intp]) -> list[DotLayer]:
    """Give the dots of one tessellation to several pens, so that each pen has its ink everywhere.

    The dots are walked along a tour, and each goes to the pen that is most in arrears: what a pen has had too much or
    too little is carried on to the next dot, which is near. Dots of all pens together keep their distances.
    """
    if len(dots.points) == 0:
        return [dots] * len(inks)
    found = [
        picture_moments(ink, len(dots.points))(dots.points).masses if ink.any() else np.zeros(len(dots.points))
        for ink in inks
    ]
    wanted = np.stack(found, axis=1)[order]
    pens = np.empty(len(order), np.intp)
    arrears = np.zeros(len(inks))
    for step, (dot, mass) in enumerate(zip(order, wanted, strict=True)):
        arrears += mass
        pens[dot] = pen = int(arrears.argmax())
        arrears[pen] -= wanted[step].sum()
    parts = [np.flatnonzero(pens == pen) for pen in range(len(inks))]
    energies = [dots.energy, *([0.0] * (len(inks) - 1))]
    return [
        DotLayer(dots.points[own], dots.radii[own], dots.masses[own], dots.weights[own], energy)
        for own, energy in zip(parts, energies, strict=True)
    ]


def _share_equally(ink: Floats32, points: Floats) -> tuple[Floats, Floats, float]:
    """Find power cells of equal mass whose generators are near their centers of mass.

    Weights follow from Newton's method on the lack of mass of each cell. A move to the center of mass carries ink over
    long ways, after which weights begin anew.

    M. Balzer, T. Schloemer, O. Deussen, Capacity-constrained point distributions: a variant of Lloyd's method, ACM
    Trans. Graphics 28 (2009), doi 10.1145/1531326.1531392; by weights as in F. de Goes, K. Breeden, V. Ostromoukhov,
    M. Desbrun, Blue noise through optimal transport, ACM Trans. Graphics 31 (2012), doi 10.1145/2366145.2366190.
    """
    weights = np.zeros(len(points))
    if len(points) == 1:
        return points, weights, picture_moments(ink, 1)(points).energy
    moments = picture_moments(ink, len(points))
    share = moments.mass / len(points)
    for _ in range(_MOVES):
        exchange = _exchange(ink, points, share)
        weights = _balanced(moments, points, np.zeros(len(points)), share, exchange)
        if not weights.any():
            break
        points = moments(points, weights).centroids
    exchange, weights = _exchange(ink, points, share), np.zeros(len(points))
    for _ in range(_LAST_STEPS):
        weights = _balanced(moments, points, weights, share, exchange)
    return points, weights, moments(points, weights).energy


def _balanced(moments: PixelMoments, points: Floats, weights: Floats, share: float, exchange: Any) -> Floats:
    """Step towards weights whose power cells have equal masses, or stay where no step leads there."""
    lack = share - moments(points, weights).masses
    step = _DAMPING * _solve(exchange, lack)
    for _ in range(_HALVED):
        there = weights + step
        if np.square(share - moments(points, there).masses).sum() < np.square(lack).sum():
            return there
        step /= 2
    return weights


def _exchange(ink: Floats32, points: Floats, share: float) -> Any:
    """Return the (N, N) sparse matrix of how masses change with weights, for cells that are nearly hexagons.

    A border of length l between generators at distance d moves by 1 / (2 d) for each unit of weight, and l / d is
    3^(-1/2) in a lattice of hexagons. Neighbors are the six nearest points.
    """
    from scipy.sparse import csr_array, dia_array
    from scipy.spatial import cKDTree

    n_points = len(points)
    gaps, near = cKDTree(points).query(points, min(7, n_points))
    own, others = np.repeat(np.arange(n_points), near.shape[1] - 1), near[:, 1:].ravel()
    middles = np.clip((points[own] + points[others]) / 2, 0, np.array(ink.shape[::-1]) - 1).astype(np.intp)
    least = _LEAST_INK * share / np.maximum(gaps[:, 1] ** 2, 1e-6)
    flow = np.maximum(ink[middles[:, 1], middles[:, 0]], least[own]) / (2 * np.sqrt(3))
    one_way = csr_array((flow, (own, others)), shape=(n_points, n_points))
    both_ways = one_way.maximum(one_way.T)
    return dia_array((both_ways.sum(axis=1)[np.newaxis] * (1 + 1e-4), [0]), shape=both_ways.shape) - both_ways


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


def _disk_areas(ink: Floats32, n_dots: int, radius_range: tuple[float, float]) -> Floats32:
    """Choose how large the dots of each tone are, from the least radius to the greatest, so that n dots give the ink.

    The radius grows as a power of the ink from one to the other; the power is what makes the number right. Where even
    the least or the greatest for all tones does not, the tones will be off.
    """
    least, greatest = radius_range
    darkest = float(ink.max())
    counts, edges = np.histogram(ink, _TONES, (0, darkest))
    tones = (edges[1:] + edges[:-1]) / 2

    def areas(tone: Floats, exponent: float) -> Floats:
        return np.pi * (least + (greatest - least) * (tone / darkest) ** exponent) ** 2

    low, high = -10.0, 10.0  # logarithms of the power
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        n_needed = float((counts * tones / areas(tones, np.exp(middle))).sum())
        low, high = (middle, high) if n_needed < n_dots else (low, middle)
    table = areas(np.linspace(0, darkest, _TONES), np.exp(middle)).astype(np.float32)
    chosen: Floats32 = table[np.rint(ink * np.float32((_TONES - 1) / darkest)).astype(np.intp)]
    return chosen


def into_ink(points: Floats, ink: Floats32) -> Floats:
    """Move points that lie on paper to the nearest pixel that asks for ink.

    The center of mass of a cell may lie outside of what it is the center of, as for a ring.
    """
    height, width = ink.shape
    size = np.array([width, height])
    points = np.clip(points, 0, np.nextafter(size, 0))
    x, y = points.astype(np.intp).T
    lost, reach = np.flatnonzero(ink[y, x] == 0), 1
    while len(lost):
        steps = np.arange(-reach, reach + 1)
        found = np.zeros(len(lost), np.bool_)
        for number, dot in enumerate(lost):
            columns = steps + int(points[dot, 0])
            rows = steps + int(points[dot, 1])
            columns, rows = columns[(columns >= 0) & (columns < width)], rows[(rows >= 0) & (rows < height)]
            inked = np.argwhere(ink[np.ix_(rows, columns)])
            if len(inked):
                pixels = np.stack([columns[inked[:, 1]], rows[inked[:, 0]]], axis=1)
                places = np.clip(points[dot], pixels + 0.25, pixels + 0.75)
                points[dot] = places[((places - points[dot]) ** 2).sum(axis=1).argmin()]
                found[number] = True
        lost, reach = lost[~found], 2 * reach
    return points
