"""The dots of one pen: where they lie and how large they are, for the ink that each pixel asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.artwork.starts import place_points
from cvtimg.placement import PixelMoments

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

DOTS = ("equal", "equal-mass", "sized")
#: Times that dots move to the centers of their power cells, and changes of weights in between.
_MOVES, _CHANGES = 20, 4
#: A cell's mass grows by about this times its density for each unit of weight: the border of a hexagon over twice the
#: distance to its neighbors, and a little more, for neighbors change at once.
_BORDER = 2.2
#: The longest change of a weight, as part of the area of a cell.
_LONGEST = 0.3
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
    points, energy = place_points(amount * amount, n_dots)
    weights = np.zeros(n_dots)
    if dots == "equal-mass":
        points, weights, energy = _share_equally(ink, points)
    points = into_ink(points, ink)
    masses = PixelMoments(ink)(points, weights).masses
    radii = np.full(n_dots, np.sqrt(total / n_dots / np.pi))
    if dots == "sized":
        radii = np.sqrt(masses / np.pi)
        if radius_range is not None:
            radii = np.clip(radii, *radius_range)
    return DotLayer(points, radii, masses, weights, energy)


def _share_equally(ink: Floats32, points: Floats) -> tuple[Floats, Floats, float]:
    """Find power cells of equal mass whose generators are their centers of mass.

    M. Balzer, T. Schloemer, O. Deussen, Capacity-constrained point distributions: a variant of Lloyd's method, ACM
    Trans. Graphics 28 (2009), doi 10.1145/1531326.1531392; by weights as in F. de Goes, K. Breeden, V. Ostromoukhov,
    M. Desbrun, Blue noise through optimal transport, ACM Trans. Graphics 31 (2012), doi 10.1145/2366145.2366190.
    """
    moments = PixelMoments(ink)
    share = moments.mass / len(points)
    weights = np.zeros(len(points))
    for _ in range(_MOVES):
        weights = _balance(moments, points, weights, share)
        found = moments(points, weights)
        points = found.centroids
        weights = weights - weights.mean()
    weights = _balance(moments, points, weights, share)
    return points, weights, moments(points, weights).energy


def _balance(moments: PixelMoments, points: Floats, weights: Floats, share: float) -> Floats:
    """Change weights so that the masses of power cells come nearer to their share."""
    area = np.maximum(_gaps(points) ** 2 * np.sqrt(0.75), 1e-12)  # of a hexagon at that distance
    for _ in range(_CHANGES):
        lack = share - moments(points, weights).masses
        weights = weights + np.clip(lack * area / (_BORDER * share), -_LONGEST * area, _LONGEST * area)
    return weights


def _gaps(points: Floats) -> Floats:
    """Measure how far the nearest other point is."""
    from scipy.spatial import cKDTree

    if len(points) == 1:
        return np.ones(1)
    gaps: Floats = cKDTree(points).query(points, 2)[0][:, 1]
    return gaps


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
